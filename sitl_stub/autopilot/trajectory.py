"""Jerk-limited motion as PX4's automatic modes fly it: one axis of velocity smoothing, and a point that is drawn to a target.

The point's horizontal speed is the least of the cruise speed and what still allows braking, which near the target is MPC_JERK_AUTO /
(2 MPC_ACC_HOR) times the distance; hence the lag of 1.5 s and more behind a moving target. The more the vehicle falls behind the
point, the slower the point's time runs; at MPC_XY_ERR_MAX it waits. NED, metres, seconds; used by the automatic flight task.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, sqrt
from typing import NamedTuple

_BRAKING_DELAY_S = 0.6


@dataclass(slots=True)
class SmoothedAxis:
    """Position, velocity and acceleration of one axis under limits of acceleration and jerk."""

    position_m: float = 0.0
    velocity_m_s: float = 0.0
    acceleration_m_s2: float = 0.0

    def advance(
        self, velocity_target_m_s: float, acceleration_max_m_s2: float, jerk_max_m_s3: float, dt_s: float
    ) -> None:
        """Move for dt towards the target velocity, arriving with zero acceleration; a target that moves slowly is followed exactly."""
        change, step = velocity_target_m_s - self.velocity_m_s, jerk_max_m_s3 * dt_s
        if abs(change) <= step * dt_s and abs(change / dt_s - self.acceleration_m_s2) <= step:
            self.position_m += 0.5 * (self.velocity_m_s + velocity_target_m_s) * dt_s
            self.acceleration_m_s2, self.velocity_m_s = change / dt_s, velocity_target_m_s
            return
        jerk = self._jerk(velocity_target_m_s, acceleration_max_m_s2, jerk_max_m_s3, dt_s)
        acceleration = self.acceleration_m_s2 + jerk * dt_s
        velocity = self.velocity_m_s + 0.5 * (self.acceleration_m_s2 + acceleration) * dt_s
        self.position_m += 0.5 * (self.velocity_m_s + velocity) * dt_s
        self.acceleration_m_s2, self.velocity_m_s = acceleration, velocity

    def duration_s(self, velocity_target_m_s: float, acceleration_max_m_s2: float, jerk_m_s3: float) -> float:
        """Least time to the target velocity."""
        change, a = self._towards(velocity_target_m_s, jerk_m_s3)
        peak = sqrt(max(jerk_m_s3 * change + 0.5 * a * a, 0.0))
        if peak <= acceleration_max_m_s2:
            return max(2.0 * peak - a, 0.0) / jerk_m_s3
        level = change + 0.5 * a * a / jerk_m_s3 - acceleration_max_m_s2**2 / jerk_m_s3
        return (2.0 * acceleration_max_m_s2 - a) / jerk_m_s3 + level / acceleration_max_m_s2

    def gentle_acceleration_m_s2(self, velocity_target_m_s: float, duration_s: float, jerk_m_s3: float) -> float:
        """Acceleration with which the target velocity is reached in just that (longer) time."""
        change, a = self._towards(velocity_target_m_s, jerk_m_s3)
        if a * (duration_s - 0.5 * a / jerk_m_s3) > change:
            return max(change - 0.5 * a * a / jerk_m_s3, 0.0) / max(duration_s - a / jerk_m_s3, 1e-6)
        b = jerk_m_s3 * duration_s + a
        return 0.5 * (b - sqrt(max(b * b - 4.0 * (jerk_m_s3 * change + 0.5 * a * a), 0.0)))

    def _towards(self, target_m_s: float, jerk_m_s3: float) -> tuple[float, float]:
        """Change of velocity asked for and present acceleration, positive where the acceleration has to go."""
        a, change = self.acceleration_m_s2, target_m_s - self.velocity_m_s
        return (change, a) if change > 0.5 * a * abs(a) / jerk_m_s3 else (-change, -a)

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


def braking_distance_m(speed_m_s: float, acceleration_m_s2: float) -> float:
    """Way to a stop from a speed, with the time that building up the deceleration takes."""
    return speed_m_s * (speed_m_s / (2.0 * acceleration_m_s2) + _BRAKING_DELAY_S)


@dataclass(frozen=True, slots=True)
class SmoothingLimits:
    """Limits of the smoothed point, from PX4's parameters."""

    cruise_m_s: float
    acceleration_xy_m_s2: float
    jerk_m_s3: float
    error_max_m: float


class VerticalLimits(NamedTuple):
    """Greatest vertical speed and acceleration, both ways; PX4 chooses them by the way it wants to go."""

    speed_m_s: float
    acceleration_m_s2: float


class SmoothedPoint:
    """The point the vehicle follows in an automatic mode."""

    def __init__(self) -> None:
        self.x, self.y, self.z = SmoothedAxis(), SmoothedAxis(), SmoothedAxis()
        self.wanted_vz_m_s = 0.0
        """Vertical speed before smoothing; its sign chooses the vertical limits of the next step."""

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
        target_z_m: float,
        descent_m_s: float | None,
        vehicle_m: tuple[float, float, float],
        limits: SmoothingLimits,
        vertical: VerticalLimits,
        dt_s: float,
    ) -> None:
        """Move the point for dt; the vertical axis goes to `target_z_m`, or sinks with `descent_m_s` when that is given."""
        wanted = self._vertical_speed_m_s(target_z_m, limits, vertical) if descent_m_s is None else descent_m_s
        self.wanted_vz_m_s = wanted
        dt_s *= self._time_stretch(vehicle_m, limits)
        if dt_s <= 0.0:
            return
        vx, vy = self._horizontal_velocity_m_s(target_xy_m, limits)
        vz = max(-vertical.speed_m_s, min(vertical.speed_m_s, wanted))
        horizontal, jerk = limits.acceleration_xy_m_s2, limits.jerk_m_s3
        plans = (
            (self.x, vx, horizontal, self.x.duration_s(vx, horizontal, jerk)),
            (self.y, vy, horizontal, self.y.duration_s(vy, horizontal, jerk)),
            (self.z, vz, vertical.acceleration_m_s2, self.z.duration_s(vz, vertical.acceleration_m_s2, jerk)),
        )
        longest_s = max(plan[3] for plan in plans)
        for axis, velocity, most, duration_s in plans:
            # All axes arrive together: the quicker ones take their time.
            if duration_s < longest_s:
                most = min(most, axis.gentle_acceleration_m_s2(velocity, longest_s, jerk))
            axis.advance(velocity, most, jerk, dt_s)

    def _time_stretch(self, vehicle_m: tuple[float, float, float], limits: SmoothingLimits) -> float:
        """Slower time for the point when the vehicle is behind it, horizontally."""
        dx, dy = self.x.position_m - vehicle_m[0], self.y.position_m - vehicle_m[1]
        if dx * self.x.velocity_m_s + dy * self.y.velocity_m_s < 0.0:
            return 1.0
        return max(0.0, 1.0 - hypot(dx, dy) / limits.error_max_m)

    def _horizontal_velocity_m_s(
        self, target_xy_m: tuple[float, float], limits: SmoothingLimits
    ) -> tuple[float, float]:
        dx, dy = target_xy_m[0] - self.x.position_m, target_xy_m[1] - self.y.position_m
        distance = hypot(dx, dy)
        if distance <= 1e-6:
            return 0.0, 0.0
        braking = braking_speed_m_s(distance, limits.acceleration_xy_m_s2, limits.jerk_m_s3)
        speed = min(limits.cruise_m_s, braking)
        return speed * dx / distance, speed * dy / distance

    def _vertical_speed_m_s(self, target_z_m: float, limits: SmoothingLimits, vertical: VerticalLimits) -> float:
        distance = target_z_m - self.z.position_m
        speed = braking_speed_m_s(abs(distance), vertical.acceleration_m_s2, limits.jerk_m_s3)
        speed = min(speed, vertical.speed_m_s)
        return speed if distance > 0.0 else -speed
