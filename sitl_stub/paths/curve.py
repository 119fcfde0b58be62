"""Constant speed along a smooth plane curve that is given by a parameter, by a table of its arc length.

The figure-8 and the random turns use it. Accuracy: the table is linear between its points, so its spacing must be small
against the radius of curvature (millimetres for the curves here).
"""

from __future__ import annotations

import itertools
import math
from bisect import bisect_right
from collections.abc import Sequence

from sitl_stub.paths.reference import PathReference


class CurveTable:
    """Points (north, east, heading, curvature) at increasing arc length; headings are continuous, not wrapped."""

    __slots__ = ("curvature_1_m", "distance_m", "east_m", "heading_rad", "north_m")

    def __init__(
        self,
        distance_m: Sequence[float],
        north_m: Sequence[float],
        east_m: Sequence[float],
        heading_rad: Sequence[float],
        curvature_1_m: Sequence[float],
    ) -> None:
        self.distance_m = list(distance_m)
        self.north_m = list(north_m)
        self.east_m = list(east_m)
        self.heading_rad = list(heading_rad)
        self.curvature_1_m = list(curvature_1_m)

    @property
    def length_m(self) -> float:
        return self.distance_m[-1]

    def at(self, distance_m: float, speed_m_s: float, acceleration_m_s2: float = 0.0) -> PathReference:
        """The reference at an arc length inside the table (clamped to its ends)."""
        i = min(max(bisect_right(self.distance_m, distance_m) - 1, 0), len(self.distance_m) - 2)
        d0, d1 = self.distance_m[i], self.distance_m[i + 1]
        f = min(max((distance_m - d0) / (d1 - d0), 0.0), 1.0)

        def between(column: list[float]) -> float:
            return column[i] + f * (column[i + 1] - column[i])

        return PathReference(
            between(self.north_m),
            between(self.east_m),
            between(self.heading_rad),
            speed_m_s,
            acceleration_m_s2,
            between(self.curvature_1_m),
        )


def integrate_curvature(curvature_1_m: Sequence[float], spacing_m: float) -> CurveTable:
    """The curve that starts at the origin heading north and has these curvatures at equal spacing."""
    north, east, heading = [0.0], [0.0], [0.0]
    for k0, k1 in itertools.pairwise(curvature_1_m):
        turn = 0.5 * (k0 + k1) * spacing_m
        middle = heading[-1] + 0.5 * turn
        north.append(north[-1] + spacing_m * math.cos(middle))
        east.append(east[-1] + spacing_m * math.sin(middle))
        heading.append(heading[-1] + turn)
    distance = [i * spacing_m for i in range(len(curvature_1_m))]
    return CurveTable(distance, north, east, heading, curvature_1_m)
