"""The gyro's Butterworth filter."""

from math import pi, sin, sqrt

import pytest

from sitl_stub.autopilot.low_pass import butterworth, filter_sample, settled


def _gain(cutoff_hz: float, tone_hz: float) -> float:
    c, d1, d2, out = butterworth(cutoff_hz, 250.0), 0.0, 0.0, []
    for i in range(2500):
        y, d1, d2 = filter_sample(c, sin(2 * pi * tone_hz * i / 250.0), d1, d2)
        out.append(y)
    return max(out[1500:])


def test_half_the_power_passes_at_the_cutoff() -> None:
    assert _gain(40.0, 40.0) == pytest.approx(sqrt(0.5), abs=0.01)


def test_slow_motion_passes_and_fast_noise_does_not() -> None:
    assert _gain(40.0, 2.0) == pytest.approx(1.0, abs=0.01)
    assert _gain(40.0, 110.0) < 0.1


def test_a_filter_at_or_above_half_the_rate_is_off() -> None:
    for cutoff_hz in (0.0, 125.0, 300.0):
        assert filter_sample(butterworth(cutoff_hz, 250.0), 3.0, 1.0, 2.0)[0] == 3.0


def test_a_settled_filter_gives_its_input() -> None:
    c = butterworth(40.0, 250.0)
    state = settled(c, 0.7)
    assert filter_sample(c, 0.7, state, state) == pytest.approx((0.7, state, state))
