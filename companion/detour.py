"""No-fly zones as the planner sees them: cylinders around the moving pad, so that a plan leads past them instead of up to them.

Part of the pipeline, like situation.py: the zones are the mission's, the cylinders the planner's. A zone stands still in W (local NED,
SI) and is given relative to the pad. A polygon is taken as the circle round it. A margin keeps the vehicle where it could
still stop before the zone; it shrinks where the vehicle or its goal is already nearer than that, because a plan cannot keep clear
of where it begins. Leaving the zones alone is still the fence's duty (`mission.guards.outside_fence`), whatever was planned.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from companion.messages import Vec2, Vec3
from companion.mission.zones import LocalZone
from companion.planning.obstacle import Cylinder

MARGIN_M = 2.5
"""The vehicle stops within v^2 / 8 m (situation.py): 2 m at the 4 m/s that plans may close in with."""

NEAR_M = 150.0
"""From the vehicle to the zone's edge: what is further off no plan of now can meet."""

NOT_IN_THE_WAY = 0.9
"""Of the distance from the vehicle or the goal to the zone's centre: the largest radius that neither is inside of."""


def cylinders(
    zones: Sequence[LocalZone], *, vehicle_ned_m: Vec3, pad_ned_m: Vec3, goal_m: Vec3
) -> tuple[Cylinder, ...]:
    """The zones near the vehicle. `goal_m` is relative to the pad."""
    return tuple(_near(zones, vehicle_ned_m, pad_ned_m, goal_m))


def _near(zones: Sequence[LocalZone], vehicle: Vec3, pad: Vec3, goal: Vec3) -> Iterator[Cylinder]:
    end = (pad[0] + goal[0], pad[1] + goal[1])
    for zone in zones:
        centre, radius = _circle(zone)
        distance = math.dist(centre, vehicle[:2])
        if distance - radius > NEAR_M:
            continue
        free = NOT_IN_THE_WAY * min(distance, math.dist(centre, end))
        yield Cylinder((centre[0] - pad[0], centre[1] - pad[1]), min(radius + MARGIN_M, free))


def _circle(zone: LocalZone) -> tuple[Vec2, float]:
    """The zone's circle, or one round its corners."""
    if zone.radius_m is not None:
        return zone.points_m[0], zone.radius_m
    norths, easts = zip(*zone.points_m, strict=True)
    centre = (0.5 * (min(norths) + max(norths)), 0.5 * (min(easts) + max(easts)))
    return centre, max(math.dist(centre, corner) for corner in zone.points_m)
