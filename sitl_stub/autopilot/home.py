"""Home: set when the position becomes valid and at each arming, and its altitude, which PX4 v1.17 rewrites in flight.

The rewriting makes relative_alt jump by up to 2.5 m between two samples (recorded: relative_alt minus truth 0.97 m mean, 0.41 m
standard deviation, a change about every 2 s); `error_scale` 0 switches it off. Local NED and metres above mean sea level.
"""

from __future__ import annotations

from sitl_stub.autopilot.noise import NormalTape

_MEAN_M = 0.97
_SIGMA_M = 0.41
_PERIOD_US = 2_000_000
_LIMIT_M = 1.5
_NEVER_US = 1 << 62


class Home:
    """Home position and the wandering of its altitude."""

    def __init__(self, origin_altitude_m: float, noise: NormalTape, error_scale: float) -> None:
        self._origin_altitude_m = origin_altitude_m
        self._noise = noise
        self._error_scale = error_scale
        self._altitude_error_m = 0.0
        self._next_change_us = 0
        self.is_set = False
        self.position_ned_m = (0.0, 0.0, 0.0)
        self.yaw_rad = 0.0
        self.set_t_us = 0

    @property
    def altitude_amsl_m(self) -> float:
        return self._origin_altitude_m - self.position_ned_m[2] - self._altitude_error_m

    def set_here(self, position_ned_m: tuple[float, float, float], yaw_rad: float, t_us: int) -> None:
        """Home is where the vehicle believes to stand."""
        self.is_set = True
        self.position_ned_m = position_ned_m
        self.yaw_rad = yaw_rad
        self.set_t_us = t_us
        self._altitude_error_m = 0.0

    @property
    def next_change_us(self) -> int:
        """When the altitude may jump next; far away when it never does."""
        return _NEVER_US if self._error_scale == 0.0 else self._next_change_us

    def step(self, t_us: int, in_air: bool) -> None:
        """Let the altitude jump while in the air."""
        if not in_air or self._error_scale == 0.0 or t_us < self._next_change_us:
            return
        self._next_change_us = t_us + _PERIOD_US
        jump = max(-_LIMIT_M, min(_LIMIT_M, _SIGMA_M * self._noise.next()))
        self._altitude_error_m = self._error_scale * (_MEAN_M + jump)
        self.set_t_us = t_us
