"""Capture times guessed from arrivals, for cameras that say nothing: half a frame before the frame came.

Half a frame is the middle of an exposure and read-out that fill the frame time; the rest of the way (compression, network,
decoder) is constant enough to be measured once (`companion calibrate delay`) and configured as the camera's `delay_s`.
"""

from __future__ import annotations

FIRST_PERIOD_NS = 33_333_333
SHARE = 0.1
"""Of a new interval in the running frame period."""


class ArrivalStamps:
    """State: the last arrival and the frame period so far."""

    def __init__(self, period_ns: int = FIRST_PERIOD_NS) -> None:
        self.period_ns = period_ns
        self._last_ns: int | None = None

    def stamp(self, arrived_ns: int) -> tuple[int, int]:
        """(middle of the exposure, half width of its uncertainty), ns: a whole frame either way is honest, no less."""
        self.note(arrived_ns)
        return arrived_ns - self.period_ns // 2, self.period_ns

    def note(self, arrived_ns: int) -> None:
        """Learn the frame period; gaps of more than four frames are outages, not periods."""
        if self._last_ns is not None and 0 < (interval := arrived_ns - self._last_ns) < 4 * self.period_ns:
            self.period_ns += round(SHARE * (interval - self.period_ns))
        self._last_ns = arrived_ns
