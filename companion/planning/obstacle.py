"""No-fly volumes and the one question asked of them: is a hull of control points clear of it?

A volume stands still in W; relative to the moving pad it drifts with minus the pad's velocity. A B-spline minus a straight
motion is again a B-spline (its control points minus the motion at the Greville times), so "the hull of these points is
clear of a fixed volume at the origin" proves clearance for the time the points govern. Used by limits and planners.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, combinations

from companion.messages import Vec3


@dataclass(frozen=True, slots=True)
class Cylinder:
    """Vertical cylinder from the ground to `top_m` above the pad (None: to the sky). Centre relative to the pad."""

    centre_m: tuple[float, float]
    radius_m: float
    top_m: float | None = None


@dataclass(frozen=True, slots=True)
class Sphere:
    """Ball around a point relative to the pad."""

    centre_m: Vec3
    radius_m: float


Obstacle = Cylinder | Sphere


def centre_at(obstacle: Obstacle, pad_velocity_m_s: Vec3, t_s: float) -> Vec3:
    """Where the volume's centre is relative to the pad, `t_s` after the plan's start (z 0 for a cylinder)."""
    x, y, *rest = obstacle.centre_m
    z = rest[0] - pad_velocity_m_s[2] * t_s if rest else 0.0
    return (x - pad_velocity_m_s[0] * t_s, y - pad_velocity_m_s[1] * t_s, z)


def moved(obstacle: Obstacle, pad_velocity_m_s: Vec3, t_s: float) -> Obstacle:
    """The same volume as a plan sees it that starts `t_s` later."""
    x, y, z = centre_at(obstacle, pad_velocity_m_s, t_s)
    if isinstance(obstacle, Sphere):
        return Sphere((x, y, z), obstacle.radius_m)
    return Cylinder((x, y), obstacle.radius_m, obstacle.top_m)


def hull_is_clear(obstacle: Obstacle, offsets_m: Sequence[Vec3], points_z_m: Sequence[float]) -> bool:
    """True where the convex hull of points surely misses the volume.

    `offsets_m` are the points minus the volume's centre, `points_z_m` their z relative to the pad. A False may be a
    near miss: the test looks for a separating plane among a few directions.
    """
    if isinstance(obstacle, Cylinder):
        if obstacle.top_m is not None and all(-z >= obstacle.top_m for z in points_z_m):
            return True
        offsets_m = [(x, y, 0.0) for x, y, _ in offsets_m]
    radius = obstacle.radius_m
    return any(all(_dot(n, d) >= radius for d in offsets_m) for n in _directions(offsets_m))


def _directions(offsets: Sequence[Vec3]) -> Iterator[Vec3]:
    """Candidate normals: towards the middle and each point, then across each pair (horizontal). In the plane one of them
    separates wherever a line does, since the nearest place of a hull is a corner or on an edge."""
    towards = [(sum(d[0] for d in offsets), sum(d[1] for d in offsets), sum(d[2] for d in offsets)), *offsets]
    across = ((b[1] - a[1], a[0] - b[0], 0.0) for a, b in combinations(offsets, 2))
    both_ways = (n for x, y, z in across for n in ((x, y, z), (-x, -y, -z)))
    for d in chain(towards, both_ways):
        size = math.sqrt(_dot(d, d))
        if size > 1e-9:
            yield (d[0] / size, d[1] / size, d[2] / size)


def _dot(a: Vec3, b: Vec3) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
