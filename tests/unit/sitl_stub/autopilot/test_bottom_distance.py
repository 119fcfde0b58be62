"""The distance to the bottom comes as late as the fusion horizon."""

from __future__ import annotations

import pytest

from sitl_stub.autopilot.bottom_distance import FUSION_HORIZON_US, BottomDistance


@pytest.mark.parametrize("period_us", [4_000, 20_000, 50_000])
def test_in_a_descent_it_is_the_distance_of_the_fusion_horizon_whatever_the_sensors_rate(period_us: int) -> None:
    bottom = BottomDistance()
    for t_us in range(0, 2_000_000, period_us):
        distance_m = bottom.take(t_us, 10.0 - t_us * 1e-6)
    middle_us = t_us + period_us // 2
    assert distance_m == pytest.approx(10.0 - (middle_us - FUSION_HORIZON_US) * 1e-6)


def test_the_first_reading_holds_until_the_horizon_comes_to_a_newer_one() -> None:
    bottom = BottomDistance()
    assert bottom.take(0, 3.0) == 3.0
    assert bottom.take(20_000, 2.9) == 3.0


def test_a_lost_reading_is_noticed_late_and_so_is_a_new_one() -> None:
    bottom = BottomDistance()
    readings = [5.0] * 20 + [None] * 20 + [4.0] * 20
    distances = [bottom.take(i * 20_000, reading) for i, reading in enumerate(readings)]
    assert [distance is None for distance in distances].index(True) in (27, 28)
    assert distances[-1] == 4.0
    assert distances.count(None) == 20


def test_a_slow_sensor_is_not_asked_for_the_future() -> None:
    bottom = BottomDistance()
    assert [bottom.take(t_s * 1_000_000, 8.0 - t_s) for t_s in range(3)] == [8.0, 7.0, 6.0]
