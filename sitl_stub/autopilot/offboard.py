"""SET_POSITION_TARGET_LOCAL_NED as PX4's receiver and OFFBOARD mode take it.

Only frames LOCAL_NED (1) and BODY_NED (8); BODY_NED turns velocity and acceleration by yaw and drops the position. A component that is
ignored by the mask, NaN or infinite is not controlled. A message with nothing to control is answered by a text and is no stream. A
setpoint that leaves an axis uncontrolled keeps OFFBOARD alive but can't be flown: the vehicle brakes and holds. Units: m, m/s, m/s^2, rad.
"""

from __future__ import annotations

from math import cos, inf, isfinite, nan, sin
from typing import NamedTuple

from sitl_stub.autopilot import events
from sitl_stub.autopilot.setpoint import TrajectorySetpoint

FRAME_LOCAL_NED = 1
FRAME_BODY_NED = 8
_MASK_YAW = 1 << 10
_MASK_YAW_RATE = 1 << 11

Vector = tuple[float, float, float]
_NOTHING: Vector = (nan, nan, nan)


class LocalTarget(NamedTuple):
    """The fields of the message that matter."""

    frame: int
    mask: int
    position_m: Vector
    velocity_m_s: Vector
    acceleration_m_s2: Vector
    yaw_rad: float
    yaw_rate_rad_s: float


def _masked(values: Vector, mask: int, first_bit: int) -> Vector:
    ignored = mask >> first_bit
    if ignored & 7 == 7:
        return _NOTHING
    x, y, z = values
    return (
        nan if ignored & 1 or not isfinite(x) else x,
        nan if ignored & 2 or not isfinite(y) else y,
        nan if ignored & 4 or not isfinite(z) else z,
    )


def _turned_by_yaw(values: Vector, yaw_rad: float) -> Vector:
    if not any(isfinite(value) for value in values):
        return _NOTHING
    x, y, z = (value if isfinite(value) else 0.0 for value in values)
    c, s = cos(yaw_rad), sin(yaw_rad)
    return c * x - s * y, s * x + c * y, z


def _controls(values: Vector) -> bool:
    x, y, z = values
    return isfinite(x) or isfinite(y) or isfinite(z)


class OffboardStream:
    """The latest setpoint and when the stream was last alive."""

    def __init__(self) -> None:
        self.setpoint: TrajectorySetpoint | None = None
        self._alive_us: int | None = None

    def receive(self, target: LocalTarget, vehicle_yaw_rad: float, t_us: int) -> events.Notice | None:
        """Take a message; a notice when PX4 refuses it."""
        if target.frame not in (FRAME_LOCAL_NED, FRAME_BODY_NED):
            return events.unsupported_frame(target.frame)
        position = _masked(target.position_m, target.mask, 0)
        velocity = _masked(target.velocity_m_s, target.mask, 3)
        acceleration = _masked(target.acceleration_m_s2, target.mask, 6)
        if target.frame == FRAME_BODY_NED:
            position = _NOTHING
            velocity = _turned_by_yaw(velocity, vehicle_yaw_rad)
            acceleration = _turned_by_yaw(acceleration, vehicle_yaw_rad)
        if not (_controls(position) or _controls(velocity) or _controls(acceleration)):
            return events.invalid_setpoint()
        yaw = nan if target.mask & _MASK_YAW or not isfinite(target.yaw_rad) else target.yaw_rad
        yaw_rate = nan if target.mask & _MASK_YAW_RATE or not isfinite(target.yaw_rate_rad_s) else target.yaw_rate_rad_s
        self.setpoint = TrajectorySetpoint(position, velocity, acceleration, yaw, yaw_rate)
        self._alive_us = t_us
        return None

    def keep_alive(self, t_us: int) -> None:
        """Another kind of setpoint (attitude, rates) came."""
        self._alive_us = t_us

    def is_alive(self, t_us: int, timeout_s: float) -> bool:
        """A usable message came within the timeout (COM_OF_LOSS_T)."""
        return self._alive_us is not None and t_us - self._alive_us <= timeout_s * 1e6

    def dies_us(self, timeout_s: float) -> float:
        """When it is no longer alive, if nothing comes; infinite where nothing came yet."""
        return inf if self._alive_us is None else self._alive_us + timeout_s * 1e6

    def wants_takeoff(self, z_ned_m: float, t_us: int) -> bool:
        """The stream asks to leave the ground: upward velocity or acceleration, or a height above the vehicle."""
        if self.setpoint is None or not self.is_alive(t_us, 1.0):
            return False
        z = self.setpoint.position_ned_m[2]
        if isfinite(z):
            return z < z_ned_m
        vz = self.setpoint.velocity_ned_m_s[2]
        if isfinite(vz):
            return vz < 0.0
        return self.setpoint.acceleration_ned_m_s2[2] < 0.0
