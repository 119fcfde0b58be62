"""Straight legs between waypoints, joined by circular arcs, at constant speed; once, or round and round."""

from __future__ import annotations

import itertools
import math
from typing import Annotated

import numpy as np
from msgspec import Meta

from sitl_stub.paths.curve import CurveTable, integrate_curvature
from sitl_stub.paths.reference import Path, PathReference
from sitl_stub.paths.speed import RampedSpeed
from sitl_stub.section import NonNegative, Positive, Section

_SPACING_M = 0.05
Corner = tuple[float, float, float]
"""Distance of the leg that leads to the corner, its turn in rad, the tangent length cut off on both sides."""


class WaypointsSettings(Section, frozen=True, tag_field="kind", tag="waypoints"):
    """[path] kind = "waypoints"."""

    speed_m_s: NonNegative
    points_m: Annotated[tuple[tuple[float, float], ...], Meta(min_length=2)]
    """North, east of each waypoint; the first one is the start."""
    corner_radius_m: Positive = 3.0
    start_delay_s: NonNegative = 0.0
    acceleration_m_s2: NonNegative = 0.0

    def build(self, rng: np.random.Generator) -> Path:
        speed = RampedSpeed(self.speed_m_s, self.start_delay_s, self.acceleration_m_s2)
        return Waypoints(speed, waypoint_curve(self.points_m, self.corner_radius_m))


class Waypoints:
    """Stops at the last waypoint and stands there."""

    def __init__(self, speed: RampedSpeed, table: CurveTable) -> None:
        self._speed = speed
        self._table = table

    def at(self, t_s: float) -> PathReference:
        distance, speed, acceleration = self._speed.at(t_s)
        if distance >= self._table.length_m:
            return self._table.at(self._table.length_m, 0.0)
        return self._table.at(distance, speed, acceleration)


def waypoint_curve(points_m: tuple[tuple[float, float], ...], corner_radius_m: float) -> CurveTable:
    """Legs and arcs as a table, turned so that it starts at the origin and heads along the first leg."""
    legs = [(b[0] - a[0], b[1] - a[1]) for a, b in itertools.pairwise(points_m)]
    lengths = [math.hypot(*leg) for leg in legs]
    headings = [math.atan2(leg[1], leg[0]) for leg in legs]
    curvature: list[float] = []
    cut_m = 0.0
    for i, length in enumerate(lengths):
        turn = _turn(headings, i)
        next_cut_m = _cut(corner_radius_m, turn, length, lengths, i)
        curvature += [0.0] * max(round((length - cut_m - next_cut_m) / _SPACING_M), 0)
        curvature += _arc(turn, next_cut_m)
        cut_m = next_cut_m
    table = integrate_curvature(curvature + [0.0, 0.0], _SPACING_M)
    return _turned(table, headings[0])


def _turn(headings: list[float], i: int) -> float:
    if i + 1 >= len(headings):
        return 0.0
    return math.remainder(headings[i + 1] - headings[i], math.tau)


def _cut(radius_m: float, turn_rad: float, length_m: float, lengths: list[float], i: int) -> float:
    """Tangent length of the arc; at most 45 % of each leg, so that neighbouring corners do not overlap."""
    if abs(turn_rad) < 1e-9:
        return 0.0
    return min(radius_m * abs(math.tan(0.5 * turn_rad)), 0.45 * length_m, 0.45 * lengths[i + 1])


def _arc(turn_rad: float, cut_m: float) -> list[float]:
    """Curvature along the arc; the number of points is rounded and the curvature adapted, so that the turn is exact."""
    if cut_m <= 0.0:
        return []
    radius = cut_m / abs(math.tan(0.5 * turn_rad))
    count = max(round(radius * abs(turn_rad) / _SPACING_M), 1)
    return [turn_rad / (count * _SPACING_M)] * count


def _turned(table: CurveTable, heading_rad: float) -> CurveTable:
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    north = [c * n - s * e for n, e in zip(table.north_m, table.east_m, strict=True)]
    east = [s * n + c * e for n, e in zip(table.north_m, table.east_m, strict=True)]
    heading = [h + heading_rad for h in table.heading_rad]
    return CurveTable(table.distance_m, north, east, heading, table.curvature_1_m)
