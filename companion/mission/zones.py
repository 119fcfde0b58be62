"""Where the vehicle must not land, and where it must not fly: circles and polygons of the configuration in local NED.

Zones in degrees are laid out around the autopilot's home, which gives both its latitude and longitude and its local place
(flat earth: a zone is near). Horizontal, metres. Called by pipeline.py each tick and by search_area.py.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from companion.config import Zone
from companion.messages import Vec2, VehicleStatus

METRES_PER_DEGREE = 6_371_000.0 * math.pi / 180.0


@dataclass(frozen=True, slots=True)
class LocalZone:
    """A polygon (three or more corners) or a circle (one point and a radius); north, east in m."""

    name: str
    points_m: tuple[Vec2, ...]
    radius_m: float | None

    def contains(self, point_m: Vec2) -> bool:
        if self.radius_m is not None:
            centre = self.points_m[0]
            return math.hypot(point_m[0] - centre[0], point_m[1] - centre[1]) <= self.radius_m
        return _in_polygon(point_m, self.points_m)


@dataclass(frozen=True, slots=True)
class Zones:
    """All zones of a flight; `unplaced` names those in degrees while the home is not known."""

    no_land: tuple[LocalZone, ...] = ()
    no_fly: tuple[LocalZone, ...] = ()
    unplaced: tuple[str, ...] = ()


def place_zones(zones: Sequence[Zone], status: VehicleStatus | None) -> Zones:
    """The configured zones in local NED, as far as the home is known."""
    placed = [(zone, _placed(zone, status)) for zone in zones]
    return Zones(
        no_land=tuple(local for zone, local in placed if local is not None and zone.kind == "no_land"),
        no_fly=tuple(local for zone, local in placed if local is not None and zone.kind == "no_fly"),
        unplaced=tuple(zone.name for zone, local in placed if local is None),
    )


def inside(zones: Sequence[LocalZone], point_m: Vec2) -> str | None:
    """The name of the first zone that holds the point."""
    return next((zone.name for zone in zones if zone.contains(point_m)), None)


def _placed(zone: Zone, status: VehicleStatus | None) -> LocalZone | None:
    in_metres = zone.polygon_m or (() if zone.center_m is None else (zone.center_m,))
    if in_metres:
        return LocalZone(zone.name, in_metres, zone.radius_m)
    in_degrees = zone.polygon_deg or (() if zone.center_deg is None else (zone.center_deg,))
    if status is None or status.home_position_deg is None or status.home_position_ned_m is None:
        return None
    home_deg, home_m = status.home_position_deg, status.home_position_ned_m
    east_scale = METRES_PER_DEGREE * math.cos(math.radians(home_deg[0]))
    points = tuple(
        (
            home_m[0] + (latitude - home_deg[0]) * METRES_PER_DEGREE,
            home_m[1] + (longitude - home_deg[1]) * east_scale,
        )
        for latitude, longitude in in_degrees
    )
    return LocalZone(zone.name, points, zone.radius_m)


def _in_polygon(point_m: Vec2, corners: Sequence[Vec2]) -> bool:
    """Even-odd rule: a ray to the east crosses the border an odd number of times."""
    north, east = point_m
    odd = False
    for (n1, e1), (n2, e2) in zip(corners, (*corners[1:], corners[0]), strict=True):
        if (n1 > north) != (n2 > north) and east < e1 + (north - n1) / (n2 - n1) * (e2 - e1):
            odd = not odd
    return odd
