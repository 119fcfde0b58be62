"""Search patterns: where to look when nothing is known of the pad. Pure functions of time, horizontal, metres from the centre."""

from __future__ import annotations

import math
from collections.abc import Callable

Pattern = Callable[[float, float, float], tuple[float, float]]
"""(path length flown m, track spacing m, radius m) -> (north, east) m from the centre of the search."""


def expanding_square(flown_m: float, spacing_m: float, radius_m: float) -> tuple[float, float]:
    """Legs of 1, 1, 2, 2, 3, 3 ... spacings, turning right; starts again at the centre when the radius is reached."""
    legs = max(1, math.floor(2.0 * radius_m / spacing_m))
    total = sum((leg // 2 + 1) * spacing_m for leg in range(legs))
    left = flown_m % total
    north, east, heading = 0.0, 0.0, 0
    for leg in range(legs):
        length = (leg // 2 + 1) * spacing_m
        step = min(left, length)
        north += step * (1.0, 0.0, -1.0, 0.0)[heading]
        east += step * (0.0, 1.0, 0.0, -1.0)[heading]
        left -= step
        if left <= 0.0:
            break
        heading = (heading + 1) % 4
    return north, east


def spiral(flown_m: float, spacing_m: float, radius_m: float) -> tuple[float, float]:
    """Archimedean spiral with the given distance between its turns; starts again when the radius is reached."""
    growth = spacing_m / (2.0 * math.pi)
    angle = math.sqrt(2.0 * flown_m / growth) if flown_m > 0.0 else 0.0
    r = (growth * angle) % max(radius_m, spacing_m)
    return r * math.cos(angle), r * math.sin(angle)


PATTERNS: dict[str, Pattern] = {"expanding_square": expanding_square, "spiral": spiral}
