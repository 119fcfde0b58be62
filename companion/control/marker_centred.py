"""The law of the paper `guo`: a PID on where the marker stands in the body frame, forward and sideways, each output limited.

    e = (forward distance to the marker - standoff, sideways distance of the marker)
    v = R_z(yaw) limited(k e + i integral(e) + d de/dt)

It keeps the marker in the middle of the picture: with a wrong heading it waits beside the landing point, and turning moves the
place it wants. No feed-forward: it trails a pad that moves until the integral has learned the speed. On the way to any other
place than the landing point (to behind the pad) the plan is flown as by `velocity`; so is the height. The paper sends a position
setpoint, p + R u, which PX4 answers with v = 0.95 1/s u, and turns u by the yaw asked for; here by the yaw that is.
"""

from __future__ import annotations

import math

from companion.config import Control
from companion.control.law import ControlInput, ControlOutput
from companion.control.limits import clipped
from companion.control.velocity import VelocityLaw
from companion.geometry import ZERO, yaw_of
from companion.messages import Vec2

AT_THE_PAD_M = 0.01


class MarkerCentredLaw:
    """`controller = "guo"`. State: integral and last error, forward and right."""

    def __init__(self, config: Control) -> None:
        self._config = config
        self._elsewhere = VelocityLaw(config)
        self.reset()

    def reset(self) -> None:
        self._elsewhere.reset()
        self._forget()

    def _forget(self) -> None:
        self._integral_m_s = [0.0, 0.0]
        self._last_m: Vec2 | None = None

    def update(self, control: ControlInput) -> ControlOutput:
        planned = self._elsewhere.update(control)
        if not control.feedback or not _leads_to_the_pad(control) or control.pad_yaw_rad is None:
            self._forget()
            return planned
        yaw_rad = yaw_of(control.q_ned_frd)
        error = self._error_m(control, control.pad_yaw_rad, yaw_rad)
        before = error if self._last_m is None else self._last_m
        self._last_m = error
        forward = self._output_m_s(0, error, before, control.dt_s)
        right = self._output_m_s(1, error, before, control.dt_s)
        c, s = math.cos(yaw_rad), math.sin(yaw_rad)
        return ControlOutput((c * forward - s * right, s * forward + c * right, planned.velocity_ned_m_s[2]), ZERO)

    def _error_m(self, control: ControlInput, pad_yaw_rad: float, yaw_rad: float) -> Vec2:
        """Forward beyond the standoff, and right: where the marker stands, seen from the vehicle."""
        standoff = self._config.marker_ahead_m
        north = standoff * math.cos(pad_yaw_rad) - control.relative_position_m[0]
        east = standoff * math.sin(pad_yaw_rad) - control.relative_position_m[1]
        c, s = math.cos(yaw_rad), math.sin(yaw_rad)
        return (c * north + s * east - standoff, c * east - s * north)

    def _output_m_s(self, axis: int, error_m: Vec2, before_m: Vec2, dt_s: float) -> float:
        """The integral learns the pad's speed, not the way to it: not while the output is at its limit."""
        c = self._config
        rate = (error_m[axis] - before_m[axis]) / dt_s if dt_s > 0.0 else 0.0
        wanted = c.position_gain_hz * error_m[axis] + c.damping * rate + self._integral_m_s[axis]
        if abs(wanted) < c.max_axis_speed_m_s:
            grown = self._integral_m_s[axis] + c.integral_gain_hz2 * error_m[axis] * dt_s
            self._integral_m_s[axis] = clipped(grown, c.max_integral_m_s)
        return clipped(wanted, c.max_axis_speed_m_s)


def _leads_to_the_pad(control: ControlInput) -> bool:
    goal = control.goal_position_m
    return goal is not None and math.hypot(goal[0], goal[1]) < AT_THE_PAD_M
