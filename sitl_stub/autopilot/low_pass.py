"""Second-order Butterworth low pass (bilinear), as PX4 puts over its gyro. Pure functions on floats.

State is (d1, d2) of the direct form II; called by estimate.py for each axis at 250 Hz.
"""

from __future__ import annotations

from math import pi, sqrt, tan
from typing import NamedTuple


class Butterworth(NamedTuple):
    """Coefficients; identity (b0 = 1) when the filter is off."""

    b0: float
    b1: float
    b2: float
    a1: float
    a2: float


def butterworth(cutoff_hz: float, sample_hz: float) -> Butterworth:
    """Filter with the given cut-off; one at or above half the sample rate, or <= 0, lets all through."""
    if cutoff_hz <= 0.0 or cutoff_hz >= 0.5 * sample_hz:
        return Butterworth(1.0, 0.0, 0.0, 0.0, 0.0)
    w = tan(pi * cutoff_hz / sample_hz)
    norm = 1.0 + sqrt(2.0) * w + w * w
    b0 = w * w / norm
    return Butterworth(b0, 2.0 * b0, b0, 2.0 * (w * w - 1.0) / norm, (1.0 - sqrt(2.0) * w + w * w) / norm)


def filter_sample(c: Butterworth, x: float, d1: float, d2: float) -> tuple[float, float, float]:
    """Output, and the state for the next sample."""
    d0 = x - c.a1 * d1 - c.a2 * d2
    return c.b0 * d0 + c.b1 * d1 + c.b2 * d2, d0, d1


def settled(c: Butterworth, x: float) -> float:
    """d1 = d2 of a filter that has seen x for ever."""
    return x / (1.0 + c.a1 + c.a2)
