"""Limits on what is sent: speed, climb and descent, change per second. Pure functions, NED, SI."""

from __future__ import annotations

import math

from companion.geometry import add, norm, scale, subtract
from companion.messages import Vec3


def limited_velocity(velocity: Vec3, *, max_speed_m_s: float, max_climb_m_s: float, max_descent_m_s: float) -> Vec3:
    """Horizontal length cut with its direction kept; vertical clipped (down is positive)."""
    speed = math.hypot(velocity[0], velocity[1])
    factor = 1.0 if speed <= max_speed_m_s else max_speed_m_s / speed
    return (velocity[0] * factor, velocity[1] * factor, max(-max_climb_m_s, min(max_descent_m_s, velocity[2])))


def slewed(previous: Vec3, wanted: Vec3, *, max_rate: float, dt_s: float) -> Vec3:
    """`wanted`, or as far towards it as `max_rate` (per second) allows."""
    step = subtract(wanted, previous)
    length = norm(step)
    allowed = max_rate * dt_s
    return wanted if length <= allowed else add(previous, scale(step, allowed / length))


def limited_length(vector: Vec3, limit: float) -> Vec3:
    """The vector, cut to `limit` with its direction kept."""
    length = norm(vector)
    return vector if length <= limit else scale(vector, limit / length)


def clipped(value: float, limit: float) -> float:
    """Between minus and plus `limit`."""
    return max(-limit, min(limit, value))
