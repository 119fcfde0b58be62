"""The world as a whole: starts, endings, faults, cameras and beacon, flown by a pilot who knows the truth."""

from __future__ import annotations

import itertools
import math
from typing import Any

import msgspec
import pytest
from pymavlink.dialects.v20 import common
from truth_pilot import TruthPilot

from sitl_stub import scenario as scenarios
from sitl_stub.datagram_faults import Datagram
from sitl_stub.scenario import Scenario
from sitl_stub.verdict import Ending
from sitl_stub.world import StepOutput, World


def blind(name: str = "line", **overrides: Any) -> Scenario:
    """A scenario without cameras; keys with a double underscore for the dot."""
    loaded = msgspec.structs.replace(scenarios.load(name), cameras={})
    return scenarios.with_overrides(loaded, {key.replace("__", "."): value for key, value in overrides.items()})


def near(name: str = "line", **overrides: Any) -> Scenario:
    """The vehicle begins low over the pad, so that flights are short."""
    return blind(name, place__pad_distance_m=2.0, vehicle__start_height_m=3.0, **overrides)


def messages(outputs: list[StepOutput], kind: str, system: int | None = None) -> list[Any]:
    """Decoded by pymavlink, which shares no code with the simulator."""
    reader = common.MAVLink(None)
    reader.robust_parsing = True
    found = []
    for output in outputs:
        for datagram in output.datagrams:
            if datagram.link == "onboard":
                found += reader.parse_buffer(bytearray(datagram.data)) or []
    return [m for m in found if m.get_type() == kind and system in (None, m.get_srcSystem())]


@pytest.mark.parametrize("name", ["static", "line", "circle", "figure8", "boat"])
def test_a_pilot_who_knows_the_truth_lands_on_the_pad(name: str) -> None:
    verdict = TruthPilot(World(near(name), 3)).fly(40.0)
    assert verdict.ending is Ending.ON_PAD
    assert verdict.is_success
    assert not verdict.forced_disarm_in_air
    assert verdict.touchdown_error_m is not None
    assert verdict.touchdown_error_m < 0.4
    assert verdict.final_error_m is not None
    assert abs(verdict.final_error_m - verdict.touchdown_error_m) < 0.3


def test_motors_stopped_over_the_deck_are_seen_as_such_even_if_the_vehicle_stays_on_it() -> None:
    world = World(near("static"), 3)
    pilot = TruthPilot(world, disarm=False)
    while world.truth().vehicle_in_pad_m[2] < -0.42:
        pilot.turn()
    assert world.truth().contact.feet_on_deck == 0
    world.step(0.004, [pilot.command(400, 0.0, 21196.0)])
    world.step(6.0)
    assert world.verdict().forced_disarm_in_air
    assert world.verdict().ending is Ending.ON_PAD


def test_motors_stopped_high_up_are_a_fall() -> None:
    world = World(blind("static"), 1)
    pilot = TruthPilot(world)
    world.step(0.2)
    world.step(0.2, [pilot.command(400, 0.0, 21196.0)])
    world.step(6.0)
    assert world.verdict().ending is Ending.FELL_AFTER_MOTORS_OFF
    assert world.verdict().forced_disarm_in_air
    assert world.truth().vehicle.position_ned_m[2] > -0.4


def test_landing_beside_the_pad_is_off_pad() -> None:
    world = World(near("static"), 2)
    pilot = TruthPilot(world)
    world.step(0.1, [pilot.command(21)])
    world.step(40.0)
    assert world.verdict().ending is Ending.OFF_PAD
    assert not world.verdict().is_success


def test_coming_down_half_over_the_edge_is_not_a_landing() -> None:
    world = World(near("static", wind__mean_m_s=0.0, estimate__error_scale=0.0), 2)
    verdict = TruthPilot(world, aim_m=(0.82, 0.0)).fly(30.0)
    assert verdict.ending in (Ending.TIPPED, Ending.SLID_OFF, Ending.HIT_SIDE, Ending.CRASHED, Ending.TIMEOUT, "flying")
    assert not verdict.is_success


def test_time_runs_out() -> None:
    world = World(blind(duration_limit_s=2.0), 1)
    world.step(2.1 - 0.1 + 0.1)
    assert world.verdict().ending is Ending.TIMEOUT
    assert world.verdict().t_s == pytest.approx(2.0, abs=0.005)


def test_a_success_may_ask_for_more_than_staying_on_the_deck() -> None:
    scenario = near("static", success__max_touchdown_error_m=0.001)
    verdict = TruthPilot(World(scenario, 3)).fly(40.0)
    assert verdict.ending is Ending.ON_PAD
    assert not verdict.is_success


def test_a_vehicle_that_starts_on_the_ground_stays_there_until_it_is_armed() -> None:
    world = World(blind("takeoff"), 1)
    before = world.truth().vehicle.position_ned_m
    world.step(5.0)
    after = world.truth()
    assert math.dist(before, after.vehicle.position_ned_m) < 0.01
    assert not after.is_armed
    assert after.vehicle.on_surface
    assert world.verdict().ending is Ending.FLYING


def test_a_vehicle_that_starts_on_the_deck_is_carried_by_it() -> None:
    world = World(blind("line_4_2", vehicle__start="deck"), 1)
    world.step(0.4)
    begun = world.truth().vehicle_in_pad_m
    world.step(20.0)
    assert math.dist(begun, world.truth().vehicle_in_pad_m) < 0.02
    assert math.hypot(*world.truth().vehicle.position_ned_m[:2]) > 80.0


def test_a_vehicle_that_starts_in_the_air_hovers_in_loiter() -> None:
    world = World(blind("static", wind__mean_m_s=0.0, wind__gust_sigma_m_s=0.0, estimate__error_scale=0.0), 1)
    world.step(5.0)
    truth = world.truth()
    assert truth.is_armed
    assert truth.mode == "AUTO_LOITER"
    assert math.dist(truth.vehicle.position_ned_m, (0.0, 0.0, -10.0)) < 0.3


def test_a_step_that_is_no_multiple_of_the_physics_step_is_refused() -> None:
    world = World(blind(), 1)
    for dt_s in (0.0, 0.003, 0.0101, -0.004):
        with pytest.raises(ValueError, match="multiple of"):
            world.step(dt_s)


def test_the_beacon_says_where_the_pad_is_within_its_error() -> None:
    world = World(blind("line", beacon__position_sigma_m=1.5), 4)
    outputs = [world.step(0.1) for _ in range(100)]
    positions = messages(outputs, "GLOBAL_POSITION_INT", system=2)
    assert len(positions) == pytest.approx(50, abs=2)
    assert len(messages(outputs, "HEARTBEAT", system=2)) == pytest.approx(10, abs=1)
    last = positions[-1]
    north, east = world.origin.to_local(last.lat * 1e-7, last.lon * 1e-7)
    pad = world.truth().pad_position_ned_m
    assert 0.01 < math.hypot(north - pad[0], east - pad[1]) < 6.0
    assert last.vx * 0.01 == pytest.approx(world.truth().pad_velocity_ned_m_s[0], abs=0.6)
    assert last.relative_alt * 0.001 == pytest.approx(0.5, abs=5.0)
    assert world.t_us / 1000 - last.time_boot_ms < 320


def test_frames_come_at_their_rate_and_late_by_their_delay() -> None:
    scenario = scenarios.with_overrides(
        scenarios.load("line"),
        {"cameras.down.width_px": 64, "cameras.down.height_px": 48, "cameras.down.delay_s": 0.08},
    )
    world = World(scenario, 1)
    frames = []
    for _ in range(500):
        output = world.step(0.004)
        frames += [(world.t_us, frame) for frame in output.frames]
    assert len(frames) == pytest.approx(58, abs=2)
    for handed_out_us, frame in frames:
        assert 80_000 <= handed_out_us - frame.t_capture_us < 84_000
    sequences = [frame.sequence for _, frame in frames]
    assert sequences == list(range(len(frames)))
    periods = [b[1].t_capture_us - a[1].t_capture_us for a, b in itertools.pairwise(frames)]
    assert all(33_332 <= period <= 33_335 for period in periods)


@pytest.mark.parametrize(("kind", "mean_s", "most_s"), [("uniform", 0.02, 0.04), ("exponential", 0.04, math.inf)])
def test_a_delay_that_varies_does_so_as_asked_and_keeps_the_order(kind: str, mean_s: float, most_s: float) -> None:
    delay = {"cameras.down.delay_kind": kind, "cameras.down.delay_spread_s": 0.04, "cameras.down.rate_hz": 10.0}
    world = World(scenarios.with_overrides(scenarios.load("static"), delay), 1, render=False)
    captures = [capture for _ in range(100) for capture in world.step(0.4).captures]
    late_s = [(capture.due_us - capture.t_capture_us) * 1e-6 - 0.05 for capture in captures]
    assert sum(late_s) / len(late_s) == pytest.approx(mean_s, rel=0.2)
    assert min(late_s) >= -1e-9
    assert max(late_s) <= most_s
    dues = [capture.due_us for capture in captures]
    assert dues == sorted(dues)


def small_camera(*faults: dict[str, Any]) -> Scenario:
    scenario = near("static", faults=list(faults))
    camera = scenarios.Camera(
        width_px=188, height_px=120, fx_px=105.0, fy_px=105.0, cx_px=93.5, cy_px=59.5, noise_sigma=0.0
    )
    return msgspec.structs.replace(scenario, cameras={"down": camera})


def test_a_covered_marker_changes_the_picture_only_while_it_is_covered() -> None:
    fault = {"kind": "marker_covered", "start_s": 1.0, "duration_s": 1.0}
    plain, covered = World(small_camera(), 1), World(small_camera(fault), 1)
    differ = {}
    for _ in range(150):
        for a, b in zip(plain.step(0.02).frames, covered.step(0.02).frames, strict=True):
            differ[a.t_capture_us] = bool((a.image != b.image).any())
    assert not any(d for t, d in differ.items() if t < 1_000_000 or t > 2_040_000)
    assert all(d for t, d in differ.items() if 1_040_000 < t < 1_990_000)


def test_a_frozen_camera_repeats_and_a_black_one_is_dark_and_a_stopped_one_is_silent() -> None:
    faults = [
        {"kind": "camera_freeze", "start_s": 0.5, "duration_s": 0.5},
        {"kind": "camera_blackout", "start_s": 1.5, "duration_s": 0.5},
        {"kind": "camera_stop", "start_s": 2.5, "duration_s": 0.5},
    ]
    world = World(small_camera(*faults), 1)
    frames = [frame for _ in range(175) for frame in world.step(0.02).frames]
    frozen = [f.image for f in frames if 540_000 < f.t_capture_us < 980_000]
    assert all((image == frozen[0]).all() for image in frozen)
    black = [f.image.mean() for f in frames if 1_540_000 < f.t_capture_us < 1_980_000]
    assert max(black) < 30.0
    assert not [f for f in frames if 2_540_000 < f.t_capture_us < 2_980_000]
    assert [f for f in frames if f.t_capture_us > 3_100_000]


def test_a_fault_waits_for_its_height() -> None:
    fault = {"kind": "beacon_lost", "when_below_m": 2.0}
    world = World(near("static", faults=[fault]), 3)
    pilot = TruthPilot(world)
    outputs, below_us = [], 0
    while not world.verdict().is_over:
        outputs.append(pilot.turn())
        if not below_us and -world.truth().vehicle_in_pad_m[2] < 2.0:
            below_us = world.t_us
    last = messages(outputs, "GLOBAL_POSITION_INT", system=2)[-1]
    assert below_us - 400_000 < last.time_boot_ms * 1000 <= below_us + 40_000


def test_a_weak_motor_a_lost_gps_a_pilot_and_a_low_battery_reach_the_vehicle() -> None:
    faults = [
        {"kind": "motor_weak", "motor": 2, "efficiency": 0.7, "start_s": 0.5, "duration_s": 0.5},
        {"kind": "battery_low", "remaining": 0.33, "start_s": 0.5},
        {"kind": "pilot_input", "mode": "position", "start_s": 2.0},
    ]
    world = World(blind("static", faults=faults), 1)
    world.step(0.8)
    assert world.vehicle.motor_health == (1.0, 0.7, 1.0, 1.0)
    outputs = [world.step(0.4)]
    assert world.vehicle.motor_health == (1.0, 1.0, 1.0, 1.0)
    assert messages(outputs, "SYS_STATUS", system=1)[-1].battery_remaining == 33
    world.step(1.2)
    assert world.truth().mode == "POSCTL"


def test_a_stuck_range_sensor_repeats_and_a_lost_one_gives_nothing() -> None:
    faults = [
        {"kind": "range_stuck", "start_s": 1.0, "duration_s": 1.0},
        {"kind": "range_lost", "start_s": 2.0, "duration_s": 1.0},
    ]
    world = World(blind("static", faults=faults), 1)
    distances: dict[int, list[int]] = {0: [], 1: [], 2: []}
    for second in range(3):
        outputs = [world.step(1.0)]
        distances[second] = [m.current_distance for m in messages(outputs, "DISTANCE_SENSOR", system=1)]
    assert len(set(distances[0])) > 2
    assert len(set(distances[1][3:])) == 1
    assert min(distances[2][3:]) > 10_000


def test_a_cut_link_carries_nothing_either_way_while_it_lasts() -> None:
    fault = {"kind": "datagram_loss", "fraction": 1.0, "start_s": 1.0, "duration_s": 3.0}
    world = World(near("static", faults=[fault]), 1)
    pilot = TruthPilot(world)
    received = {}
    for _ in range(300):
        received[world.t_us] = len(pilot.turn().datagrams)
    assert all(count == 0 for t, count in received.items() if 1_040_000 <= t < 3_960_000)
    assert sum(count for t, count in received.items() if t >= 4_040_000) > 100
    assert world.truth().mode == "OFFBOARD" or pilot is not None


def test_junk_and_datagrams_for_others_do_no_harm() -> None:
    world = World(blind("static"), 1)
    for junk in (b"", b"\xfd", b"\xfd\xff\x00" + b"\x55" * 300, bytes(range(256)) * 3):
        world.step(0.02, [Datagram("onboard", junk), Datagram("ground", junk)])
    world.step(1.0)
    assert world.truth().mode == "AUTO_LOITER"
