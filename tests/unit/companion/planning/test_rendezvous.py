"""Where to meet a moving pad: against a bang-bang simulation and by hand."""

from __future__ import annotations

import math

import pytest

from companion.planning import Limits
from companion.planning.rendezvous import constant_turn, rendezvous, trapezoid_time

LIMITS = Limits(max_speed_m_s=10.0, max_acceleration_m_s2=4.0, max_climb_m_s=2.5, max_descent_m_s=1.2)


def test_a_pad_at_rest_is_met_after_a_trapezoid() -> None:
    found = rendezvous((0.0, 0.0, -8.0), (0.0, 0.0, 0.0), constant_turn((50.0, 0.0, 0.0), (0.0, 0.0, 0.0)), LIMITS, 8.0)
    assert found is not None
    assert found.position_ned_m == (50.0, 0.0, -8.0)
    assert found.duration_s == pytest.approx(50.0 / 10.0 + 10.0 / 4.0, abs=0.002)


def test_a_pad_that_runs_away_is_met_farther_on() -> None:
    found = rendezvous((0.0, 0.0, -8.0), (0.0, 0.0, 0.0), constant_turn((40.0, 0.0, 0.0), (6.0, 0.0, 0.0)), LIMITS, 8.0)
    assert found is not None
    assert found.position_ned_m[0] == pytest.approx(40.0 + 6.0 * found.duration_s)
    travelled = found.position_ned_m[0]
    ramps = 10.0**2 / 8.0 + (10.0**2 - 6.0**2) / 8.0
    assert found.duration_s == pytest.approx(10.0 / 4.0 + 4.0 / 4.0 + (travelled - ramps) / 10.0, abs=0.002)


@pytest.mark.parametrize("speed", [10.5, 15.0])
def test_a_pad_faster_than_the_vehicle_is_not_met(speed: float) -> None:
    pad = constant_turn((30.0, 0.0, 0.0), (speed, 0.0, 0.0))
    assert rendezvous((0.0, 0.0, -8.0), (0.0, 0.0, 0.0), pad, LIMITS, 8.0) is None


def test_the_height_can_take_longest() -> None:
    pad = constant_turn((1.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    found = rendezvous((0.0, 0.0, -13.0), (0.0, 0.0, 0.0), pad, LIMITS, 1.0)
    assert found is not None
    assert found.duration_s == pytest.approx(12.0 / 1.2, abs=0.002)


def test_a_turning_pad_comes_back_to_where_it_was() -> None:
    pad = constant_turn((3.0, 4.0, -0.5), (5.0, 0.0, 0.0), yaw_rate_rad_s=0.5)
    position, velocity = pad(2.0 * math.pi / 0.5)
    assert position == pytest.approx((3.0, 4.0, -0.5), abs=1e-9)
    assert velocity == pytest.approx((5.0, 0.0, 0.0), abs=1e-9)
    quarter, heading = pad(0.5 * math.pi / 0.5)
    assert quarter == pytest.approx((3.0 + 10.0, 4.0 + 10.0, -0.5))
    assert heading == pytest.approx((0.0, 5.0, 0.0), abs=1e-9)


def test_a_turn_is_continuous_with_going_straight() -> None:
    straight = constant_turn((0.0, 0.0, 0.0), (5.0, 1.0, 0.0))(3.0)
    turning = constant_turn((0.0, 0.0, 0.0), (5.0, 1.0, 0.0), 2e-6)(3.0)
    assert turning[0] == pytest.approx(straight[0], abs=1e-3)


@pytest.mark.parametrize(
    ("distance", "start", "end", "expected"),
    [
        (10.0, 0.0, 0.0, 2.0 * math.sqrt(10.0 / 4.0)),
        (100.0, 0.0, 0.0, 100.0 / 10.0 + 10.0 / 4.0),
        (8.0, 0.0, 8.0, 2.0),
        (0.0, 3.0, -3.0, 1.5),
        (0.0, 4.0, 0.0, 1.0 + 2.0 * math.sqrt(2.0 / 4.0)),
        (5.0, -4.0, 0.0, (2.0 * math.sqrt(4.0 * 5.0 + 8.0) + 4.0) / 4.0),
        (-10.0, 0.0, 0.0, 2.0 * math.sqrt(10.0 / 4.0)),
    ],
)
def test_least_times_along_a_line(distance: float, start: float, end: float, expected: float) -> None:
    assert trapezoid_time(distance, start, end, 10.0, 4.0) == pytest.approx(expected)
