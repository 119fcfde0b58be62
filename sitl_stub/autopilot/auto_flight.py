"""PX4's automatic flight task: navigation target in, trajectory setpoint (position, velocity, acceleration) out.

Landing sinks with MPC_Z_V_AUTO_DN above MPC_LAND_ALT1, slows linearly to MPC_LAND_SPEED at MPC_LAND_ALT2, and creeps with MPC_LAND_CRWL
below MPC_LAND_ALT3 when a range sensor measures the ground. A take-off climbs with a speed that grows by MPC_TKO_SPEED in
MPC_TKO_RAMP_T, from half a ramp after the ramp's begin, without a position setpoint in z. Heading turns at most MPC_YAWRAUTO_MAX.
"""

from __future__ import annotations

from math import nan, pi, radians, remainder

from sitl_stub.autopilot.navigation import NavigationTarget, Situation, TargetKind
from sitl_stub.autopilot.parameters import Parameters
from sitl_stub.autopilot.setpoint import TrajectorySetpoint
from sitl_stub.autopilot.trajectory import SmoothedPoint, SmoothingLimits, braking_speed_m_s


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
        self._climb_s = 0.0
        self.refresh()

    def refresh(self) -> None:
        """Read the parameters again."""
        get = self._parameters.get
        self._limits = SmoothingLimits(
            cruise_m_s=get("MPC_XY_CRUISE"),
            climb_m_s=get("MPC_Z_V_AUTO_UP"),
            descent_m_s=get("MPC_Z_V_AUTO_DN"),
            acceleration_xy_m_s2=get("MPC_ACC_HOR"),
            acceleration_up_m_s2=get("MPC_ACC_UP_MAX"),
            acceleration_down_m_s2=get("MPC_ACC_DOWN_MAX"),
            jerk_m_s3=get("MPC_JERK_AUTO"),
            gain_xy=get("MPC_XY_TRAJ_P"),
            error_max_m=get("MPC_XY_ERR_MAX"),
        )
        self._yaw_rate_rad_s = radians(get("MPC_YAWRAUTO_MAX"))

    def start(self, situation: Situation) -> None:
        """Begin at the vehicle, with its velocity."""
        self._point.start(situation.position_ned_m, situation.velocity_ned_m_s)
        self._yaw_rad = situation.yaw_rad

    def shift(self, delta_ned_m: tuple[float, float, float]) -> None:
        """Follow a jump of the position estimate."""
        self._point.shift(delta_ned_m)

    def update(self, situation: Situation, target: NavigationTarget) -> TrajectorySetpoint:
        """Setpoint of this step."""
        target_xy, vehicle = (target.x_m, target.y_m), situation.position_ned_m
        if target.kind is TargetKind.TAKEOFF:
            self._point.advance(target_xy, None, None, vehicle, self._limits, situation.dt_s)
            self._climb(situation, target.z_m)
        else:
            descent = self._land_speed_m_s(situation) if target.kind is TargetKind.LAND else None
            self._point.advance(target_xy, target.z_m, descent, vehicle, self._limits, situation.dt_s)
        self._turn(target.yaw_rad, situation.dt_s)
        return self._setpoint()

    def _setpoint(self) -> TrajectorySetpoint:
        x, y, z = self._point.x, self._point.y, self._point.z
        return TrajectorySetpoint(
            (x.position_m, y.position_m, z.position_m),
            (x.velocity_m_s, y.velocity_m_s, z.velocity_m_s),
            (x.acceleration_m_s2, y.acceleration_m_s2, z.acceleration_m_s2),
            self._yaw_rad,
            nan,
        )

    def start_climb(self) -> None:
        """The take-off ramp has not begun yet."""
        self._climb_s = 0.0

    def continue_climb(self) -> None:
        """A take-off commanded in the air: no ramp any more."""
        self._climb_s = 2.0 * self._parameters.get("MPC_TKO_RAMP_T")

    def _climb(self, situation: Situation, target_z_m: float) -> None:
        get = self._parameters.get
        self._climb_s += situation.dt_s
        speed = get("MPC_TKO_SPEED")
        wanted = speed * (self._climb_s / max(get("MPC_TKO_RAMP_T"), 0.1) - 0.5)
        z = self._point.z
        z.position_m = situation.position_ned_m[2]
        near = braking_speed_m_s(z.position_m - target_z_m, self._limits.acceleration_down_m_s2, self._limits.jerk_m_s3)
        z.velocity_m_s = -max(0.0, min(wanted, speed, near))
        z.acceleration_m_s2 = 0.0

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
