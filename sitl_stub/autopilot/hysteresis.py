"""A flag that turns on only after its condition held for a while, and off at once. Times are on the boot clock."""

from __future__ import annotations


class Hysteresis:
    """`update` gives the delayed flag; `on_after_us` may differ from call to call, as PX4's land detector needs."""

    def __init__(self) -> None:
        self.state = False
        self._requested_since_us: int | None = None

    def update(self, requested: bool, on_after_us: float, t_us: int) -> bool:
        """Delayed flag at t_us."""
        if not requested:
            self.reset(False)
            return False
        if self._requested_since_us is None:
            self._requested_since_us = t_us
        if t_us - self._requested_since_us >= on_after_us:
            self.state = True
        return self.state

    @property
    def is_pending(self) -> bool:
        """The condition holds and the flag waits, or is on because of it."""
        return self._requested_since_us is not None

    def reset(self, state: bool) -> None:
        """Set the flag without delay."""
        self.state = state
        self._requested_since_us = None
