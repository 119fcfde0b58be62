"""The flat ground of PX4's built-in simulator (SIH): it holds the vehicle while the net force points down, without bounce or sliding; the
vehicle may still turn there (logged: by 7 degrees after a touchdown).

At touchdown the vehicle is stopped within one step; PX4's state estimator sees that as an acceleration, averaged over the 8 ms in which
it takes up the accelerometer's readings, and its hover thrust estimator learns from that how much the measurement is worth. While
the vehicle stands it accelerates no more, whatever the motors do. W local NED, metres, seconds.
"""

from __future__ import annotations

from sitl_stub.multirotor import Multirotor

_AVERAGED_US = 8_000


class SihGround:
    """Ground at a height, under one vehicle; call `stop` after each step of the vehicle."""

    def __init__(self, body: Multirotor, z_m: float = 0.0) -> None:
        self._body, self._z_m = body, z_m
        self._impact_m_s2 = 0.0
        self._impact_us = 0

    def stop(self, step_us: int) -> None:
        """Hold the vehicle where it has reached the ground within the last step."""
        body, state = self._body, self._body.state
        was_down = body.on_surface
        body.on_surface = state.z >= self._z_m and body.acceleration_ned_m_s2[2] >= 0.0
        if not body.on_surface:
            return
        if not was_down:
            self._impact_m_s2, self._impact_us = -state.vz / (_AVERAGED_US * 1e-6), _AVERAGED_US
        body.acceleration_ned_m_s2 = (0.0, 0.0, self._impact_m_s2 if self._impact_us > 0 else 0.0)
        self._impact_us -= step_us
        body.state = state._replace(z=self._z_m, vx=0.0, vy=0.0, vz=0.0)
