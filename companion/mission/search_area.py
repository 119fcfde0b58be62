"""A search as it is flown: along a pattern, there and back, around a centre that drifts with the pad's last known velocity.

The path begins where the vehicle is, and leads to the centre by the waypoints there may be. Where the next point is not allowed (fence, no-fly zone) or the pattern ends, the
search turns back the way it came, so that it never crosses what it must not; at the centre again it goes on with the
pattern turned by a quarter. Local NED, m; called by pipeline.py once a tick in SEARCH.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

from companion.config import Mission
from companion.messages import Vec2, Vec3
from companion.mission.search import PATTERNS

Allowed = Callable[[Vec2], bool]


@dataclass(frozen=True, slots=True)
class SearchPoint:
    """Where to be and how fast to move there, NED."""

    position_ned_m: Vec3
    velocity_ned_m_s: Vec3


class Path:
    """A polyline by its length."""

    __slots__ = ("_at_m", "_corners", "length_m")

    def __init__(self, corners: tuple[Vec2, ...]) -> None:
        self._corners = corners
        self._at_m = [0.0]
        for a, b in pairwise(corners):
            self._at_m.append(self._at_m[-1] + math.dist(a, b))
        self.length_m = self._at_m[-1]

    def sample(self, along_m: float) -> tuple[Vec2, Vec2]:
        """Point and direction (unit; zero for a path without length)."""
        along_m = min(max(along_m, 0.0), self.length_m)
        leg = min(bisect_right(self._at_m, along_m) - 1, len(self._corners) - 2)
        a, b = self._corners[leg], self._corners[leg + 1]
        length = self._at_m[leg + 1] - self._at_m[leg]
        if length <= 0.0:
            return a, (0.0, 0.0)
        direction = ((b[0] - a[0]) / length, (b[1] - a[1]) / length)
        left = along_m - self._at_m[leg]
        return (a[0] + left * direction[0], a[1] + left * direction[1]), direction


class SearchArea:
    """State of one search: which path, how far along, which way."""

    def __init__(
        self,
        mission: Mission,
        *,
        t_ns: int,
        here_ned_m: Vec3,
        centre_ned_m: Vec3,
        drift_m_s: Vec2,
        allowed: Allowed,
        by_ned_m: Sequence[Vec2] = (),
    ) -> None:
        self._mission = mission
        self._began_ns = t_ns
        self._last_ns = t_ns
        self._centre = centre_ned_m
        self._drift = drift_m_s
        self._allowed = allowed
        self._corners = PATTERNS[mission.search_pattern](mission.search_spacing_m, mission.search_radius_m)
        way = (here_ned_m[:2], *by_ned_m, centre_ned_m[:2])
        self._path = Path(tuple((north - centre_ned_m[0], east - centre_ned_m[1]) for north, east in way))
        self._is_leading_in = True
        self._along_m = 0.0
        self._way = 1.0
        self._quarters = 0

    def step(self, t_ns: int) -> SearchPoint:
        """Move on to `t_ns`."""
        step_m = self._mission.search_speed_m_s * max(0.0, (t_ns - self._last_ns) / 1e9)
        self._last_ns = t_ns
        wanted = self._along_m + self._way * step_m
        if self._is_leading_in and wanted >= self._path.length_m:
            self._begin_pattern()
        elif self._way < 0.0 and wanted <= 0.0 and not self._is_leading_in:
            self._quarters += 1
            self._begin_pattern()
        elif wanted > self._path.length_m or not self._allowed(self._place(wanted, t_ns)):
            self._turn_back(t_ns)
        else:
            self._along_m = wanted
        return self.ahead(t_ns)

    def ahead(self, t_ns: int) -> SearchPoint:
        """Where the search will be at `t_ns`, as far as its leg goes on."""
        along = self._along_m + self._way * self._mission.search_speed_m_s * (t_ns - self._last_ns) / 1e9
        _, direction = self._path.sample(along)
        north, east = self._place(along, t_ns)
        moving = 0.0 if not 0.0 < along < self._path.length_m else self._way * self._mission.search_speed_m_s
        drift = self._drift if self._drift_s(t_ns) < self._mission.search_cone_s else (0.0, 0.0)
        velocity = (drift[0] + moving * direction[0], drift[1] + moving * direction[1], 0.0)
        return SearchPoint((north, east, self._centre[2]), velocity)

    def _begin_pattern(self) -> None:
        turned = self._corners
        for _ in range(self._quarters % 4):
            turned = tuple((-east, north) for north, east in turned)
        self._path, self._is_leading_in, self._along_m, self._way = Path(turned), False, 0.0, 1.0

    def _turn_back(self, t_ns: int) -> None:
        """Stays where it is when the way back is closed too."""
        if self._is_leading_in:
            return
        self._way = -self._way

    def _place(self, along_m: float, t_ns: int) -> Vec2:
        (north, east), _ = self._path.sample(along_m)
        drifted = min(self._drift_s(t_ns), self._mission.search_cone_s)
        return (
            self._centre[0] + north + drifted * self._drift[0],
            self._centre[1] + east + drifted * self._drift[1],
        )

    def _drift_s(self, t_ns: int) -> float:
        return (t_ns - self._began_ns) / 1e9
