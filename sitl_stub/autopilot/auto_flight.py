"""PX4's automatic flight task: navigation target in, trajectory setpoint (position, velocity, acceleration) out.

Landing sinks with MPC_Z_V_AUTO_DN above MPC_LAND_ALT1, slows linearly to MPC_LAND_SPEED at MPC_LAND_ALT2, and creeps with MPC_LAND_CRWL
below MPC_LAND_ALT3 when a range sensor measures the ground. While the vehicle waits on the ground, the point sinks with 0.7 m/s from
where the vehicle is; a take-off below MPC_LAND_ALT1 turns that into a climb with MPC_TKO_SPEED / MPC_TKO_RAMP_T, its height kept at
the vehicle's. Heading turns at most MPC_YAWRAUTO_MAX.
"""

from __future__ import annotations

from math import nan, pi, radians, remainder

from sitl_stub.autopilot.navigation import NavigationTarget, Situation, TargetKind
from sitl_stub.autopilot.parameters import Parameters
from sitl_stub.autopilot.setpoint import TrajectorySetpoint
from sitl_stub.autopilot.trajectory import SmoothedPoint, SmoothingLimits, VerticalLimits

_WAITING_DESCENT_M_S = 0.7
"""Vertical speed of the point while the vehicle waits on the ground."""


def _interpolated(value: float, low: float, high: float, at_low: float, at_high: float) -> float:
    if value <= low:
        return at_low
    if value >= high:
        return at_high
    return at_low + (at_high - at_low) * (value - low) / (high - low)


class AutoFlight:
    """The smoothed point and heading of the automatic modes."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._point = SmoothedPoint()
        self._yaw_rad = 0.0
        self.refresh()

    def refresh(self) -> None:
        """Read the parameters again."""
        get = self._parameters.get
        self._limits = SmoothingLimits(
            cruise_m_s=get("MPC_XY_CRUISE"),
            acceleration_xy_m_s2=get("MPC_ACC_HOR"),
            jerk_m_s3=get("MPC_JERK_AUTO"),
            error_max_m=get("MPC_XY_ERR_MAX"),
        )
        self._up = VerticalLimits(get("MPC_Z_V_AUTO_UP"), get("MPC_ACC_UP_MAX"))
        self._down = VerticalLimits(get("MPC_Z_V_AUTO_DN"), get("MPC_ACC_DOWN_MAX"))
        ramp_m_s2 = get("MPC_TKO_SPEED") / max(get("MPC_TKO_RAMP_T"), 0.1)
        self._takeoff = VerticalLimits(get("MPC_TKO_SPEED"), min(self._up.acceleration_m_s2, ramp_m_s2))
        self._yaw_rate_rad_s = radians(get("MPC_YAWRAUTO_MAX"))

    def start(self, situation: Situation) -> None:
        """Begin at the vehicle, with its velocity."""
        self._point.start(situation.position_ned_m, situation.velocity_ned_m_s)
        self._yaw_rad = situation.yaw_rad

    def wait(self, situation: Situation) -> None:
        """On the ground, before the take-off ramp: begin again, sinking."""
        self._point.start(situation.position_ned_m, (0.0, 0.0, _WAITING_DESCENT_M_S))
        self._yaw_rad = situation.yaw_rad

    def shift(self, delta_ned_m: tuple[float, float, float]) -> None:
        """Follow a jump of the position estimate."""
        self._point.shift(delta_ned_m)

    def update(self, situation: Situation, target: NavigationTarget) -> TrajectorySetpoint:
        """Setpoint of this step."""
        descent = self._land_speed_m_s(situation) if target.kind is TargetKind.LAND else None
        self._point.advance(
            (target.x_m, target.y_m),
            target.z_m,
            descent,
            situation.position_ned_m,
            self._limits,
            self._vertical_limits(situation, target),
            situation.dt_s,
        )
        self._turn(target.yaw_rad, situation.dt_s)
        return self._setpoint()

    def _vertical_limits(self, situation: Situation, target: NavigationTarget) -> VerticalLimits:
        """By the way the point last wanted to go; a low take-off also keeps the point at the vehicle's height."""
        if self._point.wanted_vz_m_s >= 0.0:
            return self._down
        if target.kind is TargetKind.TAKEOFF and self._height_m(situation) < self._parameters.get("MPC_LAND_ALT1"):
            self._point.z.position_m = situation.position_ned_m[2]
            return self._takeoff
        return self._up

    def _setpoint(self) -> TrajectorySetpoint:
        x, y, z = self._point.x, self._point.y, self._point.z
        return TrajectorySetpoint(
            (x.position_m, y.position_m, z.position_m),
            (x.velocity_m_s, y.velocity_m_s, z.velocity_m_s),
            (x.acceleration_m_s2, y.acceleration_m_s2, z.acceleration_m_s2),
            self._yaw_rad,
            nan,
        )

    def _height_m(self, situation: Situation) -> float:
        if situation.height_above_ground_m is not None:
            return situation.height_above_ground_m
        return situation.home_ned_m[2] - situation.position_ned_m[2]

    def _land_speed_m_s(self, situation: Situation) -> float:
        get = self._parameters.get
        range_m = situation.height_above_ground_m
        if range_m is not None and range_m <= get("MPC_LAND_ALT3"):
            return get("MPC_LAND_CRWL")
        height = self._height_m(situation)
        return _interpolated(
            height, get("MPC_LAND_ALT2"), get("MPC_LAND_ALT1"), get("MPC_LAND_SPEED"), get("MPC_Z_V_AUTO_DN")
        )

    def _turn(self, yaw_rad: float | None, dt_s: float) -> None:
        if yaw_rad is None:
            return
        step = self._yaw_rate_rad_s * dt_s
        error = remainder(yaw_rad - self._yaw_rad, 2.0 * pi)
        self._yaw_rad = remainder(self._yaw_rad + max(-step, min(step, error)), 2.0 * pi)
