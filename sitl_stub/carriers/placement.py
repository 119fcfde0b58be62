"""Puts a path where the scenario wants it: turned about its start and moved."""

from __future__ import annotations

import math

from sitl_stub.paths import Path, PathReference

_new = tuple.__new__
"""A record without its constructor's checks: in a third of the time."""


class PlacedPath:
    """The path in W: at time 0 it is at `start_ned_m` and heads along `heading_rad`."""

    __slots__ = ("_cos", "_east_m", "_north_m", "_path", "_sin", "_turn_rad")

    def __init__(self, path: Path, north_m: float, east_m: float, heading_rad: float) -> None:
        start = path.at(0.0)
        self._path = path
        self._turn_rad = heading_rad - start.heading_rad
        self._cos, self._sin = math.cos(self._turn_rad), math.sin(self._turn_rad)
        self._north_m = north_m - self._cos * start.north_m + self._sin * start.east_m
        self._east_m = east_m - self._sin * start.north_m - self._cos * start.east_m

    def at(self, t_s: float) -> PathReference:
        n, e, heading, speed, acceleration, curvature = self._path.at(t_s)
        north_m = self._north_m + self._cos * n - self._sin * e
        east_m = self._east_m + self._sin * n + self._cos * e
        return _new(PathReference, (north_m, east_m, heading + self._turn_rad, speed, acceleration, curvature))
