"""Jerk-limited motion of the automatic modes: limits kept, targets reached."""

from __future__ import annotations

from math import exp

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sitl_stub.autopilot.trajectory import (
    SmoothedAxis,
    SmoothedPoint,
    SmoothingLimits,
    VerticalLimits,
    braking_speed_m_s,
)

LIMITS = SmoothingLimits(cruise_m_s=5.0, acceleration_xy_m_s2=3.0, jerk_m_s3=4.0, error_max_m=2.0)
VERTICAL = VerticalLimits(1.5, 3.0)
speeds = st.floats(-5.0, 5.0)


@given(speeds, speeds)
def test_an_axis_reaches_its_speed_within_the_limits(start_m_s: float, target_m_s: float) -> None:
    axis = SmoothedAxis(velocity_m_s=start_m_s)
    before = 0.0
    for _ in range(1500):
        axis.advance(target_m_s, 3.0, 4.0, 0.008)
        assert abs(axis.acceleration_m_s2) <= 3.0 + 1e-9
        assert abs(axis.acceleration_m_s2 - before) <= 4.0 * 0.008 + 1e-9
        before = axis.acceleration_m_s2
    assert axis.velocity_m_s == pytest.approx(target_m_s, abs=0.03)


@settings(deadline=None, max_examples=30)
@given(st.floats(-30.0, 30.0), st.floats(-30.0, 30.0), st.floats(-30.0, 0.0))
def test_a_point_comes_to_its_target_and_stays(x: float, y: float, z: float) -> None:
    point = SmoothedPoint()
    for _ in range(4000):
        at = (point.x.position_m, point.y.position_m, point.z.position_m)
        point.advance((x, y), z, None, at, LIMITS, VERTICAL, 0.008)
    assert (point.x.position_m, point.y.position_m) == (pytest.approx(x, abs=0.1), pytest.approx(y, abs=0.1))
    assert point.z.position_m == pytest.approx(z, abs=0.1)


def test_a_point_waits_for_a_vehicle_that_is_left_behind() -> None:
    point = SmoothedPoint()
    for _ in range(2000):
        point.advance((50.0, 0.0), 0.0, None, (0.0, 0.0, 0.0), LIMITS, VERTICAL, 0.008)
    assert point.x.position_m <= LIMITS.error_max_m


@given(st.floats(0.0, 100.0))
def test_the_braking_speed_grows_with_the_distance(distance_m: float) -> None:
    assert 0.0 <= braking_speed_m_s(distance_m, 3.0, 4.0) <= braking_speed_m_s(distance_m + 1.0, 3.0, 4.0)


@given(speeds, speeds, st.floats(-2.0, 2.0))
def test_an_axis_needs_the_time_it_says(start_m_s: float, target_m_s: float, acceleration_m_s2: float) -> None:
    axis = SmoothedAxis(velocity_m_s=start_m_s, acceleration_m_s2=acceleration_m_s2)
    for _ in range(round(axis.duration_s(target_m_s, 3.0, 4.0) / 0.001)):
        axis.advance(target_m_s, 3.0, 4.0, 0.001)
    assert axis.velocity_m_s == pytest.approx(target_m_s, abs=0.02)


@given(speeds, speeds, st.floats(1.0, 3.0))
def test_a_gentle_axis_takes_the_time_it_is_given(start_m_s: float, target_m_s: float, factor: float) -> None:
    axis = SmoothedAxis(velocity_m_s=start_m_s)
    duration_s = factor * axis.duration_s(target_m_s, 3.0, 4.0)
    gentle = axis.gentle_acceleration_m_s2(target_m_s, duration_s, 4.0)
    assert axis.duration_s(target_m_s, max(gentle, 1e-6), 4.0) == pytest.approx(duration_s, rel=1e-3, abs=1e-6)


def test_all_axes_of_a_point_arrive_together() -> None:
    """PX4 stretches the quicker axes: a small sideways speed ends when the descent has its speed, not before."""
    point = SmoothedPoint()
    point.start((0.0, 0.0, 0.0), (0.1, 0.0, 0.0))
    speeds = []
    for _ in range(100):
        point.advance((0.06, 0.0), 0.0, 1.5, (point.x.position_m, 0.0, 0.0), LIMITS, VERTICAL, 0.008)
        speeds.append(point.x.velocity_m_s)
    assert max(speeds[:25]) > 0.07


def test_a_point_closes_in_on_its_target_from_one_side_as_logged() -> None:
    """By 0.69 of the distance a second near it (the log's fit; jerk / 2 acceleration is 0.67); its sign says who is behind."""
    point = SmoothedPoint()
    point.start((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    left = []
    for _ in range(1250):
        here = (point.x.position_m, point.y.position_m, point.z.position_m)
        point.advance((0.05, 0.0), 0.0, None, here, LIMITS, VERTICAL, 0.008)
        left.append(0.05 - point.x.position_m)
    assert min(left) >= 0.0
    assert left[500] / left[625] == pytest.approx(exp(2.0 / 3.0), rel=0.05)
