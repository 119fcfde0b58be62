"""Modes flown by sticks: position, altitude, stabilised (also for MANUAL) and acro.

Position and altitude control make a velocity of the sticks (MPC_VEL_MANUAL, MPC_Z_VEL_MAX_*) and hold when they are centred; the others
command attitude and thrust, or rates. Sticks as in manual_control; W local NED.
"""

from __future__ import annotations

from math import cos, hypot, nan, radians, sin, tan

from sitl_stub.autopilot.manual_control import Sticks
from sitl_stub.autopilot.modes import NavState
from sitl_stub.autopilot.navigation import Situation
from sitl_stub.autopilot.parameters import Parameters
from sitl_stub.autopilot.setpoint import AttitudeSetpoint, RatesSetpoint, Setpoint, TrajectorySetpoint
from sitl_stub.autopilot.trajectory import SmoothedAxis
from sitl_stub.rotation import from_euler

_DEAD_ZONE = 0.1
_GRAVITY_M_S2 = 9.80665


def _without_dead_zone(value: float) -> float:
    size = max(0.0, abs(value) - _DEAD_ZONE) / (1.0 - _DEAD_ZONE)
    return size if value > 0.0 else -size


class PilotFlight:
    """Smoothed stick velocities and the locked position of one flight by hand."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._vx, self._vy, self._vz = SmoothedAxis(), SmoothedAxis(), SmoothedAxis()
        self._locked_xy: tuple[float, float] | None = None
        self._locked_z: float | None = None
        self._yaw_rad = 0.0
        self._yaw_rate_rad_s = 0.0

    def start(self, situation: Situation) -> None:
        """Begin with the vehicle's velocity."""
        for axis, velocity in zip((self._vx, self._vy, self._vz), situation.velocity_ned_m_s, strict=True):
            axis.velocity_m_s, axis.acceleration_m_s2 = velocity, 0.0
        self._locked_xy = None
        self._locked_z = None
        self._yaw_rad = situation.yaw_rad

    def update(self, mode: NavState, situation: Situation, sticks: Sticks) -> Setpoint:
        """Setpoint of this step."""
        get = self._parameters.get
        self._yaw_rate_rad_s = _without_dead_zone(sticks.yaw) * radians(get("MPC_MAN_Y_MAX"))
        self._yaw_rad += self._yaw_rate_rad_s * situation.dt_s
        if mode is NavState.POSCTL:
            return self._position(situation, sticks)
        if mode is NavState.ALTCTL:
            return self._altitude(situation, sticks)
        if mode is NavState.ACRO:
            return self._rates(sticks)
        return self._attitude(sticks)

    def wants_takeoff(self, sticks: Sticks) -> bool:
        """The throttle is above the middle."""
        return sticks.throttle > _DEAD_ZONE

    def _position(self, situation: Situation, sticks: Sticks) -> Setpoint:
        get = self._parameters.get
        forward, right = _without_dead_zone(sticks.pitch), _without_dead_zone(sticks.roll)
        scale = get("MPC_VEL_MANUAL") / max(1.0, hypot(forward, right))
        c, s = cos(self._yaw_rad), sin(self._yaw_rad)
        moving = forward != 0.0 or right != 0.0
        acceleration = get("MPC_ACC_HOR")
        jerk = get("MPC_JERK_MAX")
        self._vx.advance(scale * (c * forward - s * right), acceleration, jerk, situation.dt_s)
        self._vy.advance(scale * (s * forward + c * right), acceleration, jerk, situation.dt_s)
        x, y = self._lock_xy(situation, moving)
        z, vz, az = self._vertical(situation, sticks)
        return TrajectorySetpoint(
            (x, y, z),
            (self._vx.velocity_m_s, self._vy.velocity_m_s, vz),
            (self._vx.acceleration_m_s2, self._vy.acceleration_m_s2, az),
            self._yaw_rad,
            self._yaw_rate_rad_s,
        )

    def _lock_xy(self, situation: Situation, moving: bool) -> tuple[float, float]:
        x, y, _ = situation.position_ned_m
        if moving:
            self._locked_xy = None
        elif self._locked_xy is None and hypot(*situation.velocity_ned_m_s[:2]) < self._parameters.get(
            "MPC_HOLD_MAX_XY"
        ):
            self._locked_xy = (x, y)
        return self._locked_xy if self._locked_xy is not None else (nan, nan)

    def _vertical(self, situation: Situation, sticks: Sticks) -> tuple[float, float, float]:
        get = self._parameters.get
        up = _without_dead_zone(sticks.throttle)
        target = -up * get("MPC_Z_VEL_MAX_UP") if up > 0.0 else -up * get("MPC_Z_VEL_MAX_DN")
        limit = get("MPC_ACC_DOWN_MAX") if target > self._vz.velocity_m_s else get("MPC_ACC_UP_MAX")
        self._vz.advance(target, limit, get("MPC_JERK_MAX"), situation.dt_s)
        if up != 0.0:
            self._locked_z = None
        elif self._locked_z is None and abs(situation.velocity_ned_m_s[2]) < get("MPC_HOLD_MAX_Z"):
            self._locked_z = situation.position_ned_m[2]
        z = nan if self._locked_z is None else self._locked_z
        return z, self._vz.velocity_m_s, self._vz.acceleration_m_s2

    def _altitude(self, situation: Situation, sticks: Sticks) -> Setpoint:
        tilt = radians(self._parameters.get("MPC_MAN_TILT_MAX"))
        forward = _GRAVITY_M_S2 * tan(tilt * sticks.pitch)
        right = _GRAVITY_M_S2 * tan(tilt * sticks.roll)
        c, s = cos(self._yaw_rad), sin(self._yaw_rad)
        z, vz, az = self._vertical(situation, sticks)
        return TrajectorySetpoint(
            (nan, nan, z),
            (nan, nan, vz),
            (c * forward - s * right, s * forward + c * right, az),
            self._yaw_rad,
            self._yaw_rate_rad_s,
        )

    def _thrust(self, sticks: Sticks) -> float:
        get = self._parameters.get
        low, hover, high = get("MPC_MANTHR_MIN"), get("MPC_THR_HOVER"), get("MPC_THR_MAX")
        if sticks.throttle < 0.0:
            return hover + sticks.throttle * (hover - low)
        return hover + sticks.throttle * (high - hover)

    def _attitude(self, sticks: Sticks) -> Setpoint:
        tilt = radians(self._parameters.get("MPC_MAN_TILT_MAX"))
        q = from_euler(tilt * sticks.roll, -tilt * sticks.pitch, self._yaw_rad)
        return AttitudeSetpoint(q, self._thrust(sticks), self._yaw_rate_rad_s)

    def _rates(self, sticks: Sticks) -> Setpoint:
        get = self._parameters.get
        rates = (
            sticks.roll * radians(get("MC_ACRO_R_MAX")),
            -sticks.pitch * radians(get("MC_ACRO_P_MAX")),
            sticks.yaw * radians(get("MC_ACRO_Y_MAX")),
        )
        return RatesSetpoint(rates, self._thrust(sticks))
