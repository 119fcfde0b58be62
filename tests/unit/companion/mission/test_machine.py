"""The mission's table and machine: who wins, what is asked for, when motors may be stopped."""

from __future__ import annotations

from dataclasses import replace

import pytest

from companion.config import Mission, Safety
from companion.messages import (
    AutopilotMode,
    CommandKind,
    LandedState,
    OperatorAction,
    PadEstimate,
    Phase,
    VehicleStatus,
)
from companion.mission.facts import Facts
from companion.mission.guards import GUARDS
from companion.mission.machine import Machine
from companion.mission.phases import OFFBOARD_PHASES, TABLE, Event
from companion.mission.touchdown import NO_EVIDENCE, TouchdownEvidence

DT_S = 0.02
STATUS = VehicleStatus(
    t_ns=0,
    connected=True,
    armed=True,
    mode=AutopilotMode.HOLD,
    intended_mode=AutopilotMode.HOLD,
    landed_state=LandedState.IN_AIR,
    failsafe=False,
    ready_to_arm=True,
    battery_fraction=0.8,
    home_position_ned_m=None,
    link_age_s=0.1,
)
PAD = PadEstimate(
    t_ns=0,
    position_ned_m=(0.0, 0.0, 0.0),
    velocity_ned_m_s=(1.0, 0.0, 0.0),
    acceleration_ned_m_s2=(0.0, 0.0, 0.0),
    yaw_rad=0.0,
    yaw_rate_rad_s=0.0,
    covariance=tuple(tuple(0.01 if i == j else 0.0 for j in range(6)) for i in range(6)),
    vision_age_s=0.05,
    beacon_age_s=0.2,
    model="test",
)
FACTS = Facts(
    t_ns=0,
    status=STATUS,
    mode_age_s=0.1,
    state_age_s=0.02,
    distance_from_start_m=5.0,
    height_above_start_m=1.0,
    tilt_rad=0.0,
    pad=None,
    relative_position_m=None,
    relative_velocity_m_s=None,
    touchdown=NO_EVIDENCE,
    no_plan_reason=None,
    operator=None,
    refused=None,
    frame_age_s=0.03,
)
STANDING = TouchdownEvidence(suspected=True, airborne=False, proven_for_s=1.0, signs=("range 0.15 m", "thrust low"))


class Flight:
    """Feeds one machine, 20 ms at a time."""

    def __init__(self) -> None:
        self.machine = Machine(Mission(), Safety())
        self.facts = FACTS
        self.commands: list[CommandKind] = []

    def tick(self, seconds: float = DT_S, **changes: object) -> Phase:
        self.facts = replace(self.facts, **changes)  # type: ignore[arg-type]
        for _ in range(max(1, round(seconds / DT_S))):
            self.facts = replace(self.facts, t_ns=self.facts.t_ns + round(DT_S * 1e9))
            step = self.machine.step(self.facts, dt_s=DT_S)
            self.commands += [command.kind for command in step.commands]
            self.facts = replace(self.facts, operator=None)
        return self.machine.phase

    def status(self, **changes: object) -> VehicleStatus:
        assert self.facts.status is not None
        return replace(self.facts.status, **changes)  # type: ignore[arg-type]

    def to(self, phase: Phase) -> Flight:
        """The ordinary way to a phase."""
        near = {"relative_position_m": (0.1, 0.0, -5.0), "relative_velocity_m_s": (0.0, 0.1, 0.0)}
        low = {"relative_position_m": (0.1, 0.0, -0.5)}
        steps: list[tuple[Phase, float, dict[str, object]]] = [
            (Phase.ENGAGE, DT_S, {"operator": OperatorAction.START}),
            (Phase.SEARCH, 0.4, {"status": self.status(mode=AutopilotMode.OFFBOARD)}),
            (Phase.APPROACH, DT_S, {"pad": replace(PAD, vision_age_s=None)}),
            (Phase.FOLLOW, 0.5, {"pad": PAD}),
            (Phase.DESCEND, 1.0, near),
            (Phase.COMMIT, DT_S, low),
            (Phase.TOUCHDOWN, DT_S, {"touchdown": STANDING}),
        ]
        for target, seconds, changes in steps:
            assert self.tick(seconds, **changes) is target
            if target is phase:
                return self
        raise AssertionError(phase)


def test_every_event_has_a_guard_and_every_phase_has_a_row() -> None:
    assert set(GUARDS) == set(Event)
    assert set(TABLE) == set(Phase)


@pytest.mark.parametrize("phase", sorted(OFFBOARD_PHASES - {Phase.ENGAGE}))
def test_in_every_phase_that_flies_the_pilot_and_the_failsafe_win(phase: Phase) -> None:
    assert TABLE[phase][Event.PILOT_TOOK_OVER] is Phase.IDLE
    assert TABLE[phase][Event.AUTOPILOT_FAILSAFE] is Phase.IDLE


@pytest.mark.parametrize("phase", sorted(OFFBOARD_PHASES - {Phase.ABORT}))
def test_abort_ends_every_phase_that_flies_in_hold_or_a_climb_away(phase: Phase) -> None:
    assert TABLE[phase][Event.OPERATOR_ABORT] in (Phase.HOLD, Phase.ABORT)


def test_nothing_happens_before_start() -> None:
    flight = Flight()
    assert flight.tick(5.0, pad=PAD) is Phase.IDLE
    assert flight.commands == []


def test_offboard_is_asked_for_only_after_setpoints_have_streamed() -> None:
    flight = Flight()
    flight.tick(0.1, operator=OperatorAction.START)
    assert flight.commands == []
    flight.tick(0.2)
    assert flight.commands == [CommandKind.OFFBOARD]


def test_an_unanswered_request_is_repeated_slowly_not_every_tick() -> None:
    flight = Flight()
    flight.tick(3.5, operator=OperatorAction.START)
    assert flight.commands == [CommandKind.OFFBOARD] * 3


def test_refused_offboard_ends_the_attempt() -> None:
    flight = Flight().to(Phase.ENGAGE)
    assert flight.tick(refused="offboard: temporarily rejected") is Phase.IDLE


def test_the_ordinary_way_leads_to_the_pad_and_a_plain_disarm_first() -> None:
    flight = Flight().to(Phase.TOUCHDOWN)
    flight.tick()
    assert flight.commands[-1] is CommandKind.DISARM


def test_a_refused_disarm_is_forced_only_with_evidence() -> None:
    flight = Flight().to(Phase.TOUCHDOWN)
    flight.tick()
    flight.tick(refused="disarm: temporarily rejected", touchdown=replace(STANDING, proven_for_s=0.1))
    assert CommandKind.FORCE_DISARM not in flight.commands
    flight.tick(refused="disarm: temporarily rejected", touchdown=STANDING)
    assert flight.commands[-1] is CommandKind.FORCE_DISARM


def test_disarmed_on_the_pad_is_done() -> None:
    flight = Flight().to(Phase.TOUCHDOWN)
    assert flight.tick(status=flight.status(armed=False)) is Phase.DONE


def test_a_bounce_leads_to_a_go_around() -> None:
    flight = Flight().to(Phase.TOUCHDOWN)
    assert flight.tick(touchdown=NO_EVIDENCE) is Phase.GO_AROUND


@pytest.mark.parametrize("phase", [Phase.SEARCH, Phase.APPROACH, Phase.FOLLOW, Phase.DESCEND, Phase.COMMIT])
def test_pilot_who_changes_the_mode_has_the_vehicle_and_nothing_is_asked_of_it(phase: Phase) -> None:
    flight = Flight().to(phase)
    before = list(flight.commands)
    assert flight.tick(status=flight.status(mode=AutopilotMode.POSITION)) is Phase.IDLE
    flight.tick(10.0)
    assert flight.commands == before


def test_after_a_failsafe_companion_waits_for_a_person() -> None:
    flight = Flight().to(Phase.FOLLOW)
    assert flight.tick(status=flight.status(mode=AutopilotMode.RETURN, failsafe=True)) is Phase.IDLE
    assert flight.tick(10.0, status=flight.status(mode=AutopilotMode.HOLD, failsafe=False)) is Phase.IDLE


def test_hold_is_asked_for_while_our_mode_holds_and_never_against_another() -> None:
    flight = Flight().to(Phase.FOLLOW)
    flight.tick(operator=OperatorAction.HOLD)
    assert flight.machine.phase is Phase.HOLD
    assert flight.commands[-1] is CommandKind.HOLD
    flight.commands.clear()
    flight.tick(5.0, status=flight.status(mode=AutopilotMode.MANUAL))
    assert flight.commands == []


def test_pad_out_of_sight_for_too_long_in_the_descent_means_go_around_then_follow_again() -> None:
    flight = Flight().to(Phase.DESCEND)
    assert flight.tick(pad=replace(PAD, vision_age_s=3.0)) is Phase.GO_AROUND
    assert flight.machine.go_arounds == 1
    assert flight.tick(pad=PAD, relative_position_m=(0.0, 0.0, -5.0)) is Phase.FOLLOW


def test_go_arounds_are_limited() -> None:
    flight = Flight().to(Phase.FOLLOW)
    flight.machine.go_arounds = Mission().max_go_arounds + 1
    assert flight.tick() is Phase.HOLD


def test_commit_waits_until_miss_speed_and_tilt_fit() -> None:
    flight = Flight().to(Phase.DESCEND)
    low = (0.1, 0.0, -0.5)
    assert flight.tick(relative_position_m=low, relative_velocity_m_s=(1.0, 0.0, 0.0)) is Phase.DESCEND
    assert flight.tick(relative_velocity_m_s=(0.1, 0.0, 0.0), tilt_rad=0.4) is Phase.DESCEND
    assert flight.tick(relative_position_m=(0.5, 0.0, -0.5), tilt_rad=0.0) is Phase.DESCEND
    assert flight.tick(relative_position_m=low) is Phase.COMMIT


def test_low_battery_returns() -> None:
    flight = Flight().to(Phase.FOLLOW)
    assert flight.tick(status=flight.status(battery_fraction=0.1)) is Phase.RETURN
