"""A range sensor that repeats one reading while the vehicle rises or sinks is stuck: its readings say nothing.

Real readings differ by their noise from one to the next. Every reading that differs is believed again.
Called by pipeline.py before anybody uses the reading.
"""

from __future__ import annotations

STUCK_AFTER_M = 0.3
"""Vertical way of the vehicle, within the sensor's resolution over no deck: half a second of the final descent."""


class RangeWatch:
    """State: the reading that repeats, and how high the vehicle was when it first came."""

    def __init__(self) -> None:
        self._distance_m: float | None = None
        self._down_m = 0.0

    def is_stuck(self, distance_m: float | None, down_m: float) -> bool:
        """Take one reading and the vehicle's height when it was made (down, any steady origin)."""
        if distance_m is None or distance_m != self._distance_m:
            self._distance_m, self._down_m = distance_m, down_m
            return False
        return abs(down_m - self._down_m) > STUCK_AFTER_M
