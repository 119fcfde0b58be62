"""Speed along a path as a function of time: stand, gather speed, keep it."""

from __future__ import annotations


class RampedSpeed:
    """Stands until `start_delay_s`, then accelerates to `speed_m_s`; an acceleration of 0 means at once."""

    __slots__ = ("_acceleration_m_s2", "_delay_s", "_ramp_s", "_speed_m_s")

    def __init__(self, speed_m_s: float, start_delay_s: float = 0.0, acceleration_m_s2: float = 0.0) -> None:
        self._speed_m_s = speed_m_s
        self._delay_s = start_delay_s
        self._acceleration_m_s2 = acceleration_m_s2
        self._ramp_s = speed_m_s / acceleration_m_s2 if acceleration_m_s2 > 0.0 else 0.0

    def at(self, t_s: float) -> tuple[float, float, float]:
        """Distance in m, speed in m/s, acceleration in m/s^2."""
        t = t_s - self._delay_s
        if t < 0.0:
            return 0.0, 0.0, 0.0
        if t < self._ramp_s:
            return 0.5 * self._acceleration_m_s2 * t * t, self._acceleration_m_s2 * t, self._acceleration_m_s2
        return self._speed_m_s * (t - 0.5 * self._ramp_s), self._speed_m_s, 0.0
