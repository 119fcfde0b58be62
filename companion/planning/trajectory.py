"""A trajectory relative to the pad: piecewise polynomials over time, evaluated in plain floats.

Every planner hands back this one type, so that whoever follows it needs to know one thing only. Positions are vehicle
minus pad in non-rotating NED axes (m, z down), times are seconds since `start_ns`. The pipeline samples it each tick.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

from companion.geometry import ZERO
from companion.messages import Vec3

Coefficients = tuple[float, ...]
"""One axis of one piece over the time since the piece began, highest power first."""

Piece = tuple[Coefficients, Coefficients, Coefficients]
"""North, east, down."""


@dataclass(frozen=True, slots=True)
class Trajectory:
    """Pieces joined in time. `breaks_s` has one more entry than `pieces`, starts at 0 and rises strictly.

    Outside its interval it is a hold, so that a late caller gets something harmless: before the start, the start state;
    after the end, the end position at rest (velocity and acceleration zero, whatever the end velocity was).
    """

    start_ns: int
    breaks_s: tuple[float, ...]
    pieces: tuple[Piece, ...]

    @property
    def duration_s(self) -> float:
        return self.breaks_s[-1]

    @property
    def end_ns(self) -> int:
        return self.start_ns + round(self.breaks_s[-1] * 1e9)

    def sample(self, t_s: float) -> tuple[Vec3, Vec3, Vec3]:
        """Position (m), velocity (m/s), acceleration (m/s2) relative to the pad, `t_s` after the start."""
        breaks = self.breaks_s
        if t_s > breaks[-1]:
            return self._evaluate(len(self.pieces) - 1, breaks[-1])[0], ZERO, ZERO
        if t_s <= 0.0:
            return self._evaluate(0, 0.0)
        return self._evaluate(min(bisect_right(breaks, t_s) - 1, len(self.pieces) - 1), t_s)

    def sample_at(self, t_ns: int) -> tuple[Vec3, Vec3, Vec3]:
        """The same at an instant of the companion's clock."""
        return self.sample((t_ns - self.start_ns) * 1e-9)

    def jerk(self, t_s: float) -> Vec3:
        """Third derivative (m/s3), right-continuous; zero outside the interval."""
        if not 0.0 <= t_s <= self.breaks_s[-1]:
            return ZERO
        index = min(bisect_right(self.breaks_s, t_s) - 1, len(self.pieces) - 1)
        s = t_s - self.breaks_s[index]
        x, y, z = (horner(derivative(axis, 3), s) for axis in self.pieces[index])
        return (x, y, z)

    def _evaluate(self, index: int, t_s: float) -> tuple[Vec3, Vec3, Vec3]:
        s = t_s - self.breaks_s[index]
        north, east, down = self.pieces[index]
        x, vx, ax = _horner3(north, s)
        y, vy, ay = _horner3(east, s)
        z, vz, az = _horner3(down, s)
        return (x, y, z), (vx, vy, vz), (ax, ay, az)


def _horner3(coefficients: Coefficients, s: float) -> tuple[float, float, float]:
    """Value and two derivatives in one pass (repeated synthetic division)."""
    p = v = half_a = 0.0
    for c in coefficients:
        half_a = half_a * s + v
        v = v * s + p
        p = p * s + c
    return p, v, 2.0 * half_a


def horner(coefficients: Sequence[float], s: float) -> float:
    """Value of a polynomial, highest power first."""
    p = 0.0
    for c in coefficients:
        p = p * s + c
    return p


def derivative(coefficients: Coefficients, order: int = 1) -> Coefficients:
    """Coefficients of the derivative, highest power first; (0.0,) where nothing is left."""
    for _ in range(order):
        degree = len(coefficients) - 1
        coefficients = tuple(c * (degree - i) for i, c in enumerate(coefficients[:-1])) or (0.0,)
    return coefficients


def quintic(s_s: float, start: tuple[float, float, float], end: tuple[float, float, float]) -> Coefficients:
    """The quintic with position, velocity and acceleration given at 0 and at `s_s` seconds (one axis)."""
    p0, v0, a0 = start
    dp = end[0] - p0 - v0 * s_s - 0.5 * a0 * s_s * s_s
    dv = (end[1] - v0 - a0 * s_s) * s_s
    da = (end[2] - a0) * s_s * s_s
    return (
        (6.0 * dp - 3.0 * dv + 0.5 * da) / s_s**5,
        (-15.0 * dp + 7.0 * dv - da) / s_s**4,
        (10.0 * dp - 4.0 * dv + 0.5 * da) / s_s**3,
        0.5 * a0,
        v0,
        p0,
    )
