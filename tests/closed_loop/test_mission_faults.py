"""The mission against faults, in lockstep with the simulator's autopilot and physics. Seeds are listed.

Two things must hold whatever breaks: motors never stop in the air, and after a silence that made the autopilot act by itself
Companion sends nothing until a person says START.
"""

from __future__ import annotations

import math
from typing import Any

import pytest
from geometric_rig import Rig

from companion.config import Config, Mission, Planning, Safety, Zone
from companion.messages import (
    AutopilotMode,
    CommandKind,
    Health,
    OperatorAction,
    Phase,
    PhaseChanged,
    VehicleCommand,
    VehicleStatus,
    VelocitySetpoint,
)
from companion.mission.search import PATTERNS

STOPPING_M = 5.0
"""A fence acts when it is crossed, at up to 5 m/s; the autopilot's Hold then brakes."""

pytestmark = pytest.mark.timeout(300)


def assert_motors_stopped_on_the_pad_only(rig: Rig) -> None:
    assert not rig.world.verdict().forced_disarm_in_air
    if Phase.TOUCHDOWN not in rig.phases():
        assert not [c for c in rig.messages(VehicleCommand) if c.kind in (CommandKind.DISARM, CommandKind.FORCE_DISARM)]


@pytest.mark.parametrize(
    ("phase", "cut_s"),
    [
        (Phase.SEARCH, 0.5),
        (Phase.FOLLOW, 0.5),
        (Phase.DESCEND, 0.5),
        (Phase.COMMIT, 0.5),
        (Phase.FOLLOW, 1.3),
        (Phase.COMMIT, 1.3),
        (Phase.DESCEND, 3.0),
    ],
)
def test_a_cut_link_is_survived_or_final_and_offboard_is_never_taken_back(phase: Phase, cut_s: float) -> None:
    rig = Rig({})
    rig.run_to(phase)
    rig.run(0.3)
    rig.cut = True
    rig.run(cut_s)
    rig.cut = False
    back_s = rig.now_s
    rig.run(1.5 if cut_s < 1.0 else 4.0, lambda: rig.ending != "flying")
    assert_motors_stopped_on_the_pad_only(rig)
    if cut_s < 1.0:
        assert Phase.IDLE not in rig.phases(), "short enough to go on"
        return
    assert rig.phase is Phase.IDLE, rig.onboard.pipeline.note
    assert rig.setpoints_sent(back_s) == []
    assert rig.messages(VehicleCommand, after_s=back_s) == []
    modes = {status.mode for status in rig.messages(VehicleStatus, after_s=back_s + 1.0)}
    assert AutopilotMode.OFFBOARD not in modes


def test_a_program_that_stood_still_for_over_a_second_does_not_fly_on() -> None:
    rig = Rig({})
    rig.run_to(Phase.DESCEND)
    rig.paused = True
    rig.run(1.2)
    rig.paused = False
    back_s = rig.now_s
    rig.run(3.0)
    assert rig.phase is Phase.IDLE, rig.onboard.pipeline.note
    assert rig.setpoints_sent(back_s) == []


def test_a_program_that_stood_still_for_half_a_second_holds_relative_to_the_pad_flies_on_and_lands() -> None:
    rig = Rig({})
    rig.run_to(Phase.DESCEND)
    rig.run(0.5)
    rig.paused = True
    stopped_s = rig.now_s
    rig.run(0.5)
    assert rig.setpoints_sent(stopped_s + 0.02) == [], "nobody sends in its place"
    rig.paused = False
    back_s = rig.now_s
    assert rig.run(1.0, lambda: bool(rig.messages(VelocitySetpoint, after_s=back_s)))
    (first,) = rig.messages(VelocitySetpoint, after_s=back_s)
    vehicle, pad = rig.world.truth().vehicle.velocity_ned_m_s, rig.world.truth().pad_velocity_ned_m_s
    assert math.dist(first.velocity_ned_m_s[:2], pad[:2]) < 0.6, "with the pad"
    assert first.velocity_ned_m_s[2] <= vehicle[2] + 0.05, "and no faster down than it was"
    assert rig.fly_out(40.0) == "on_pad"


def test_no_setpoint_is_on_the_wire_twice_and_none_outside_our_phases() -> None:
    """A whole flight with a pause of the program, a cut link and an operator's hold at its end."""
    rig = Rig({})
    rig.run_to(Phase.FOLLOW)
    rig.paused = True
    rig.run(0.4)
    rig.paused = False
    rig.run_to(Phase.DESCEND)
    rig.cut = True
    rig.run(0.3)
    rig.cut = False
    rig.run(1.0)
    rig.onboard.operate(OperatorAction.HOLD, "test", rig.now_ns)
    rig.run(3.0)
    payloads = [payload for _, payload in rig.setpoints_sent()]
    made = rig.messages(VelocitySetpoint)
    assert len(payloads) == len(made) > 100
    assert len({payload[:4] for payload in payloads}) == len(payloads), "each has a time of its own"
    held_s = next(t_s for t_s, message in rig.kept if isinstance(message, PhaseChanged) and message.after is Phase.HOLD)
    assert rig.setpoints_sent(held_s + 0.01) == []


@pytest.mark.parametrize("deaf_s", [0.6, 1.04, 1.052, 1.2])
def test_an_autopilot_that_heard_nothing_for_a_while_is_not_flown_on_behind_its_failsafe(deaf_s: float) -> None:
    """Only the way to the autopilot is cut, so that setpoints go on leaving. PX4 takes OFFBOARD back at the first setpoint after
    its failsafe, without a word: whichever side of that moment the link comes back on, Companion either flies on in a
    flight that was never left, or sends nothing more and leaves no OFFBOARD behind. At 1.052 s the setpoint that brings
    OFFBOARD back had left before the failsafe was known: it lasts until the autopilot misses the next one."""
    rig = Rig({})
    rig.run_to(Phase.FOLLOW)
    rig.run(0.5)
    rig.deaf = True
    rig.run(deaf_s)
    rig.deaf = False
    back_s = rig.now_s
    rig.run(4.0)
    modes = {status.mode for status in rig.messages(VehicleStatus, after_s=back_s - deaf_s)}
    if modes == {AutopilotMode.OFFBOARD}:
        assert rig.phase is not Phase.IDLE, rig.onboard.pipeline.note
        return
    assert rig.phase is Phase.IDLE, rig.onboard.pipeline.note
    idle_s = next(t_s for t_s, message in rig.kept if isinstance(message, PhaseChanged) and message.after is Phase.IDLE)
    assert idle_s < back_s + 0.2
    assert rig.setpoints_sent(idle_s + 0.01) == []
    assert rig.messages(VehicleStatus)[-1].mode is not AutopilotMode.OFFBOARD


@pytest.mark.parametrize(
    "fault",
    [
        {"kind": "range_stuck", "when_below_m": 3.0},
        {"kind": "range_lost", "when_below_m": 4.0},
        {"kind": "camera_blackout", "when_below_m": 0.6},
        {"kind": "camera_freeze", "when_below_m": 0.4},
        {"kind": "datagram_loss", "fraction": 0.2, "start_s": 4.0},
        {"kind": "estimator_reset", "north_m": 2.0, "down_m": 1.0, "start_s": 10.0, "duration_s": 1.0},
    ],
    ids=lambda fault: str(fault["kind"]),
)
def test_no_fault_stops_motors_in_the_air(fault: dict[str, Any]) -> None:
    rig = Rig({"faults": [fault]}, seed=2)
    ending = rig.fly_out(30.0)
    assert_motors_stopped_on_the_pad_only(rig)
    assert ending in ("on_pad", "flying"), ending


def test_a_camera_that_stops_for_good_leads_up_again_and_into_hold() -> None:
    mission = Mission(search_time_s=3.0, pad_lost_s=3.0, vision_lost_follow_s=2.0)
    faults = [{"kind": "camera_stop", "when_below_m": 3.0}, {"kind": "beacon_lost", "when_below_m": 3.0}]
    rig = Rig({"faults": faults}, Config(mission=mission))
    rig.run_to(Phase.GO_AROUND)
    rig.run_to(Phase.HOLD)
    assert Phase.SEARCH in rig.phases()
    assert_motors_stopped_on_the_pad_only(rig)


def test_a_pad_in_a_no_land_zone_is_never_descended_to() -> None:
    everywhere = Zone(name="lake", center_m=(0.0, 0.0), radius_m=1000.0)
    rig = Rig({}, Config(safety=Safety(zones=(everywhere,))))
    rig.run_to(Phase.FOLLOW)
    rig.run(8.0)
    assert rig.phase is Phase.FOLLOW
    assert -rig.world.truth().vehicle_in_pad_m[2] > 3.5


@pytest.mark.parametrize("height_m", [1.5, 0.7])
def test_an_abort_near_the_deck_climbs_away_with_motors_running(height_m: float) -> None:
    rig = Rig({}, seed=3)
    assert rig.run(60.0, lambda: -rig.world.truth().vehicle_in_pad_m[2] < height_m)
    rig.onboard.operate(OperatorAction.ABORT, "test", rig.now_ns)
    rig.run_to(Phase.HOLD, 15.0)
    rig.run(1.0)
    assert rig.ending == "flying"
    assert rig.messages(VehicleStatus)[-1].mode is AutopilotMode.HOLD
    assert_motors_stopped_on_the_pad_only(rig)


def test_a_start_without_a_camera_is_refused_and_says_so() -> None:
    rig = Rig({"faults": [{"kind": "camera_stop"}]}, Config(mission=Mission(start_wait_s=1.0)))
    rig.run(5.0)
    assert rig.phase is Phase.IDLE
    assert rig.onboard.pipeline.note == "START refused: no camera frames"
    assert rig.messages(VehicleCommand) == []


@pytest.mark.parametrize(
    ("safety", "world", "phase", "note"),
    [
        (Safety(geofence_radius_m=8.0), {"place.pad_distance_m": 30.0}, Phase.HOLD, "fence 8 m"),
        (Safety(ceiling_m=2.0), {"vehicle.start_height_m": 3.0}, Phase.HOLD, "ceiling 2 m"),
        (Safety(max_flight_time_s=6.0), {}, Phase.RETURN, "s since the start"),
        (Safety(), {"faults": [{"kind": "battery_low", "start_s": 6.0}]}, Phase.RETURN, "reserve 20%"),
    ],
    ids=["fence", "ceiling", "flight time", "battery"],
)
def test_each_limit_ends_the_attempt_in_the_autopilots_own_mode(
    safety: Safety, world: dict[str, Any], phase: Phase, note: str
) -> None:
    rig = Rig(world, Config(safety=safety))
    start = rig.world.truth().vehicle.position_ned_m
    rig.run_to(phase, 20.0)
    assert note in rig.onboard.pipeline.note
    rig.run(3.0)
    assert rig.setpoints_sent(rig.now_s - 2.0) == []
    wanted = AutopilotMode.HOLD if phase is Phase.HOLD else AutopilotMode.RETURN
    assert rig.messages(VehicleStatus)[-1].mode is wanted
    assert math.dist(rig.world.truth().vehicle.position_ned_m[:2], start[:2]) < safety.geofence_radius_m + STOPPING_M


@pytest.mark.parametrize("scenario", ["boat_2m", "boat_4m"])
def test_a_deck_in_waves_is_touched_and_the_vehicle_stays_on_it(scenario: str) -> None:
    rig = Rig({}, scenario=scenario)
    assert rig.fly_out(90.0) == "on_pad", rig.onboard.pipeline.note
    assert_motors_stopped_on_the_pad_only(rig)


def test_an_operators_return_is_the_autopilots_return() -> None:
    rig = Rig({})
    rig.run_to(Phase.DESCEND)
    rig.onboard.operate(OperatorAction.RETURN, "test", rig.now_ns)
    rig.run_to(Phase.RETURN, 1.0)
    rig.run(2.0)
    assert rig.messages(VehicleStatus)[-1].mode is AutopilotMode.RETURN
    assert rig.setpoints_sent(rig.now_s - 1.0) == []


def test_after_the_allowed_go_arounds_the_vehicle_climbs_away_and_holds() -> None:
    rig = Rig({}, Config(mission=Mission(max_go_arounds=1)))
    for _ in range(2):
        rig.run_to(Phase.DESCEND)
        rig.onboard.operate(OperatorAction.GO_AROUND, "test", rig.now_ns)
        rig.run(0.1)
    rig.run_to(Phase.HOLD, 20.0)
    assert rig.phases()[-2:] == [Phase.ABORT, Phase.HOLD]
    assert_motors_stopped_on_the_pad_only(rig)


@pytest.mark.parametrize("planner", ["bspline", "bezier", "min_snap"])
def test_a_no_fly_zone_between_vehicle_and_pad_is_flown_round(planner: str) -> None:
    def distance_to_mast_m() -> float:
        north, east, _ = rig.world.truth().vehicle.position_ned_m
        return math.hypot(north - mast[0], east - mast[1])

    def turn_and_measure() -> bool:
        nearest_m.append(distance_to_mast_m())
        return rig.ending != "flying"

    rig = Rig({"path.kind": "line", "path.speed_m_s": 0.5, "place.pad_distance_m": 30.0}, seed=2)
    vehicle, pad = rig.world.truth().vehicle.position_ned_m, rig.world.truth().pad_position_ned_m
    mast = (0.5 * (vehicle[0] + pad[0]), 0.5 * (vehicle[1] + pad[1]))
    zone = Zone(name="mast", kind="no_fly", center_m=mast, radius_m=4.0)
    rig = Rig(rig.world_changes, Config(safety=Safety(zones=(zone,)), planning=Planning(planner=planner)), seed=2)
    nearest_m: list[float] = []
    rig.run(60.0, turn_and_measure)
    assert rig.ending == "on_pad", rig.onboard.pipeline.note
    assert min(nearest_m) > 4.0


@pytest.mark.parametrize("planner", ["bspline", "min_jerk"])
def test_a_pad_that_its_beacon_reports_a_hundred_metres_away_is_flown_to(planner: str) -> None:
    rig = Rig({"place.pad_distance_m": 100.0}, Config(planning=Planning(planner=planner)), seed=2)
    assert rig.fly_out(90.0) == "on_pad", rig.onboard.pipeline.note
    assert Phase.APPROACH in rig.phases()


@pytest.mark.parametrize("pattern", sorted(PATTERNS))
def test_a_pad_without_a_beacon_is_found_by_every_pattern_within_its_area(pattern: str) -> None:
    """The pad stands 15 m from the start, out of the camera's view."""
    mission = Mission(search_pattern=pattern, search_radius_m=25.0)  # type: ignore[arg-type]
    rig = Rig({"beacon.fitted": False, "place.pad_distance_m": 15.0, "path.kind": "still"}, Config(mission=mission))
    start = rig.world.truth().vehicle.position_ned_m
    away_m: list[float] = []

    def searched() -> bool:
        away_m.append(math.dist(rig.world.truth().vehicle.position_ned_m[:2], start[:2]))
        return rig.phase is Phase.FOLLOW

    assert rig.run(120.0, searched), rig.onboard.pipeline.note
    assert max(away_m) <= mission.search_radius_m + 2.0
    assert rig.fly_out(60.0) == "on_pad", rig.onboard.pipeline.note


def test_a_pad_without_a_beacon_is_found_by_way_of_the_waypoints() -> None:
    """Two legs at a right angle lead to a pad 40 m away, further than the search around the start would go."""
    world = {"beacon.fitted": False, "place.pad_distance_m": 40.0, "path.kind": "still"}
    rig = Rig(world)
    vehicle, pad = rig.world.truth().vehicle.position_ned_m, rig.world.truth().pad_position_ned_m
    north, east = pad[0] - vehicle[0], pad[1] - vehicle[1]
    corner = (vehicle[0] + 0.5 * (north - east), vehicle[1] + 0.5 * (east + north))
    rig = Rig(world, Config(mission=Mission(approach_waypoints_m=(corner, (pad[0] - 3.0, pad[1])))))
    passed_m: list[float] = []

    def flown() -> bool:
        passed_m.append(math.dist(rig.world.truth().vehicle.position_ned_m[:2], corner))
        return rig.phase is Phase.FOLLOW

    assert rig.run(90.0, flown), rig.onboard.pipeline.note
    assert min(passed_m) < 2.0
    assert rig.fly_out(60.0) == "on_pad", rig.onboard.pipeline.note


def test_a_pad_that_is_lost_for_good_is_searched_for_along_its_last_velocity() -> None:
    """Markers and beacon end in the descent; after the go-around the search goes with the pad, and ends in Hold."""
    faults = ({"kind": "camera_stop", "when_below_m": 4.0}, {"kind": "beacon_lost", "start_s": 5.0})
    mission = Mission(search_time_s=15.0)
    rig = Rig({"faults": list(faults)}, Config(mission=mission))
    rig.run_to(Phase.SEARCH, 10.0)
    rig.run_to(Phase.DESCEND, 40.0)
    rig.run_to(Phase.SEARCH, 60.0)
    rig.run(10.0)
    vehicle, pad = rig.world.truth().vehicle.position_ned_m, rig.world.truth().pad_position_ned_m
    assert math.dist(vehicle[:2], pad[:2]) <= mission.search_radius_m + 5.0
    rig.run_to(Phase.HOLD, 30.0)
    assert_motors_stopped_on_the_pad_only(rig)


def test_a_planner_that_finds_nothing_says_why_and_the_vehicle_keeps_its_place_against_the_pad() -> None:
    rig = Rig({"place.pad_distance_m": 20.0}, Config(planning=Planning(max_jerk_m_s3=0.001)))
    rig.run_to(Phase.APPROACH, 10.0)
    rig.run(5.0)
    before = _between(rig)
    rig.run(10.0)
    told = [health for health in rig.messages(Health) if health.subject == "plan"]
    assert [health.level for health in told] == [1]
    assert "jerk" in told[0].text
    assert math.dist(before, _between(rig)) < 1.5


def _between(rig: Rig) -> tuple[float, float]:
    vehicle, pad = rig.world.truth().vehicle.position_ned_m, rig.world.truth().pad_position_ned_m
    return (vehicle[0] - pad[0], vehicle[1] - pad[1])
