"""A figure-8: the lemniscate of Gerono, north = L/2 sin u, east = W/2 sin 2u; at constant speed or harmonic in time.

Its sharpest turns are on the shoulders of the loops: radius 2.4 m for 20 x 8 m, 6.3 m for 50 x 16 m; the acceleration there
is speed^2 over it. Harmonic: u grows evenly with time, so that the speed given is the highest one, at the crossing.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from sitl_stub.paths.curve import CurveTable
from sitl_stub.paths.reference import Path, PathReference
from sitl_stub.paths.speed import RampedSpeed
from sitl_stub.section import Fraction, NonNegative, Positive, Section

_POINTS = 2000


class Figure8Settings(Section, frozen=True, tag_field="kind", tag="figure8"):
    """[path] kind = "figure8"."""

    speed_m_s: NonNegative
    length_m: Positive = 50.0
    width_m: Positive = 16.0
    timing: Literal["even", "harmonic"] = "even"
    start_fraction: Fraction | None = None
    """Where on the loop it starts, 0 to 1; absent: seeded."""
    start_delay_s: NonNegative = 0.0
    acceleration_m_s2: NonNegative = 0.0

    def build(self, rng: np.random.Generator) -> Path:
        seeded = float(rng.random())
        fraction = seeded if self.start_fraction is None else self.start_fraction
        if self.timing == "harmonic":
            return HarmonicFigure8(self.speed_m_s, self.length_m, self.width_m, fraction)
        speed = RampedSpeed(self.speed_m_s, self.start_delay_s, self.acceleration_m_s2)
        return Figure8(speed, self.length_m, self.width_m, fraction)


class Figure8:
    """Runs round the loop for ever from `start_fraction` of its length."""

    def __init__(self, speed: RampedSpeed, length_m: float, width_m: float, start_fraction: float) -> None:
        self._speed = speed
        self._table = lemniscate(length_m, width_m)
        self._start_m = start_fraction * self._table.length_m

    def at(self, t_s: float) -> PathReference:
        distance, speed, acceleration = self._speed.at(t_s)
        return self._table.at((self._start_m + distance) % self._table.length_m, speed, acceleration)


class HarmonicFigure8:
    """As `Figure8`, but slower in the turns; `start_fraction` of the period."""

    def __init__(self, peak_speed_m_s: float, length_m: float, width_m: float, start_fraction: float) -> None:
        self._a_m, self._b_m = 0.5 * length_m, 0.5 * width_m
        self._rate_rad_s = peak_speed_m_s / math.hypot(self._a_m, 2.0 * self._b_m)
        self._start_rad = math.tau * start_fraction

    def at(self, t_s: float) -> PathReference:
        a, b, w = self._a_m, self._b_m, self._rate_rad_s
        u = self._start_rad + w * t_s
        vn, ve = w * a * math.cos(u), w * 2.0 * b * math.cos(2.0 * u)
        an, ae = -w * w * a * math.sin(u), -w * w * 4.0 * b * math.sin(2.0 * u)
        speed = math.hypot(vn, ve)
        along = (vn * an + ve * ae) / speed if speed > 0.0 else 0.0
        curvature = (vn * ae - ve * an) / speed**3 if speed > 0.0 else 0.0
        heading = math.atan2(ve, vn)
        return PathReference(a * math.sin(u), b * math.sin(2.0 * u), heading, speed, along, curvature)


def lemniscate(length_m: float, width_m: float) -> CurveTable:
    """One loop, closed: the last point is the first; the heading after a loop is the heading before it."""
    a, b = 0.5 * length_m, 0.5 * width_m
    u = np.linspace(0.0, 2.0 * math.pi, _POINTS + 1)
    north, east = a * np.sin(u), b * np.sin(2.0 * u)
    dn, de = a * np.cos(u), 2.0 * b * np.cos(2.0 * u)
    ddn, dde = -a * np.sin(u), -4.0 * b * np.sin(2.0 * u)
    heading = np.unwrap(np.arctan2(de, dn))
    curvature = (dn * dde - de * ddn) / (dn**2 + de**2) ** 1.5
    steps = np.hypot(np.diff(north), np.diff(east))
    distance = np.concatenate(([0.0], np.cumsum(steps)))
    return CurveTable(distance.tolist(), north.tolist(), east.tolist(), heading.tolist(), curvature.tolist())
