"""The default law: feed the pad's motion forward, correct the relative position, damp the relative velocity.

    v = v_pad(t + lead) + v_ref(t + lead) + k (p_ref - p) + d (v_ref - v) + i integral(p_ref - p)
    a = a_pad(t + lead) + a_ref(t + lead) + demand

PX4's velocity loop answers `v` with a proportional gain of 1.8 1/s behind an attitude loop of about 0.2 s, and adds `a`
to its own demand. Sending `a` in the same message is what lets it follow a curve: without it the vehicle lags a pad that
accelerates by a_pad / 1.8 s^-1. Only relative velocity is damped; damping absolute velocity would make the vehicle lag
in proportion to the pad's speed. `demand` is what steady flight costs here (demand.py); `demand_time_s = 0` leaves it out.
"""

from __future__ import annotations

from companion.config import Control
from companion.control.demand import SteadyDemand
from companion.control.law import ControlInput, ControlOutput
from companion.control.limits import clipped
from companion.geometry import ZERO, add, horizontal_norm, scale, subtract
from companion.messages import Vec3

INTEGRATE_WITHIN_M = 1.0
"""Beyond this error the integral would only learn the approach, not the wind."""

STILL_M_S = 0.1
"""Nor is the height integrated while its reference moves faster: that would sum the descent's lag up, and meet the deck as much
faster."""

PRESSED_LEAN = 0.5
"""On the deck the feet's friction carries the vehicle through the curve as well. With this part of the lean it comes down on
all its feet; with none of it, it slides."""


class VelocityLaw:
    """`controller = "velocity"`."""

    def __init__(self, config: Control) -> None:
        self._config = config
        self._integral_m_s: Vec3 = ZERO
        self._demand = (
            SteadyDemand(config.demand_time_s, config.max_demand_m_s2) if config.demand_time_s > 0.0 else None
        )

    def reset(self) -> None:
        self._integral_m_s = ZERO
        if self._demand is not None:
            self._demand.reset()

    def update(self, control: ControlInput) -> ControlOutput:
        forward = add(control.pad_velocity_ahead_m_s, control.reference_ahead.velocity_m_s)
        acceleration = add(control.pad_acceleration_ahead_m_s2, control.reference_ahead.acceleration_m_s2)
        acceleration = add(acceleration, self._steady_demand(control))
        if not control.feedback:
            north, east, down = acceleration
            return ControlOutput(forward, (PRESSED_LEAN * north, PRESSED_LEAN * east, down))
        error = subtract(control.reference.position_m, control.relative_position_m)
        error_rate = subtract(control.reference.velocity_m_s, control.relative_velocity_m_s)
        self._integrate(error, control)
        c = self._config
        velocity = (
            forward[0] + c.position_gain_hz * error[0] + c.damping * error_rate[0] + self._integral_m_s[0],
            forward[1] + c.position_gain_hz * error[1] + c.damping * error_rate[1] + self._integral_m_s[1],
            forward[2] + c.vertical_gain_hz * error[2] + self._integral_m_s[2],
        )
        return ControlOutput(velocity, acceleration)

    def _steady_demand(self, control: ControlInput) -> Vec3:
        """Pressed on the deck the vehicle learns nothing: the deck pushes back."""
        if self._demand is None:
            return ZERO
        if control.feedback:
            self._demand.update(control.velocity_ned_m_s, control.q_ned_frd, control.dt_s)
        return self._demand.acceleration_ned_m_s2

    def _integrate(self, error_m: Vec3, control: ControlInput) -> None:
        if horizontal_norm(error_m) > INTEGRATE_WITHIN_M:
            return
        north, east, down = error_m
        moves = abs(control.reference.velocity_m_s[2]) > STILL_M_S
        limit, gain = self._config.max_integral_m_s, self._config.integral_gain_hz2 * control.dt_s
        grown = add(self._integral_m_s, scale((north, east, 0.0 if moves else down), gain))
        self._integral_m_s = (clipped(grown[0], limit), clipped(grown[1], limit), clipped(grown[2], limit))
