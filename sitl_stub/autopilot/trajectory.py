"""Jerk-limited motion as PX4's automatic modes fly it: one axis of velocity smoothing, and a point that is drawn to a target.

The point's horizontal speed is the least of the cruise speed, MPC_XY_TRAJ_P times the distance, and what still allows braking; hence
the lag of 1 / MPC_XY_TRAJ_P (2 s) behind a moving target. The more the vehicle falls behind the
point, the slower the point's time runs; at MPC_XY_ERR_MAX it waits. NED, metres, seconds; used by the automatic flight task.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, sqrt


@dataclass(slots=True)
class SmoothedAxis:
    """Position, velocity and acceleration of one axis under limits of acceleration and jerk."""

    position_m: float = 0.0
    velocity_m_s: float = 0.0
    acceleration_m_s2: float = 0.0

    def advance(
        self, velocity_target_m_s: float, acceleration_max_m_s2: float, jerk_max_m_s3: float, dt_s: float
    ) -> None:
        """Move for dt towards the target velocity, arriving with zero acceleration."""
        jerk = self._jerk(velocity_target_m_s, acceleration_max_m_s2, jerk_max_m_s3, dt_s)
        acceleration = self.acceleration_m_s2 + jerk * dt_s
        velocity = self.velocity_m_s + 0.5 * (self.acceleration_m_s2 + acceleration) * dt_s
        self.position_m += 0.5 * (self.velocity_m_s + velocity) * dt_s
        self.acceleration_m_s2, self.velocity_m_s = acceleration, velocity

    def _jerk(self, target_m_s: float, acceleration_max: float, jerk_max: float, dt_s: float) -> float:
        a = self.acceleration_m_s2
        velocity_when_level = self.velocity_m_s + 0.5 * a * abs(a) / jerk_max
        error = target_m_s - velocity_when_level
        step = jerk_max * dt_s
        if abs(error) < step * dt_s + 1e-6 or (abs(target_m_s - self.velocity_m_s) < step * dt_s and abs(a) <= step):
            wanted = 0.0
        else:
            wanted = acceleration_max if error > 0.0 else -acceleration_max
            # The last step before the target must not overshoot into chattering.
            reachable = sqrt(2.0 * jerk_max * abs(target_m_s - self.velocity_m_s))
            wanted = max(-reachable, min(reachable, wanted))
        return max(-step, min(step, wanted - a)) / dt_s


def braking_speed_m_s(distance_m: float, acceleration_m_s2: float, jerk_m_s3: float) -> float:
    """Greatest speed from which a point stops within the distance under both limits."""
    b = 4.0 * acceleration_m_s2 * acceleration_m_s2 / jerk_m_s3
    return 0.5 * (-b + sqrt(b * b + 8.0 * acceleration_m_s2 * max(distance_m, 0.0)))


def braking_distance_m(speed_m_s: float, acceleration_m_s2: float, jerk_m_s3: float) -> float:
    """Way to a stop from a speed, with the time that building up the deceleration takes."""
    return speed_m_s * (speed_m_s / (2.0 * acceleration_m_s2) + acceleration_m_s2 / jerk_m_s3)


@dataclass(frozen=True, slots=True)
class SmoothingLimits:
    """Limits of the smoothed point, from PX4's parameters."""

    cruise_m_s: float
    climb_m_s: float
    descent_m_s: float
    acceleration_xy_m_s2: float
    acceleration_up_m_s2: float
    acceleration_down_m_s2: float
    jerk_m_s3: float
    gain_xy: float
    error_max_m: float


class SmoothedPoint:
    """The point the vehicle follows in an automatic mode."""

    def __init__(self) -> None:
        self.x, self.y, self.z = SmoothedAxis(), SmoothedAxis(), SmoothedAxis()

    @property
    def _axes(self) -> tuple[SmoothedAxis, SmoothedAxis, SmoothedAxis]:
        return self.x, self.y, self.z

    def start(self, position_m: tuple[float, float, float], velocity_m_s: tuple[float, float, float]) -> None:
        """Begin at the vehicle."""
        for axis, position, velocity in zip(self._axes, position_m, velocity_m_s, strict=True):
            axis.position_m, axis.velocity_m_s, axis.acceleration_m_s2 = position, velocity, 0.0

    def shift(self, delta_m: tuple[float, float, float]) -> None:
        """Follow a jump of the position estimate."""
        for axis, delta in zip(self._axes, delta_m, strict=True):
            axis.position_m += delta

    def advance(
        self,
        target_xy_m: tuple[float, float],
        target_z_m: float | None,
        descent_m_s: float | None,
        vehicle_m: tuple[float, float, float],
        limits: SmoothingLimits,
        dt_s: float,
    ) -> None:
        """Move the point for dt; the vertical axis goes to `target_z_m`, or sinks with `descent_m_s` when that is given."""
        dt_s *= self._time_stretch(vehicle_m, limits)
        if dt_s <= 0.0:
            return
        self._advance_xy(target_xy_m, limits, dt_s)
        if descent_m_s is not None:
            self._advance_z(descent_m_s, limits, dt_s)
        elif target_z_m is not None:
            self._advance_z(self._vertical_speed_m_s(target_z_m, limits), limits, dt_s)

    def _time_stretch(self, vehicle_m: tuple[float, float, float], limits: SmoothingLimits) -> float:
        """Slower time for the point when the vehicle is behind it, horizontally."""
        dx, dy = self.x.position_m - vehicle_m[0], self.y.position_m - vehicle_m[1]
        if dx * self.x.velocity_m_s + dy * self.y.velocity_m_s < 0.0:
            return 1.0
        return max(0.0, 1.0 - hypot(dx, dy) / limits.error_max_m)

    def _advance_xy(self, target_xy_m: tuple[float, float], limits: SmoothingLimits, dt_s: float) -> None:
        dx, dy = target_xy_m[0] - self.x.position_m, target_xy_m[1] - self.y.position_m
        distance = hypot(dx, dy)
        acceleration, jerk = limits.acceleration_xy_m_s2, limits.jerk_m_s3
        speed = min(
            limits.cruise_m_s,
            limits.gain_xy * distance,
            braking_speed_m_s(distance, limits.gain_xy * acceleration, jerk),
        )
        ux, uy = (dx / distance, dy / distance) if distance > 1e-6 else (0.0, 0.0)
        self.x.advance(speed * ux, acceleration, jerk, dt_s)
        self.y.advance(speed * uy, acceleration, jerk, dt_s)

    def _vertical_speed_m_s(self, target_z_m: float, limits: SmoothingLimits) -> float:
        distance = target_z_m - self.z.position_m
        down = distance > 0.0
        acceleration = limits.acceleration_down_m_s2 if down else limits.acceleration_up_m_s2
        speed = braking_speed_m_s(abs(distance), acceleration, limits.jerk_m_s3)
        return min(speed, limits.descent_m_s) if down else -min(speed, limits.climb_m_s)

    def _advance_z(self, velocity_m_s: float, limits: SmoothingLimits, dt_s: float) -> None:
        down = velocity_m_s > self.z.velocity_m_s
        acceleration = limits.acceleration_down_m_s2 if down else limits.acceleration_up_m_s2
        self.z.advance(velocity_m_s, acceleration, limits.jerk_m_s3, dt_s)
