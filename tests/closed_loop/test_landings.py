"""Whole landings in lockstep with the simulator: MAVLink bytes, rendered images, the wind, and faults. Seeds are listed."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import pytest

from companion.campaign.runner import FlightResult, Operator, fly
from companion.config import Config
from companion.messages import (
    AutopilotMode,
    CommandKind,
    OperatorAction,
    PadObservation,
    Phase,
    PhaseChanged,
    VehicleCommand,
    VehicleStatus,
)
from companion.messages import VelocitySetpoint as Setpoint
from companion.onboard import JournalEntry
from companion.reproduce.watched_flight import preset
from sitl_stub.scenario import find, load, with_overrides
from sitl_stub.world import Truth

pytestmark = pytest.mark.timeout(300)


@dataclass
class Witness:
    """Keeps what the checks look at."""

    entries: list[JournalEntry] = field(default_factory=list)
    last_truth: Truth | None = None

    def datagram(self, now_ns: int, data: bytes, *, outgoing: bool) -> None:
        pass

    def journal(self, entries: Any) -> None:
        self.entries += [
            e
            for e in entries
            if isinstance(e.message, Setpoint | VehicleCommand | PhaseChanged | VehicleStatus | PadObservation)
        ]

    def truth(self, now_ns: int, truth: Truth) -> None:
        self.last_truth = truth

    def close(self) -> None:
        pass

    def of(self, kind: type) -> list[Any]:
        return [entry.message for entry in self.entries if isinstance(entry.message, kind)]


def flown(
    scenario: str, seed: int, *, world: dict[str, Any] | None = None, operator: Operator | None = None
) -> tuple[FlightResult, Witness]:
    witness = Witness()
    loaded = with_overrides(load(scenario), world or {})
    return fly(loaded, Config(), seed=seed, sinks=(witness,), operator=operator), witness


def assert_landed(result: FlightResult, *, error_m: float) -> None:
    assert result.outcome == "landed", result
    assert result.verdict.touchdown_error_m is not None
    assert result.verdict.touchdown_error_m <= error_m, result.verdict
    assert not result.verdict.forced_disarm_in_air


@pytest.mark.parametrize(("scenario", "seed"), [("line", 1), ("circle", 3), ("figure8", 2)])
def test_the_vehicle_lands_on_a_pad_at_walking_pace(scenario: str, seed: int) -> None:
    result, _ = flown(scenario, seed)
    assert_landed(result, error_m=0.3)


def test_a_stereo_camera_whose_frames_hold_both_pictures_lands_the_boat_papers_preset() -> None:
    witness = Witness()
    near = {"mission.follow_behind_m": 2.25}
    result = fly(load(find("scenarios/papers", "guo_cart")), preset("guo", near), seed=2, sinks=(witness,))
    assert_landed(result, error_m=0.3)
    assert {seen.detector for seen in witness.of(PadObservation)} == {"stereo"}


def test_it_takes_off_from_the_ground_first_when_it_stands_there() -> None:
    result, witness = flown("takeoff", 1)
    assert_landed(result, error_m=0.3)
    kinds = [command.kind for command in witness.of(VehicleCommand)]
    assert CommandKind.ARM in kinds
    assert CommandKind.TAKEOFF in kinds


def test_markers_hidden_for_two_seconds_in_the_descent_do_not_spoil_the_landing() -> None:
    result, _ = flown("marker_hidden", 1)
    assert_landed(result, error_m=0.3)


def test_a_pad_whose_markers_vanish_for_good_is_landed_on_while_its_beacon_keeps_it_known() -> None:
    mission, half_deck_m = Config().mission, 0.5 * Config().pad.width_m
    result, _ = flown("blind_end", 2)
    assert_landed(result, error_m=half_deck_m - mission.vehicle_foot_radius_m)
    assert result.go_arounds == 0


def test_nothing_touches_a_pad_that_is_neither_seen_nor_heard_of_in_the_end() -> None:
    silent = {"kind": "beacon_lost", "when_below_m": 1.6}
    covered = {"kind": "marker_covered", "when_below_m": 1.6}
    result, witness = flown("blind_end", 2, world={"faults": [covered, silent], "duration_limit_s": 35.0})
    assert result.outcome in ("timeout", "held"), result
    assert result.touchdown_s is None
    assert any("unsure" in change.reason or "not seen" in change.reason for change in witness.of(PhaseChanged))


def test_a_link_cut_for_three_seconds_leaves_the_vehicle_to_the_autopilots_failsafe() -> None:
    cut = {"faults": [{"kind": "datagram_loss", "start_s": 12.0, "duration_s": 3.0}], "duration_limit_s": 30.0}
    result, witness = flown("line", 1, world=cut)
    assert result.outcome == "held", result
    assert result.phase is Phase.IDLE
    modes = [status.mode for status in witness.of(VehicleStatus)]
    assert modes[-1] in (AutopilotMode.RETURN, AutopilotMode.LAND)
    back = next(i for i, e in enumerate(witness.entries) if _is_back(e))
    late = [e for e in witness.entries[back:] if isinstance(e.message, Setpoint)]
    assert not late, "a setpoint after the failsafe would have taken OFFBOARD back"
    assert not result.verdict.forced_disarm_in_air


def _is_back(entry: JournalEntry) -> bool:
    return isinstance(entry.message, VehicleStatus) and entry.message.mode is AutopilotMode.RETURN


def test_a_pilot_who_switches_to_hold_has_the_vehicle_for_good() -> None:
    pilot = {"faults": [{"kind": "pilot_input", "start_s": 12.0, "mode": "hold"}], "duration_limit_s": 25.0}
    result, witness = flown("line", 1, world=pilot)
    assert result.outcome == "held", result
    taken = next(
        i
        for i, e in enumerate(witness.entries)
        if isinstance(e.message, PhaseChanged) and e.message.after is Phase.IDLE
    )
    after = witness.entries[taken + 1 :]
    assert not [e for e in after if isinstance(e.message, Setpoint | VehicleCommand)]
    assert witness.of(VehicleStatus)[-1].mode is AutopilotMode.HOLD


def test_an_operators_hold_stops_the_vehicle_in_hold() -> None:
    hold = Operator(actions=((10.0, OperatorAction.HOLD),))
    result, witness = flown("line", 1, world={"duration_limit_s": 16.0}, operator=hold)
    assert result.phase is Phase.HOLD
    assert witness.of(VehicleStatus)[-1].mode is AutopilotMode.HOLD


def test_an_operators_go_around_is_flown_and_the_landing_follows() -> None:
    again = Operator(actions=((17.0, OperatorAction.GO_AROUND),))
    result, _ = flown("line", 1, operator=again)
    assert result.go_arounds == 1
    assert_landed(result, error_m=0.3)


def test_ten_seconds_without_the_markers_and_their_return_make_no_jump_of_the_setpoint() -> None:
    hidden = {"faults": [{"kind": "marker_covered", "start_s": 14.0, "duration_s": 10.0}]}
    result, witness = flown("line", 1, world=hidden)
    assert_landed(result, error_m=0.3)
    control = Config().control
    allowed_m_s = control.max_slew_m_s2 / control.rate_hz + 1e-6
    setpoints = witness.of(Setpoint)
    steps = [math.dist(a.velocity_ned_m_s, b.velocity_ned_m_s) for a, b in pairwise(setpoints)]
    assert max(steps) <= allowed_m_s
    gaps_s = [(b.t_ns - a.t_ns) / 1e9 for a, b in pairwise(setpoints)]
    assert max(gaps_s) <= 1.5 / control.rate_hz, "blind or not, the stream goes on"
