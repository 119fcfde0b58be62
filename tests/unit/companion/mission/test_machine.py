"""The mission's table and machine: who wins, what is asked for, when motors may be stopped."""

from __future__ import annotations

from dataclasses import replace

import pytest
from mission_samples import FACTS, PAD, STANDING

from companion.config import Mission, Safety
from companion.messages import (
    AutopilotMode,
    CommandKind,
    Health,
    LandedState,
    OperatorAction,
    Phase,
    VehicleStatus,
)
from companion.mission.contact import Contact
from companion.mission.guards import GUARDS
from companion.mission.machine import Machine
from companion.mission.phases import OFFBOARD_PHASES, TABLE, Event
from companion.mission.touchdown import NO_EVIDENCE

DT_S = 0.02


class Flight:
    """Feeds one machine, 20 ms at a time."""

    def __init__(self, mission: Mission | None = None, *, safety: Safety | None = None) -> None:
        self.machine = Machine(mission or Mission(), safety or Safety())
        self.facts = FACTS
        self.commands: list[CommandKind] = []
        self.health: list[Health] = []

    def tick(self, seconds: float = DT_S, **changes: object) -> Phase:
        self.facts = replace(self.facts, **changes)  # type: ignore[arg-type]
        for _ in range(max(1, round(seconds / DT_S))):
            self.facts = replace(self.facts, t_ns=self.facts.t_ns + round(DT_S * 1e9))
            step = self.machine.step(self.facts, dt_s=DT_S)
            self.commands += [command.kind for command in step.commands]
            self.health += step.health
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
            (Phase.APPROACH, DT_S, {"pad": replace(PAD, vision_age_s=None), "sight_age_s": None}),
            (Phase.FOLLOW, 0.5, {"pad": PAD, "sight_age_s": 0.02}),
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


def test_a_vehicle_lying_on_the_deck_has_its_motors_stopped_and_one_tilted_in_the_air_has_not() -> None:
    lying = replace(STANDING, proven_for_s=0.0, airborne=False)
    flight = Flight().to(Phase.TOUCHDOWN)
    flight.commands.clear()
    flight.tick(1.0, tilt_rad=1.4, touchdown=replace(lying, airborne=True, suspected=False))
    assert CommandKind.FORCE_DISARM not in flight.commands
    flight = Flight().to(Phase.TOUCHDOWN)
    flight.commands.clear()
    flight.tick(0.2, tilt_rad=1.4, touchdown=lying)
    assert flight.commands == []
    flight.tick(0.2)
    assert flight.commands == [CommandKind.FORCE_DISARM]


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
    assert flight.tick(sight_age_s=3.0) is Phase.GO_AROUND
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
    assert flight.tick(relative_velocity_m_s=(0.1, 0.0, 0.0), tilt_rad=0.5) is Phase.DESCEND
    assert flight.tick(relative_position_m=(0.5, 0.0, -0.5), tilt_rad=0.0) is Phase.DESCEND
    assert flight.tick(relative_position_m=low) is Phase.COMMIT


def test_low_battery_returns() -> None:
    flight = Flight().to(Phase.FOLLOW)
    assert flight.tick(status=flight.status(battery_fraction=0.1)) is Phase.RETURN


def test_a_start_that_cannot_be_obeyed_waits_and_says_for_what() -> None:
    flight = Flight()
    assert flight.tick(operator=OperatorAction.START, frame_age_s=None) is Phase.IDLE
    assert flight.machine.note == "START waits: no camera frames"
    assert flight.tick(status=flight.status(home_position_ned_m=(0.0, 0.0, 0.0)), frame_age_s=0.03) is Phase.ENGAGE
    assert [(h.level, h.text) for h in flight.health] == [(1, "START waits: no camera frames"), (0, "START obeyed")]


def test_a_start_that_cannot_be_obeyed_in_time_is_refused_with_its_reasons_and_stays_refused() -> None:
    flight = Flight()
    flight.tick(5.1, operator=OperatorAction.START, status=flight.status(battery_fraction=0.1), state_age_s=2.0)
    assert flight.machine.note.startswith("START refused: ")
    assert "2.0 s old" in flight.machine.note
    assert "battery 10%" in flight.machine.note
    assert [(h.subject, h.level) for h in flight.health] == [("start", 1), ("start", 2)]
    assert flight.tick(1.0, status=flight.status(battery_fraction=0.9), state_age_s=0.02) is Phase.IDLE
    assert flight.commands == []


def test_a_waiting_start_is_taken_back_by_hold() -> None:
    flight = Flight()
    flight.tick(operator=OperatorAction.START, frame_age_s=None)
    flight.tick(operator=OperatorAction.HOLD)
    assert flight.tick(1.0, frame_age_s=0.03) is Phase.IDLE


def test_a_start_on_the_ground_needs_an_autopilot_that_is_ready_to_arm() -> None:
    flight = Flight()
    on_ground = flight.status(armed=False, landed_state=LandedState.ON_GROUND, ready_to_arm=False)
    assert flight.tick(operator=OperatorAction.START, status=on_ground) is Phase.IDLE
    assert "not ready to arm" in flight.machine.note
    assert flight.tick(status=replace(on_ground, ready_to_arm=True)) is Phase.TAKEOFF


def test_a_pilot_who_takes_over_while_offboard_is_being_asked_for_has_the_vehicle() -> None:
    flight = Flight().to(Phase.ENGAGE)
    flight.tick(1.0)
    assert flight.tick(status=flight.status(mode=AutopilotMode.POSITION)) is Phase.IDLE


def test_a_pilot_who_takes_over_from_hold_ends_our_part_so_that_nothing_is_asked_again() -> None:
    flight = Flight().to(Phase.FOLLOW)
    flight.tick(operator=OperatorAction.HOLD)
    assert flight.tick(0.1) is Phase.HOLD, "OFFBOARD until the autopilot has answered"
    assert flight.tick(status=flight.status(mode=AutopilotMode.HOLD)) is Phase.HOLD
    assert flight.tick(status=flight.status(mode=AutopilotMode.ALTITUDE)) is Phase.IDLE


@pytest.mark.parametrize(
    "phase", [Phase.ENGAGE, Phase.SEARCH, Phase.FOLLOW, Phase.DESCEND, Phase.COMMIT, Phase.TOUCHDOWN]
)
@pytest.mark.parametrize("what", [{"state_age_s": 1.1}, {"mode_age_s": 1.1}, {"tick_gap_s": 1.1}], ids=str)
def test_a_silence_that_makes_the_autopilot_act_by_itself_is_final(phase: Phase, what: dict[str, float]) -> None:
    flight = Flight().to(phase)
    assert flight.tick(**what) is Phase.IDLE
    assert flight.tick(5.0, state_age_s=0.02, mode_age_s=0.1, tick_gap_s=0.02) is Phase.IDLE


def test_a_search_without_result_ends_as_configured() -> None:
    for action, phase in (("hold", Phase.HOLD), ("return", Phase.RETURN)):
        flight = Flight(Mission(search_time_s=2.0, lost_action=action)).to(Phase.SEARCH)
        assert flight.tick(2.1) is phase


def test_the_pad_in_a_no_land_zone_is_followed_and_not_landed_on() -> None:
    flight = Flight().to(Phase.FOLLOW)
    near = {"relative_position_m": (0.1, 0.0, -5.0), "relative_velocity_m_s": (0.0, 0.1, 0.0)}
    assert flight.tick(5.0, no_land_zone="lock", **near) is Phase.FOLLOW
    assert flight.tick(no_land_zone=None) is Phase.DESCEND
    assert flight.tick(no_land_zone="lock") is Phase.GO_AROUND


@pytest.mark.parametrize(
    "changes",
    [{"relative_position_m": (0.8, 0.0, -0.7)}, {"sight_age_s": 2.6}],
    ids=["beside the deck", "pad hidden"],
)
def test_over_water_the_last_metre_is_flown_over_the_seen_deck_only(changes: dict[str, object]) -> None:
    low: dict[str, object] = {"relative_position_m": (0.1, 0.0, -0.7), "relative_velocity_m_s": (0.9, 0.0, 0.0)}
    flight = Flight(safety=Safety(only_the_pad_is_land=True)).to(Phase.DESCEND)
    assert flight.tick(**low) is Phase.DESCEND
    assert flight.tick(**changes) is Phase.GO_AROUND
    assert "water" in flight.machine.note


def test_a_no_fly_zone_and_the_fence_end_in_hold() -> None:
    assert Flight().to(Phase.APPROACH).tick(no_fly_zone="mast") is Phase.HOLD
    assert Flight().to(Phase.APPROACH).tick(distance_from_start_m=501.0) is Phase.HOLD
    assert Flight().to(Phase.APPROACH).tick(height_above_start_m=61.0) is Phase.HOLD


def test_too_long_a_flight_returns() -> None:
    assert Flight(safety=Safety(max_flight_time_s=3.0)).to(Phase.FOLLOW).tick(3.0) is Phase.RETURN


def test_the_commit_waits_for_the_deck() -> None:
    flight = Flight().to(Phase.DESCEND)
    steady = Contact(in_s=0.5, miss_m=0.1, deck_tilt_rad=0.0, deck_climb_m_s=0.0)
    low = (0.1, 0.0, -0.5)
    assert flight.tick(relative_position_m=low, contact=replace(steady, deck_climb_m_s=0.9)) is Phase.DESCEND
    assert flight.tick(contact=replace(steady, deck_climb_m_s=-0.9)) is Phase.DESCEND
    assert flight.tick(contact=replace(steady, deck_tilt_rad=0.2)) is Phase.DESCEND
    assert flight.tick(contact=replace(steady, miss_m=0.5)) is Phase.DESCEND
    assert flight.tick(contact=steady) is Phase.COMMIT
    assert flight.tick(contact=replace(steady, deck_tilt_rad=0.3)) is Phase.GO_AROUND


def test_the_commit_waits_for_a_straighter_part_but_not_for_ever() -> None:
    flight = Flight(mission=Mission(straight_wait_s=4.0)).to(Phase.DESCEND)
    low: dict[str, object] = {"relative_position_m": (0.1, 0.0, -0.5)}
    assert flight.tick(pad_is_bent=True, **low) is Phase.DESCEND
    assert flight.tick(4.5, pad_is_bent=True, **low) is Phase.COMMIT


def test_go_arounds_are_counted_anew_only_at_a_new_start() -> None:
    flight = Flight().to(Phase.DESCEND)
    flight.tick(operator=OperatorAction.GO_AROUND)
    flight.tick(operator=OperatorAction.HOLD)
    flight.tick(status=flight.status(mode=AutopilotMode.HOLD))
    assert flight.machine.go_arounds == 1
    flight.tick(operator=OperatorAction.START)
    assert flight.machine.phase is Phase.ENGAGE
    assert flight.machine.go_arounds == 0


def test_no_disarm_on_evidence_about_a_state_of_long_ago() -> None:
    flight = Flight().to(Phase.TOUCHDOWN)
    flight.commands.clear()
    flight.tick(0.5, state_age_s=0.5)
    assert flight.commands == []
