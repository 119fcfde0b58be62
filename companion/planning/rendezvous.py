"""Where and when a vehicle can be over a pad that moves, flying on its own speed and acceleration limits.

For the approach from tens of metres, before a relative plan makes sense: scan the predicted motion of the pad for the
first instant at which the vehicle can be there with the pad's velocity. W, NED, SI. The time needed to a point is that of
a straight flight with trapezoidal speed; sideways speed and height are changed meanwhile, and the slowest of the three
counts. It is an estimate to aim by, not a proven plan.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from companion.geometry import ZERO, add, norm, scale, subtract
from companion.messages import Vec3
from companion.planning.limits import Limits

STEP_S = 0.1
HALVINGS = 8


@dataclass(frozen=True, slots=True)
class Rendezvous:
    """The vehicle can be at `position_ned_m` (above the pad) in `duration_s`, and the pad then moves with the velocity."""

    duration_s: float
    position_ned_m: Vec3
    velocity_ned_m_s: Vec3


PadMotion = Callable[[float], tuple[Vec3, Vec3]]
"""Seconds from now to the pad's position (m) and velocity (m/s) in W."""


def constant_turn(position_ned_m: Vec3, velocity_ned_m_s: Vec3, yaw_rate_rad_s: float = 0.0) -> PadMotion:
    """The pad keeps its speed and its rate of turn (about z down, so positive is clockwise from above)."""

    def at(t_s: float) -> tuple[Vec3, Vec3]:
        vx, vy, vz = velocity_ned_m_s
        angle = yaw_rate_rad_s * t_s
        if abs(angle) < 1e-6:
            return add(position_ned_m, scale(velocity_ned_m_s, t_s)), velocity_ned_m_s
        s, c = math.sin(angle), math.cos(angle)
        dx = (vx * s - vy * (1.0 - c)) / yaw_rate_rad_s
        dy = (vx * (1.0 - c) + vy * s) / yaw_rate_rad_s
        turned = (vx * c - vy * s, vx * s + vy * c, vz)
        return add(position_ned_m, (dx, dy, vz * t_s)), turned

    return at


def rendezvous(
    position_ned_m: Vec3,
    velocity_ned_m_s: Vec3,
    pad: PadMotion,
    limits: Limits,
    height_m: float = 0.0,
    horizon_s: float = 60.0,
) -> Rendezvous | None:
    """The earliest meeting `height_m` above the pad, or None where the vehicle cannot catch it within the horizon."""

    def reachable(t_s: float) -> bool:
        there, moving = pad(t_s)
        if math.hypot(moving[0], moving[1]) > limits.max_speed_m_s:
            return False
        above = add(there, (0.0, 0.0, -height_m))
        return time_needed(position_ned_m, velocity_ned_m_s, above, moving, limits) <= t_s

    steps = math.ceil(horizon_s / STEP_S)
    first = next((k for k in range(steps + 1) if reachable(k * STEP_S)), None)
    if first is None:
        return None
    early, late = max(0, first - 1) * STEP_S, first * STEP_S
    for _ in range(HALVINGS):
        middle = 0.5 * (early + late)
        early, late = (early, middle) if reachable(middle) else (middle, late)
    there, moving = pad(late)
    return Rendezvous(late, add(there, (0.0, 0.0, -height_m)), moving)


def time_needed(start: Vec3, velocity: Vec3, end: Vec3, end_velocity: Vec3, limits: Limits) -> float:
    """Seconds from one state to another: along the horizontal line, across it, and in height, whichever is slowest."""
    way = (end[0] - start[0], end[1] - start[1], 0.0)
    length = norm(way)
    along = scale(way, 1.0 / length) if length > 1e-9 else ZERO
    change = subtract(end_velocity, velocity)
    u0 = velocity[0] * along[0] + velocity[1] * along[1]
    u1 = end_velocity[0] * along[0] + end_velocity[1] * along[1]
    sideways = math.hypot(change[0] - (u1 - u0) * along[0], change[1] - (u1 - u0) * along[1])
    down = end[2] - start[2]
    vertical = down / limits.max_descent_m_s if down > 0.0 else -down / limits.max_climb_m_s
    straight = trapezoid_time(length, u0, u1, limits.max_speed_m_s, limits.max_acceleration_m_s2)
    return max(straight, sideways / limits.max_acceleration_m_s2, vertical)


def trapezoid_time(
    distance_m: float, start_m_s: float, end_m_s: float, top_m_s: float, acceleration_m_s2: float
) -> float:
    """Least time along a line from one speed to another with bounded speed and acceleration; all signed."""
    a = acceleration_m_s2
    direct = 0.5 * (start_m_s + end_m_s) * abs(end_m_s - start_m_s) / a
    if distance_m < direct:  # the other way round: brake, come back
        distance_m, start_m_s, end_m_s = -distance_m, -start_m_s, -end_m_s
    top = max(top_m_s, abs(start_m_s), abs(end_m_s))
    squares = 0.5 * (start_m_s * start_m_s + end_m_s * end_m_s)
    peak = math.sqrt(max(a * distance_m + squares, 0.0))
    if peak <= top:
        return (2.0 * peak - start_m_s - end_m_s) / a
    cruise = (distance_m - (top * top - squares) / a) / top
    return (2.0 * top - start_m_s - end_m_s) / a + cruise
