"""Simulated against real time, without waiting for any."""

from __future__ import annotations

import pytest

from sitl_stub.pacing import Pace


@pytest.mark.parametrize("speed", [0.5, 1.0, 8.0])
def test_the_target_follows_the_clock_at_its_speed(speed: float) -> None:
    pace = Pace(speed, 100.0)
    assert pace.target_us(100.1, 0) == pytest.approx(100_000 * speed, abs=1)
    assert pace.wait_s(100.1, round(200_000 * speed)) == pytest.approx(0.1, abs=1e-5)
    assert pace.given_up_s == 0.0


def test_a_short_delay_is_caught_up_and_a_long_one_given_up() -> None:
    pace = Pace(1.0, 0.0)
    assert pace.target_us(1.2, 1_000_000) == 1_200_000
    assert pace.given_up_s == 0.0
    assert pace.target_us(3.0, 1_200_000) == 1_200_000
    assert pace.given_up_s == pytest.approx(1.8)
    assert pace.target_us(3.1, 1_200_000) == pytest.approx(1_300_000, abs=1)
