"""What the vehicle may do, and what a plan is proven to do.

Limits hold for the sum of the reference and the pad's motion (W, NED), because that is what the vehicle flies. Bounds
come from convex hulls: every derivative of a spline lies in the hull of its control points, so a limit on a convex
function (a norm, a component) checked on control points holds everywhere. Used by all planners; filled from config.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from companion.config import Planning
from companion.messages import Vec3

GRAVITY_M_S2 = 9.80665
TOLERANCE = 1e-6
"""Relative slack against rounding: a state that sits on a limit is not beyond it."""


@dataclass(frozen=True, slots=True)
class Limits:
    """Upper bounds on the sum of reference and pad motion.

    `max_speed_m_s` is horizontal. Thrust is mass-specific: at most `thrust_to_weight` times gravity, upwards at least
    `min_thrust_to_weight` times gravity. `relative_speed_m_s` bounds the horizontal speed against the pad. `floor_m` is a
    height above the pad's surface that the plan never goes below (0 is the deck; None: no floor).
    """

    max_speed_m_s: float = 12.0
    max_climb_m_s: float = 2.5
    max_descent_m_s: float = 1.2
    max_acceleration_m_s2: float = 4.0
    max_jerk_m_s3: float = 20.0
    thrust_to_weight: float = 1.85
    min_thrust_to_weight: float = 0.3
    max_body_rate_rad_s: float = 3.5
    relative_speed_m_s: float = math.inf
    floor_m: float | None = 0.0


@dataclass(frozen=True, slots=True)
class ProvenBounds:
    """Upper (thrust_min: lower) bounds over a whole plan, of the sum with the pad's motion unless it says relative."""

    speed_m_s: float
    climb_m_s: float
    descent_m_s: float
    acceleration_m_s2: float
    jerk_m_s3: float
    thrust_max_m_s2: float
    thrust_min_m_s2: float
    body_rate_rad_s: float
    relative_speed_m_s: float


def limits_from_config(planning: Planning) -> Limits:
    """The limits a configuration asks for; the floor is the deck."""
    return Limits(
        max_speed_m_s=planning.max_speed_m_s,
        max_climb_m_s=planning.max_climb_m_s,
        max_descent_m_s=planning.max_descent_m_s,
        max_acceleration_m_s2=planning.max_acceleration_m_s2,
        max_jerk_m_s3=planning.max_jerk_m_s3,
        thrust_to_weight=planning.thrust_to_weight,
        min_thrust_to_weight=planning.min_thrust_to_weight,
        max_body_rate_rad_s=math.radians(planning.max_body_rate_deg_s),
        relative_speed_m_s=planning.relative_speed_m_s,
    )


Axes = tuple[Sequence[float], Sequence[float], Sequence[float]]
"""North, east, down components of a list of control points."""


def bounds_of_control_points(
    velocity: Axes, acceleration: Axes, jerk: Axes, pad_velocities: Sequence[Vec3], pad_acceleration: Vec3
) -> ProvenBounds:
    """Bounds from the control points of the derivative splines; the pad's velocity lies in the hull of `pad_velocities`."""
    speed2 = climb = descent = 0.0
    for px, py, pz in pad_velocities:
        speed2 = max(
            speed2, max([(x + px) ** 2 + (y + py) ** 2 for x, y in zip(velocity[0], velocity[1], strict=True)])
        )
        climb = max(climb, -min(velocity[2]) - pz)
        descent = max(descent, max(velocity[2]) + pz)
    relative2 = max([x * x + y * y for x, y in zip(velocity[0], velocity[1], strict=True)])
    acceleration2, thrust2, lift = _acceleration_bounds(acceleration, pad_acceleration)
    jerk_max = math.sqrt(max([x * x + y * y + z * z for x, y, z in zip(*jerk, strict=True)]))
    rate = jerk_max / lift if lift > 0.0 else math.inf
    return ProvenBounds(
        speed_m_s=math.sqrt(speed2),
        climb_m_s=climb,
        descent_m_s=descent,
        acceleration_m_s2=math.sqrt(acceleration2),
        jerk_m_s3=jerk_max,
        thrust_max_m_s2=math.sqrt(thrust2),
        thrust_min_m_s2=lift,
        body_rate_rad_s=rate,
        relative_speed_m_s=math.sqrt(relative2),
    )


def _acceleration_bounds(acceleration: Axes, pad_acceleration: Vec3) -> tuple[float, float, float]:
    """Largest squared acceleration and thrust, smallest upward thrust, for pad accelerations from zero to the given one."""
    largest = thrust = 0.0
    lift = math.inf
    for qx, qy, qz in {(0.0, 0.0, 0.0), pad_acceleration}:
        for x, y, z in zip(*acceleration, strict=True):
            horizontal = (x + qx) ** 2 + (y + qy) ** 2
            down = z + qz
            largest = max(largest, horizontal + down * down)
            thrust = max(thrust, horizontal + (down - GRAVITY_M_S2) ** 2)
            lift = min(lift, GRAVITY_M_S2 - down)
    return largest, thrust, lift


def excess(bounds: ProvenBounds, limits: Limits) -> tuple[float, str]:
    """How many times slower the plan has to be flown to hold the limits (1 or less: it holds them), and what binds."""
    found = bounds.speed_m_s / limits.max_speed_m_s, "speed", bounds.speed_m_s, limits.max_speed_m_s, "m/s"
    lift_limit = limits.min_thrust_to_weight * GRAVITY_M_S2
    thrust_limit = limits.thrust_to_weight * GRAVITY_M_S2
    for ratio, name, value, limit, unit in (
        (bounds.climb_m_s / limits.max_climb_m_s, "climb", bounds.climb_m_s, limits.max_climb_m_s, "m/s"),
        (bounds.descent_m_s / limits.max_descent_m_s, "descent", bounds.descent_m_s, limits.max_descent_m_s, "m/s"),
        (
            bounds.relative_speed_m_s / limits.relative_speed_m_s,
            "relative speed",
            bounds.relative_speed_m_s,
            limits.relative_speed_m_s,
            "m/s",
        ),
        (
            math.sqrt(bounds.acceleration_m_s2 / limits.max_acceleration_m_s2),
            "acceleration",
            bounds.acceleration_m_s2,
            limits.max_acceleration_m_s2,
            "m/s2",
        ),
        (math.cbrt(bounds.jerk_m_s3 / limits.max_jerk_m_s3), "jerk", bounds.jerk_m_s3, limits.max_jerk_m_s3, "m/s3"),
        (
            math.sqrt(max(bounds.thrust_max_m_s2 / thrust_limit, 0.0)),
            "thrust",
            bounds.thrust_max_m_s2,
            thrust_limit,
            "m/s2",
        ),
        (
            1.0 + (lift_limit - bounds.thrust_min_m_s2) / GRAVITY_M_S2,
            "least thrust",
            bounds.thrust_min_m_s2,
            lift_limit,
            "m/s2",
        ),
        (
            math.cbrt(min(bounds.body_rate_rad_s / limits.max_body_rate_rad_s, 1e9)),
            "body rate",
            bounds.body_rate_rad_s,
            limits.max_body_rate_rad_s,
            "rad/s",
        ),
    ):
        if ratio > found[0]:
            found = ratio, name, value, limit, unit
    ratio, name, value, limit, unit = found
    return ratio, f"{name} {value:.3g} {unit}, limit {limit:.3g}"


def hold(bounds: ProvenBounds, limits: Limits) -> bool:
    """True where the bounds are within the limits (up to rounding)."""
    return excess(bounds, limits)[0] <= 1.0 + TOLERANCE


def capped(bounds: ProvenBounds, limits: Limits) -> ProvenBounds:
    """The tighter of a bound and the limit, for plans that another test has proven to be within the limits."""
    return ProvenBounds(
        speed_m_s=min(bounds.speed_m_s, limits.max_speed_m_s),
        climb_m_s=min(bounds.climb_m_s, limits.max_climb_m_s),
        descent_m_s=min(bounds.descent_m_s, limits.max_descent_m_s),
        acceleration_m_s2=min(bounds.acceleration_m_s2, limits.max_acceleration_m_s2),
        jerk_m_s3=min(bounds.jerk_m_s3, limits.max_jerk_m_s3),
        thrust_max_m_s2=min(bounds.thrust_max_m_s2, limits.thrust_to_weight * GRAVITY_M_S2),
        thrust_min_m_s2=max(bounds.thrust_min_m_s2, limits.min_thrust_to_weight * GRAVITY_M_S2),
        body_rate_rad_s=min(bounds.body_rate_rad_s, limits.max_body_rate_rad_s),
        relative_speed_m_s=min(bounds.relative_speed_m_s, limits.relative_speed_m_s),
    )


def widest(a: ProvenBounds, b: ProvenBounds) -> ProvenBounds:
    """Bounds of two plans flown one after the other."""
    return ProvenBounds(
        speed_m_s=max(a.speed_m_s, b.speed_m_s),
        climb_m_s=max(a.climb_m_s, b.climb_m_s),
        descent_m_s=max(a.descent_m_s, b.descent_m_s),
        acceleration_m_s2=max(a.acceleration_m_s2, b.acceleration_m_s2),
        jerk_m_s3=max(a.jerk_m_s3, b.jerk_m_s3),
        thrust_max_m_s2=max(a.thrust_max_m_s2, b.thrust_max_m_s2),
        thrust_min_m_s2=min(a.thrust_min_m_s2, b.thrust_min_m_s2),
        body_rate_rad_s=max(a.body_rate_rad_s, b.body_rate_rad_s),
        relative_speed_m_s=max(a.relative_speed_m_s, b.relative_speed_m_s),
    )
