"""Search patterns: where to look when nothing is known of the pad. Corners of a path in m north and east of its centre.

Every path starts at the centre and stays within the radius; search_area.py walks along it.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from companion.messages import Vec2

Pattern = Callable[[float, float], tuple[Vec2, ...]]
"""(track spacing m, radius m) -> corners, the first of them the centre."""

SPIRAL_STEP_RAD = math.radians(15.0)
_TURNING_RIGHT = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))


def expanding_square(spacing_m: float, radius_m: float) -> tuple[Vec2, ...]:
    """Legs of 1, 1, 2, 2, 3, 3 ... spacings, turning right, until the next corner would lie outside the square."""
    corners = [(0.0, 0.0)]
    for leg in range(10_000):
        length = (leg // 2 + 1) * spacing_m
        north, east = _TURNING_RIGHT[leg % 4]
        corner = (corners[-1][0] + north * length, corners[-1][1] + east * length)
        if math.hypot(*corner) > radius_m:
            break
        corners.append(corner)
    return _at_least_one_leg(corners, radius_m)


def spiral(spacing_m: float, radius_m: float) -> tuple[Vec2, ...]:
    """Archimedean spiral with the given distance between its turns."""
    growth = spacing_m / (2.0 * math.pi)
    steps = math.floor(radius_m / (growth * SPIRAL_STEP_RAD))
    angles = [step * SPIRAL_STEP_RAD for step in range(steps + 1)]
    corners = [(growth * angle * math.cos(angle), growth * angle * math.sin(angle)) for angle in angles]
    return _at_least_one_leg(corners, radius_m)


def lawnmower(spacing_m: float, radius_m: float) -> tuple[Vec2, ...]:
    """Lanes to the north and south across the square within the radius, from west to east; from the centre to the first."""
    half = radius_m / math.sqrt(2.0)
    lanes = max(2, math.ceil(2.0 * half / spacing_m) + 1)
    corners = [(0.0, 0.0)]
    for lane in range(lanes):
        east = -half + 2.0 * half * lane / (lanes - 1)
        ends = [(-half, east), (half, east)]
        corners += ends if lane % 2 == 0 else ends[::-1]
    return tuple(corners)


def _at_least_one_leg(corners: list[Vec2], radius_m: float) -> tuple[Vec2, ...]:
    return tuple(corners) if len(corners) > 1 else ((0.0, 0.0), (radius_m, 0.0))


PATTERNS: dict[str, Pattern] = {"expanding_square": expanding_square, "spiral": spiral, "lawnmower": lawnmower}
