"""How simulated time follows real time: so much of it is due now, and what is done when the machine cannot keep up."""

from __future__ import annotations

_LARGEST_DEBT_S = 0.25
"""Further behind than this, the lost time is given up instead of being caught up in a burst."""


class Pace:
    """Maps a monotonic clock to simulated microseconds. No clock of its own: times are given."""

    def __init__(self, speed: float, now_s: float, t_us: int = 0) -> None:
        self.speed = speed
        self.given_up_s = 0.0
        """Real time in which nothing was simulated because the machine was too slow."""
        self._zero_s = now_s
        self._zero_us = t_us

    def target_us(self, now_s: float, t_us: int) -> int:
        """Simulated time that should be reached now; `t_us` is what has been reached."""
        target = self._zero_us + (now_s - self._zero_s) * self.speed * 1e6
        debt_s = (target - t_us) * 1e-6 / self.speed
        if debt_s > _LARGEST_DEBT_S:
            self.given_up_s += debt_s
            self._zero_s, self._zero_us = now_s, t_us
            return t_us
        return int(target)

    def wait_s(self, now_s: float, t_us: int) -> float:
        """Real time until `t_us` is due."""
        return max(self._zero_s + (t_us - self._zero_us) * 1e-6 / self.speed - now_s, 0.0)
