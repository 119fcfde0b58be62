"""What the control cascade is asked to fly, at three levels: trajectory, attitude, body rates.

NaN means "not controlled", as in PX4: a velocity beside a position is its feed-forward, an acceleration beside either is
added to what the velocity loop asks for. W is local NED, B is FRD. Made by the flight tasks and the MAVLink endpoint.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite, nan
from typing import NamedTuple

from sitl_stub.rotation import Quaternion, Vec3

UNSET: Vec3 = (nan, nan, nan)


class TrajectorySetpoint(NamedTuple):
    """Position, velocity, acceleration in W, heading and its rate; NaN where not controlled."""

    position_ned_m: Vec3 = UNSET
    velocity_ned_m_s: Vec3 = UNSET
    acceleration_ned_m_s2: Vec3 = UNSET
    yaw_rad: float = nan
    yaw_rate_rad_s: float = nan

    @property
    def wants_climb(self) -> bool:
        """Asks to go up with a velocity or an acceleration (a position needs the estimate: see `is_above`)."""
        return self.velocity_ned_m_s[2] < 0.0 or self.acceleration_ned_m_s2[2] < 0.0

    def is_above(self, z_ned_m: float) -> bool:
        """Asks for a position higher than z; False when no height is asked for."""
        return isfinite(self.position_ned_m[2]) and self.position_ned_m[2] < z_ned_m


@dataclass(frozen=True, slots=True)
class AttitudeSetpoint:
    """Attitude, collective thrust 0..1 and heading rate about down. Stabilized mode and SET_ATTITUDE_TARGET."""

    q_ned_frd: Quaternion
    thrust: float
    yaw_rate_rad_s: float = 0.0


@dataclass(frozen=True, slots=True)
class RatesSetpoint:
    """Body rates (NaN: keep what is measured) and collective thrust 0..1. Acro mode and SET_ATTITUDE_TARGET."""

    rates_frd_rad_s: Vec3
    thrust: float


Setpoint = TrajectorySetpoint | AttitudeSetpoint | RatesSetpoint
