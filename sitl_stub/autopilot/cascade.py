"""The whole control cascade of a PX4 multicopter: setpoint and estimate in, four motor commands out.

Order and rates are PX4's under lockstep: each 4 ms the rate loop runs on the newest gyro with the rate setpoint of the
step before, then the attitude loop on the newest attitude with the attitude setpoint of the step before, and every 8 ms (when
the estimator publishes a position) the position loop; so a setpoint needs 4 to 16 ms to reach the motors. W local NED,
B FRD, thrust 0..1. Parameters by their PX4 names. Called by the autopilot each step; the commander says through
`FlightConstraints` what the take-off ramp and the modes allow.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite, nan, pi
from typing import Any

from sitl_stub.autopilot.attitude_control import attitude_gains, control_attitude
from sitl_stub.autopilot.hover_thrust import HoverState, HoverThrust
from sitl_stub.autopilot.mixer import Motors, mix
from sitl_stub.autopilot.position_control import (
    UNSET_MOTION,
    Motion,
    PositionLimits,
    attitude_from_thrust,
    control_position,
    is_flyable,
    position_gains,
    tilt_limit_rad,
)
from sitl_stub.autopilot.rate_control import RateState, control_rates, rate_gains
from sitl_stub.autopilot.setpoint import AttitudeSetpoint, RatesSetpoint, Setpoint, TrajectorySetpoint
from sitl_stub.autopilot.steady_control import Asked, LoopConstants
from sitl_stub.autopilot.vehicle_estimate import VehicleEstimate
from sitl_stub.rotation import IDENTITY, Quaternion, Vec3

POSITION_PERIOD_US = 8_000
_TILT_SLEW_RAD_S = 0.2
_FAILSAFE_AFTER_S = 0.2
_IN_AIR_ABOVE_M = 1.0
_ZERO: Vec3 = (0.0, 0.0, 0.0)
_STOPPED: Motors = (0.0, 0.0, 0.0, 0.0)
# PX4 asks for a strong downward acceleration to make sure that there is no thrust on the ground.
_ORIGIN = Motion(*(0.0,) * 9)
_NO_THRUST = Motion(nan, nan, nan, nan, nan, nan, 0.0, 0.0, 100.0)


@dataclass(slots=True)
class FlightConstraints:
    """What the commander, the take-off ramp and the land detector tell the cascade. NaN limits mean PX4's parameter.

    `thrust_off`: armed but not to push (not yet taken off, or ground contact while flying): zero thrust, integrators reset.
    `is_flying`: the take-off ramp has ended: full tilt, MPC_THR_MIN, hover thrust from the estimator.
    """

    armed: bool = False
    landed: bool = True
    maybe_landed: bool = True
    thrust_off: bool = False
    is_flying: bool = True
    climb_limit_m_s: float = nan
    """From the take-off ramp or the flight task; negative during the ramp."""
    descent_limit_m_s: float = nan
    speed_limit_m_s: float = nan


@dataclass(slots=True)
class PositionSetpointEcho:
    """What PX4 publishes as vehicle_local_position_setpoint (POSITION_TARGET_LOCAL_NED and the land detector use it)."""

    position_ned_m: Vec3 = (nan, nan, nan)
    velocity_ned_m_s: Vec3 = (nan, nan, nan)
    acceleration_ned_m_s2: Vec3 = (nan, nan, nan)
    thrust_ned: Vec3 = _ZERO
    yaw_rad: float = nan
    yaw_rate_rad_s: float = nan


class Cascade:
    """State of all loops. After `step`, the attributes hold what PX4 reports about its setpoints."""

    def __init__(self, parameters: Mapping[str, float | int]) -> None:
        self._parameters = parameters
        self.hover_thrust_estimator = HoverThrust(parameters)
        self.refresh()
        self.reset()

    def refresh(self) -> None:
        """Read the parameters again (after a PARAM_SET)."""
        p = self._parameters
        self._position_gains = position_gains(p)
        self._attitude_gains = attitude_gains(p)
        self._rate_gains = rate_gains(p)
        self.hover_thrust_estimator.refresh(p)
        self._speed_xy, self._climb, self._descent = (
            float(p[name]) for name in ("MPC_XY_VEL_MAX", "MPC_Z_VEL_MAX_UP", "MPC_Z_VEL_MAX_DN")
        )
        self._tilt_flying, self._tilt_landing = tilt_limit_rad(p, True), tilt_limit_rad(p, False)
        self._thrust_min, self._thrust_max = float(p["MPC_THR_MIN"]), float(p["MPC_THR_MAX"])
        self._land_speed = max(float(p["MPC_LAND_SPEED"]), 1e-3)
        self._uses_estimator = bool(p["MPC_USE_HTE"])
        cutoff_hz = float(p["MPC_VELD_LP"])
        self._derivative_time_s = 1.0 / (2.0 * pi * cutoff_hz) if cutoff_hz > 0.0 else 0.0

    def limit_descent(self, speed_m_s: float) -> None:
        """What the mode allows downwards, instead of MPC_Z_VEL_MAX_DN; until the parameters are read again."""
        self._descent = speed_m_s

    def reset(self) -> None:
        """State of a cascade that has just been started on the ground."""
        self.position_setpoint = PositionSetpointEcho()
        self.attitude_setpoint: Quaternion = IDENTITY
        self.yaw_rate_setpoint_rad_s = 0.0
        self.thrust_setpoint = 0.0
        self.rates_setpoint_frd_rad_s: Vec3 = _ZERO
        self.torque_setpoint: Vec3 = _ZERO
        self.motors: Motors = _STOPPED
        self.velocity_integral_m_s2: Vec3 = _ZERO
        self.rate_state = RateState()
        self.hover_thrust = float(self._parameters["MPC_THR_HOVER"])
        self.tilt_limit_rad = tilt_limit_rad(self._parameters, False)
        self.is_holding_invalid_setpoint = False
        self.hover_thrust_estimator.reset()
        self._saturated: Vec3 = _ZERO
        self._asked: tuple[TrajectorySetpoint, Motion] | None = None
        self._flyable: tuple[TrajectorySetpoint, bool] | None = None
        self._last_velocity: Vec3 | None = None
        self._velocity_derivative: Vec3 = _ZERO
        self._since_position_us = POSITION_PERIOD_US
        self._invalid_for_s = 0.0
        self._is_in_air = False
        self._ground_z_m = 0.0

    def start_in_flight(
        self,
        hover_thrust: float,
        attitude: Quaternion,
        thrust: float,
        velocity_ned_m_s: Vec3,
        acceleration_ned_m_s2: Vec3 = _ZERO,
    ) -> None:
        """Begin in steady flight: setpoints at the present state, full tilt, hover thrust and the velocity's derivative known."""
        self.hover_thrust = hover_thrust
        self.hover_thrust_estimator.start(hover_thrust)
        self.attitude_setpoint, self.thrust_setpoint = attitude, thrust
        self.tilt_limit_rad = tilt_limit_rad(self._parameters, True)
        self._last_velocity, self._velocity_derivative = velocity_ned_m_s, acceleration_ned_m_s2
        self._is_in_air = True

    def step(
        self, dt_s: float, estimate: VehicleEstimate, setpoint: Setpoint | None, constraints: FlightConstraints
    ) -> Motors:
        """Advance by dt_s (4 ms) and return motor commands 0..1; zeros while disarmed. `setpoint` None keeps the last demand."""
        if not constraints.armed:
            self._stand_still()
            self._follow_estimate(dt_s, estimate)
            return _STOPPED
        self._control_rates(dt_s, estimate, constraints)
        if isinstance(setpoint, RatesSetpoint):
            self._take_rates(setpoint, estimate)
        else:
            if isinstance(setpoint, AttitudeSetpoint):
                self._take_attitude(setpoint)
            self.rates_setpoint_frd_rad_s = control_attitude(
                estimate.q_ned_frd, self.attitude_setpoint, self.yaw_rate_setpoint_rad_s, self._attitude_gains
            )
        self._since_position_us += round(dt_s * 1e6)
        if self._since_position_us >= POSITION_PERIOD_US:
            dt_position_s = min(self._since_position_us * 1e-6, 0.04)
            self._since_position_us = 0
            self._follow_velocity(dt_position_s, estimate)
            if isinstance(setpoint, TrajectorySetpoint):
                self._control_position(dt_position_s, estimate, setpoint, constraints)
                self._estimate_hover_thrust(dt_position_s, estimate, constraints)
        return self.motors

    def _stand_still(self) -> None:
        self.motors = _STOPPED
        self.thrust_setpoint = 0.0
        self.torque_setpoint = self.rates_setpoint_frd_rad_s = _ZERO
        self.velocity_integral_m_s2 = _ZERO
        self.rate_state = RateState()
        self.hover_thrust_estimator.reset()
        self.hover_thrust = float(self._parameters["MPC_THR_HOVER"])
        self.tilt_limit_rad = tilt_limit_rad(self._parameters, False)
        self._is_in_air = False

    def _follow_estimate(self, dt_s: float, estimate: VehicleEstimate) -> None:
        """Keep the velocity derivative running while disarmed, so that arming brings no spike."""
        self._since_position_us += round(dt_s * 1e6)
        if self._since_position_us >= POSITION_PERIOD_US:
            self._follow_velocity(self._since_position_us * 1e-6, estimate)
            self._since_position_us = 0

    def _control_rates(self, dt_s: float, estimate: VehicleEstimate, constraints: FlightConstraints) -> None:
        torque, state = control_rates(
            self.rate_state,
            estimate.angular_velocity_frd_rad_s,
            self.rates_setpoint_frd_rad_s,
            estimate.angular_acceleration_frd_rad_s2,
            self._saturated,
            constraints.landed or constraints.maybe_landed,
            self._rate_gains,
            dt_s,
        )
        self.rate_state, self.torque_setpoint = RateState(*state), torque
        self.motors, self._saturated = mix(self.thrust_setpoint, torque)

    def _take_rates(self, setpoint: RatesSetpoint, estimate: VehicleEstimate) -> None:
        asked, measured = setpoint.rates_frd_rad_s, estimate.angular_velocity_frd_rad_s
        p, q, r = (a if isfinite(a) else m for a, m in zip(asked, measured, strict=True))
        self.rates_setpoint_frd_rad_s = (p, q, r)
        self.thrust_setpoint = setpoint.thrust

    def _take_attitude(self, setpoint: AttitudeSetpoint) -> None:
        self.attitude_setpoint = setpoint.q_ned_frd
        self.thrust_setpoint = setpoint.thrust
        self.yaw_rate_setpoint_rad_s = setpoint.yaw_rate_rad_s if isfinite(setpoint.yaw_rate_rad_s) else 0.0

    def _follow_velocity(self, dt_s: float, estimate: VehicleEstimate) -> None:
        """Filtered derivative of the estimated velocity (MPC_VELD_LP)."""
        if not estimate.has_velocity or self._last_velocity is None:
            self._last_velocity = estimate.velocity_ned_m_s if estimate.has_velocity else None
            self._velocity_derivative = _ZERO
            return
        share = dt_s / (dt_s + self._derivative_time_s) / dt_s
        keep = self._derivative_time_s / (dt_s + self._derivative_time_s)
        (x, y, z), (lx, ly, lz) = estimate.velocity_ned_m_s, self._last_velocity
        dx, dy, dz = self._velocity_derivative
        self._velocity_derivative = (
            keep * dx + share * (x - lx),
            keep * dy + share * (y - ly),
            keep * dz + share * (z - lz),
        )
        self._last_velocity = estimate.velocity_ned_m_s

    def _limits(self, dt_s: float, constraints: FlightConstraints) -> PositionLimits:
        wanted = self._tilt_flying if constraints.is_flying else self._tilt_landing
        step = _TILT_SLEW_RAD_S * dt_s
        self.tilt_limit_rad += min(max(wanted - self.tilt_limit_rad, -step), step)
        speed, climb, descent = (
            constraints.speed_limit_m_s,
            constraints.climb_limit_m_s,
            constraints.descent_limit_m_s,
        )
        return PositionLimits(
            min(speed, self._speed_xy) if speed == speed else self._speed_xy,
            min(climb, self._climb) if climb == climb else self._climb,
            max(descent, 0.0) if descent == descent else self._descent,
            self.tilt_limit_rad,
            self._thrust_min if constraints.is_flying else 0.0,
            self._thrust_max,
        )

    def _state(self, estimate: VehicleEstimate, setpoint: TrajectorySetpoint) -> Motion:
        """The estimate with NaN where it is invalid.

        When a vertical velocity is asked for and no height, PX4 steers by the derivative of height, which has less bias,
        blended in up to MPC_LAND_SPEED.
        """
        x, y, z = estimate.position_ned_m
        if not estimate.has_position:
            x = y = nan
        if not estimate.has_altitude:
            z = nan
        vx, vy, vz = estimate.velocity_ned_m_s
        if not estimate.has_velocity:
            vx = vy = nan
        asked = abs(setpoint.velocity_ned_m_s[2])
        if setpoint.position_ned_m[2] != setpoint.position_ned_m[2] and asked > 1e-6:
            weight = min(asked / self._land_speed, 1.0)
            vz += weight * (estimate.height_rate_ned_m_s - vz)
        return Motion(x, y, z, vx, vy, vz, *self._velocity_derivative)

    def _control_position(
        self, dt_s: float, estimate: VehicleEstimate, setpoint: TrajectorySetpoint, constraints: FlightConstraints
    ) -> None:
        at = self._state(estimate, setpoint)
        limits = self._limits(dt_s, constraints)
        sp = self._flat(setpoint)
        yaw, yaw_rate = setpoint.yaw_rad, setpoint.yaw_rate_rad_s
        if not constraints.is_flying:
            sp = sp._replace(az=nan)
            self._use_hover_thrust(float(self._parameters["MPC_THR_HOVER"]), absorb=False)
        if constraints.thrust_off:
            sp, yaw, yaw_rate = _NO_THRUST, nan, nan
            self.velocity_integral_m_s2 = _ZERO
        elif not is_flyable(sp, at):
            replaced = self._hold_instead(dt_s, at)
            if replaced is None:
                return
            sp, yaw, yaw_rate = replaced, nan, nan
            limits = limits._replace(speed_xy=self._speed_xy, climb=self._climb, descent=self._descent)
        else:
            self._invalid_for_s = 0.0
            self.is_holding_invalid_setpoint = False
        self._run(dt_s, sp, at, limits, yaw if isfinite(yaw) else estimate.yaw_rad, yaw_rate)

    def _flat(self, setpoint: TrajectorySetpoint) -> Motion:
        """The setpoint as the position loop takes it; kept, since a setpoint is flown many times."""
        if self._asked is None or self._asked[0] is not setpoint:
            position, velocity, acceleration, _, _ = setpoint
            flat = tuple.__new__(Motion, position + velocity + acceleration)
            self._asked = (setpoint, flat)
        return self._asked[1]

    def _hold_instead(self, dt_s: float, at: Motion) -> Motion | None:
        """PX4's answer to a setpoint it cannot fly: after 0.2 s brake and stay, or come down when it cannot."""
        self._invalid_for_s += dt_s
        if self._invalid_for_s < _FAILSAFE_AFTER_S:
            return None
        self.is_holding_invalid_setpoint = True
        if at.vx == at.vx:
            return UNSET_MOTION._replace(vx=0.0, vy=0.0, vz=0.0)
        return UNSET_MOTION._replace(ax=0.0, ay=0.0, vz=float(self._parameters["MPC_LAND_SPEED"]))

    def _run(self, dt_s: float, sp: Motion, at: Motion, limits: PositionLimits, yaw: float, yaw_rate: float) -> None:
        demand = control_position(
            sp, at, self.velocity_integral_m_s2, self.hover_thrust, self._position_gains, limits, dt_s
        )
        self.velocity_integral_m_s2 = (demand.ix, demand.iy, demand.iz)
        self.yaw_rate_setpoint_rad_s = yaw_rate if isfinite(yaw_rate) else 0.0
        self.attitude_setpoint, self.thrust_setpoint = attitude_from_thrust(demand.tx, demand.ty, demand.tz, yaw)
        self.position_setpoint = PositionSetpointEcho(
            (sp.x, sp.y, sp.z),
            (demand.vx, demand.vy, demand.vz),
            (demand.ax, demand.ay, demand.az),
            (demand.tx, demand.ty, demand.tz),
            yaw,
            self.yaw_rate_setpoint_rad_s,
        )

    def _estimate_hover_thrust(self, dt_s: float, estimate: VehicleEstimate, constraints: FlightConstraints) -> None:
        if constraints.landed:
            self._is_in_air = False
            self._ground_z_m = estimate.position_ned_m[2]
        elif not self._is_in_air:
            seen_m = estimate.height_above_bottom_m
            height_m = self._ground_z_m - estimate.position_ned_m[2] if seen_m is None else seen_m
            self._is_in_air = height_m > _IN_AIR_ABOVE_M
        if not (self._uses_estimator and self._is_in_air):
            return
        thrust_up = -self.position_setpoint.thrust_ned[2]
        self.hover_thrust_estimator.update(
            -estimate.acceleration_ned_m_s2[2], thrust_up, estimate.velocity_ned_m_s, dt_s
        )
        if self.hover_thrust_estimator.is_valid and constraints.is_flying:
            self._use_hover_thrust(self.hover_thrust_estimator.value, absorb=True)

    @property
    def known_hover_thrust(self) -> float | None:
        """The hover thrust estimate while it is valid and runs."""
        estimator = self.hover_thrust_estimator
        return estimator.value if self._uses_estimator and self._is_in_air and estimator.is_valid else None

    # Steady flight ------------------------------------------------------------------------------------------------

    def is_steady(self, setpoint: Setpoint | None, constraints: FlightConstraints) -> bool:
        """Nothing but the loops has a say: flying, off the ground, with a trajectory that can be flown."""
        if not isinstance(setpoint, TrajectorySetpoint) or self._last_velocity is None:
            return False
        if self.is_holding_invalid_setpoint or not self._is_in_air or not self._is_free(constraints):
            return False
        if self._flyable is None or self._flyable[0] is not setpoint:
            self._flyable = (setpoint, is_flyable(self._flat(setpoint), _ORIGIN))
        return self._flyable[1]

    def _is_free(self, c: FlightConstraints) -> bool:
        if not (c.armed and c.is_flying) or c.landed or c.maybe_landed or c.thrust_off:
            return False
        climb, descent, speed = c.climb_limit_m_s, c.descent_limit_m_s, c.speed_limit_m_s
        return climb != climb and descent != descent and speed != speed

    def motion_asked(self, setpoint: TrajectorySetpoint) -> Motion:
        """The setpoint as the position loop takes it."""
        return self._flat(setpoint)

    def loop_constants(self) -> LoopConstants:
        """What the parameters say, for the steady kernel."""
        return LoopConstants(
            self._rate_gains,
            self._attitude_gains,
            self._position_gains,
            self.hover_thrust_estimator.settings,
            self._uses_estimator,
            self._speed_xy,
            self._climb,
            self._descent,
            self._tilt_flying,
            self._thrust_min,
            self._thrust_max,
            self._land_speed,
            self._derivative_time_s,
        )

    def put_flat(self, k: Any) -> None:
        """Write the state where the steady kernel has it (places: steady_control.py)."""
        echo, last = self.position_setpoint, self._last_velocity or _ZERO
        values = (
            *self.rates_setpoint_frd_rad_s,
            *self.rate_state,
            *self._saturated,
            self.thrust_setpoint,
            *self.attitude_setpoint,
            self.yaw_rate_setpoint_rad_s,
            *self.velocity_integral_m_s2,
            self.hover_thrust,
            self.tilt_limit_rad,
            *last,
            *self._velocity_derivative,
            float(self._since_position_us),
            *self.motors,
            *self.torque_setpoint,
            *self.hover_thrust_estimator.state,
            *echo.velocity_ned_m_s,
            *echo.acceleration_ned_m_s2,
            *echo.thrust_ned,
            echo.yaw_rad,
        )
        for place, value in enumerate(values):
            k[place] = value

    def show_flat(self, k: list[float], asked: Asked) -> None:
        """Let the attributes say what the steady kernel's state says about setpoints."""
        self.rates_setpoint_frd_rad_s = (k[0], k[1], k[2])
        self.thrust_setpoint = k[10]
        self.attitude_setpoint = (k[11], k[12], k[13], k[14])
        sp = asked.motion
        self.position_setpoint = PositionSetpointEcho(
            (sp.x, sp.y, sp.z),
            (k[42], k[43], k[44]),
            (k[45], k[46], k[47]),
            (k[48], k[49], k[50]),
            k[51],
            k[15],
        )

    def take_flat(self, k: list[float], asked: Asked) -> None:
        """Take the whole state back from the steady kernel."""
        self.show_flat(k, asked)
        self.rate_state = RateState(k[3], k[4], k[5], k[6])
        self._saturated = (k[7], k[8], k[9])
        self.yaw_rate_setpoint_rad_s = k[15]
        self.velocity_integral_m_s2 = (k[16], k[17], k[18])
        self.hover_thrust, self.tilt_limit_rad = k[19], k[20]
        self._last_velocity, self._velocity_derivative = (k[21], k[22], k[23]), (k[24], k[25], k[26])
        self._since_position_us = round(k[27])
        self.motors = (k[28], k[29], k[30], k[31])
        self.torque_setpoint = (k[32], k[33], k[34])
        self.hover_thrust_estimator.state = HoverState(*k[35:42])
        self._invalid_for_s = 0.0

    def _use_hover_thrust(self, value: float, absorb: bool) -> None:
        """Change the hover thrust; when absorbing, the z integrator keeps the thrust where it is."""
        if absorb:
            x, y, z = self.velocity_integral_m_s2
            az = self.position_setpoint.acceleration_ned_m_s2[2]
            if isfinite(az):
                g = 9.80665
                z += (az - g) * self.hover_thrust / value + g - az
            self.velocity_integral_m_s2 = (x, y, z)
        self.hover_thrust = value
