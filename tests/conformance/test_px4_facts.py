"""Facts about the real PX4 that no other test holds, and the table that says which test holds each of the 38."""

from __future__ import annotations

import re
from itertools import pairwise
from math import hypot
from pathlib import Path
from typing import Any

import pytest
from px4_rig import LAND, LOITER, OFFBOARD, RTL, Rig
from pymavlink.dialects.v20 import development as mavlink

from sitl_stub.autopilot.estimate import EstimateErrors

ROOT = Path(__file__).resolve().parents[2]
FACTS = 38
ON_GROUND, IN_AIR = 1, 2
HEARTBEAT, CURRENT_MODE, GLOBAL_POSITION_INT, HOME_POSITION = 0, 436, 33, 242


def in_offboard(height_m: float = 5.0, **options: Any) -> Rig:
    rig = Rig(**options)
    rig.run(2.0)
    rig.fly_offboard(height_m)
    return rig


def received(rig: Rig, message_id: int, since_s: float = 0.0) -> list[tuple[float, Any]]:
    """Messages of one id on the onboard link, with their times."""
    parse = mavlink.MAVLink(None)
    found = []
    for t_us, link, data in rig.raw:
        is_it = link == "onboard" and data[5] == 1 and int.from_bytes(data[7:10], "little") == message_id
        if is_it and t_us >= since_s * 1e6:
            found += [(t_us * 1e-6, message) for message in parse.parse_buffer(data) or []]
    return found


def test_every_fact_names_a_test_that_exists() -> None:
    table = (ROOT / "docs" / "simulator-conformance.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\d+) \|.*\| ([^|]+) \|$", table, re.MULTILINE)
    assert [int(number) for number, _ in rows] == list(range(1, FACTS + 1))
    tests = {path.name: path.read_text(encoding="utf-8") for path in (ROOT / "tests").rglob("test_*.py")}
    for number, held_by in rows:
        names = re.findall(r"`(test_\w+\.py)::(test_\w+)`", held_by)
        assert names or held_by.strip().startswith("-"), f"fact {number}: {held_by}"
        for file, name in names:
            assert f"def {name}(" in tests[file], f"fact {number}: {file}::{name}"


def test_a_change_of_mode_is_told_at_once_by_current_mode_and_within_a_second_by_the_heartbeat() -> None:
    rig = in_offboard()
    rig.command(511, CURRENT_MODE, 50_000)
    rig.run(1.0)
    changed_s = rig.t_s
    rig.set_mode(LOITER)
    rig.run(3.0)
    beats = received(rig, HEARTBEAT, changed_s - 3.0)
    gaps = [later - earlier for (earlier, _), (later, _) in pairwise(beats)]
    assert gaps == pytest.approx([1.0] * len(gaps), abs=0.01)
    told = next(t for t, m in received(rig, CURRENT_MODE, changed_s) if m.custom_mode == LOITER)
    assert told - changed_s < 0.06
    assert next(t for t, m in beats if m.custom_mode == LOITER) - changed_s <= 1.01


def test_in_offboard_a_vehicle_is_on_the_ground_or_in_the_air_and_nothing_between() -> None:
    rig = Rig()
    rig.run(2.0)
    rig.stream_velocity(0.0, 0.0, -1.0)
    rig.run(0.2)
    rig.set_mode(OFFBOARD)
    rig.run(0.1)
    rig.arm()
    states = []
    for _ in range(8):
        rig.run(1.0)
        states.append(rig.autopilot.telemetry.landed_state)
    rig.stream_velocity(0.0, 0.0, 1.0)
    for _ in range(12):
        rig.run(1.0)
        states.append(rig.autopilot.telemetry.landed_state)
    assert set(states) == {ON_GROUND, IN_AIR}
    assert not rig.is_armed


def test_the_altitude_of_home_is_rewritten_in_flight_and_the_relative_one_jumps() -> None:
    rig = in_offboard(options={"home_error_scale": 1.0})
    start_s = rig.t_s
    rig.command(511, GLOBAL_POSITION_INT, 100_000)
    rig.run(40.0)
    heights = [message.relative_alt * 1e-3 for _, message in received(rig, GLOBAL_POSITION_INT, start_s)]
    jumps = [abs(b - a) for a, b in pairwise(heights)]
    assert 0.3 < max(jumps) <= 2.5
    altitudes = {message.altitude for _, message in received(rig, HOME_POSITION, start_s)}
    assert len(altitudes) > 10


def test_a_velocity_of_zero_is_a_drift() -> None:
    """Recorded in a minute: 2.1 m sideways, 3.8 m up."""
    rig = in_offboard(10.0, options={"errors": EstimateErrors()})
    start = rig.vehicle.state
    rig.run(60.0)
    end = rig.vehicle.state
    assert 0.5 < hypot(end.x - start.x, end.y - start.y) < 10.0
    assert abs(end.z - start.z) > 0.5


def test_in_the_cone_around_home_a_return_does_not_climb_to_the_return_height() -> None:
    rig = in_offboard(6.0)
    rig.stream_velocity(2.0, 0.0, 0.0)
    rig.run(3.0)
    height_m = rig.height_m
    rig.stop_streams()
    rig.set_mode(RTL)
    highest_m = 0.0
    for _ in range(30):
        rig.run(0.5)
        highest_m = max(highest_m, rig.height_m)
    assert highest_m < height_m + 1.5


def test_landing_from_offboard_ends_in_offboard_not_in_land() -> None:
    rig = in_offboard(3.0)
    rig.set_mode(LAND)
    rig.stop_streams()
    rig.run_until(lambda: not rig.is_armed, 40.0)
    rig.run(0.1)
    assert rig.mode == OFFBOARD
    assert (rig.autopilot.commander.base_mode, rig.autopilot.commander.system_status) == (17, 0)
