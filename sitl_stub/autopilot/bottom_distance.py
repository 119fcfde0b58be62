"""The distance to what is below, as PX4's state estimator tells it (dist_bottom): that of its fusion horizon, not of now.

PX4's filter works on data that are as old as its longest sensor delay asks for. Attitude, velocity and position are predicted from there to
now with the newest inertial data; the distance to the bottom is not, so what depends on it (landing speeds, the land detector, the hover
thrust estimator) comes later by that much. Metres along the range sensor's ray, boot clock; fed by the estimator.
"""

from __future__ import annotations

from collections import deque

FUSION_HORIZON_US = 152_000
"""Logged: age of the filter's states when they are published; the logged distance fits the true one of 0.145 s before best."""


class BottomDistance:
    """Readings of the range sensor that the filter has not come to yet."""

    def __init__(self) -> None:
        self._seen: deque[tuple[int, float | None]] = deque()

    def take(self, t_us: int, range_m: float | None) -> float | None:
        """The distance that holds from a new reading (None: nothing valid) to the next one.

        It is that of the horizon in the middle of this time, between two readings in proportion.
        """
        seen = self._seen
        gap_us = t_us - seen[-1][0] if seen else 0
        seen.append((t_us, range_m))
        at_us = min(t_us - FUSION_HORIZON_US + gap_us // 2, t_us)
        while len(seen) > 2 and seen[1][0] <= at_us:
            seen.popleft()
        (from_us, before), (to_us, after) = seen[0], seen[min(1, len(seen) - 1)]
        if before is None or after is None or at_us <= from_us:
            return before
        return before + (after - before) * (at_us - from_us) / (to_us - from_us)
