"""A path from a file: CSV with the columns t_s, north_m, east_m and, if there is one, heading_rad.

Between rows the motion is a cubic Hermite curve through the points with central-difference velocities, so that speed is
continuous. Before the first row and after the last the carrier stands. Headings default to the direction of travel.
"""

from __future__ import annotations

import csv
import itertools
import math
from bisect import bisect_right
from pathlib import Path as FilePath

import numpy as np

from sitl_stub.paths.reference import Path, PathReference
from sitl_stub.section import Section

_REQUIRED = ("t_s", "north_m", "east_m")


class RecordedSettings(Section, frozen=True, tag_field="kind", tag="recorded"):
    """[path] kind = "recorded"."""

    file: str
    """CSV, relative to the scenario file."""

    def build(self, rng: np.random.Generator) -> Path:
        return Recorded(*read_track(FilePath(self.file)))


class Recorded:
    """Rows of time (s, increasing), north and east (m)."""

    def __init__(self, t_s: list[float], north_m: list[float], east_m: list[float]) -> None:
        self._t_s = [t - t_s[0] for t in t_s]
        self._north_m, self._east_m = north_m, east_m
        self._north_m_s = _rates(self._t_s, north_m)
        self._east_m_s = _rates(self._t_s, east_m)

    def at(self, t_s: float) -> PathReference:
        t = min(max(t_s, 0.0), self._t_s[-1])
        i = min(max(bisect_right(self._t_s, t) - 1, 0), len(self._t_s) - 2)
        h = self._t_s[i + 1] - self._t_s[i]
        u = (t - self._t_s[i]) / h
        n, vn, an = _hermite(self._north_m, self._north_m_s, i, u, h)
        e, ve, ae = _hermite(self._east_m, self._east_m_s, i, u, h)
        speed = math.hypot(vn, ve)
        heading = math.atan2(ve, vn) if speed > 1e-3 else self._standing_heading(i)
        if t_s > self._t_s[-1]:
            return PathReference(n, e, heading, 0.0, 0.0, 0.0)
        along = (vn * an + ve * ae) / speed if speed > 1e-3 else 0.0
        curvature = (vn * ae - ve * an) / speed**3 if speed > 0.1 else 0.0
        return PathReference(n, e, heading, speed, along, curvature)

    def _standing_heading(self, i: int) -> float:
        """Where it stands, it looks where it will go next (or came from at the end)."""
        later = range(i, len(self._t_s))
        earlier = range(i, -1, -1)
        for k in [*later, *earlier]:
            if math.hypot(self._north_m_s[k], self._east_m_s[k]) > 1e-3:
                return math.atan2(self._east_m_s[k], self._north_m_s[k])
        return 0.0


def read_track(file: FilePath) -> tuple[list[float], list[float], list[float]]:
    """Columns of the file; ValueError says what is wrong with it."""
    with file.open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(line for line in stream if not line.startswith("#")))
    missing = [name for name in _REQUIRED if not rows or name not in rows[0]]
    if missing:
        raise ValueError(f"{file}: no column {', '.join(missing)}; needed: {', '.join(_REQUIRED)}")
    t, north, east = ([float(row[name]) for row in rows] for name in _REQUIRED)
    if len(t) < 2 or any(b <= a for a, b in itertools.pairwise(t)):
        raise ValueError(f"{file}: t_s must increase over at least two rows")
    return t, north, east


def _rates(t: list[float], x: list[float]) -> list[float]:
    last = len(t) - 1
    return [(x[min(i + 1, last)] - x[max(i - 1, 0)]) / (t[min(i + 1, last)] - t[max(i - 1, 0)]) for i in range(len(t))]


def _hermite(x: list[float], v: list[float], i: int, u: float, h: float) -> tuple[float, float, float]:
    """Value, rate and second rate at fraction `u` of interval `i` of length `h`."""
    x0, x1, m0, m1 = x[i], x[i + 1], v[i] * h, v[i + 1] * h
    c2, c3 = 3.0 * (x1 - x0) - 2.0 * m0 - m1, 2.0 * (x0 - x1) + m0 + m1
    value = x0 + u * (m0 + u * (c2 + u * c3))
    return value, (m0 + u * (2.0 * c2 + 3.0 * u * c3)) / h, (2.0 * c2 + 6.0 * u * c3) / (h * h)
