"""A velocity loop as PX4's, on one axis, for the tests: gain 1.8 1/s, attitude lag 0.15 s, no integrator, drag and wind."""

from __future__ import annotations

import math
from dataclasses import dataclass

from companion.geometry import quaternion_from_euler
from companion.messages import Quaternion

DT_S = 0.02
GAIN_HZ = 1.8
ATTITUDE_LAG_S = 0.15


@dataclass(slots=True)
class Plant:
    """North only. `drag_hz` is drag over mass, against the air that moves with `wind_m_s`."""

    drag_hz: float = 0.0
    wind_m_s: float = 0.0
    position_m: float = 0.0
    velocity_m_s: float = 0.0
    thrust_m_s2: float = 0.0

    def step(self, velocity_setpoint_m_s: float, acceleration_setpoint_m_s2: float) -> None:
        wanted = acceleration_setpoint_m_s2 + GAIN_HZ * (velocity_setpoint_m_s - self.velocity_m_s)
        self.thrust_m_s2 += DT_S / (ATTITUDE_LAG_S + DT_S) * (wanted - self.thrust_m_s2)
        self.velocity_m_s += DT_S * (self.thrust_m_s2 - self.demand_m_s2)
        self.position_m += DT_S * self.velocity_m_s

    @property
    def demand_m_s2(self) -> float:
        return self.drag_hz * (self.velocity_m_s - self.wind_m_s)

    @property
    def q_ned_frd(self) -> Quaternion:
        """Nose down pulls north."""
        return quaternion_from_euler(0.0, -math.atan2(self.thrust_m_s2, 9.80665), 0.0)
