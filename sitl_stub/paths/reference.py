"""What a path asks of a carrier at one instant, in the path's own plane.

North, east, metres; the path starts near the origin and heads north before the scenario turns and moves it (see
`carriers.placement`). Curvature and heading are positive clockwise seen from above.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol


class PathReference(NamedTuple):
    """Where the carrier should be and how it should move there."""

    north_m: float
    east_m: float
    heading_rad: float
    speed_m_s: float
    acceleration_m_s2: float
    curvature_1_m: float


class Path(Protocol):
    """A motion in the plane as a function of time."""

    def at(self, t_s: float) -> PathReference:
        """The reference at `t_s` >= 0, seconds since the scenario began. Calls need not be in order of time."""
        ...
