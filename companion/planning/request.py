"""What a planner is asked and what it answers.

Everything is relative to the predicted pad: vehicle minus pad, in non-rotating NED axes (m, z down, so the height above
the pad is -z). The pad's own motion comes along because the vehicle flies the sum of both, and limits hold for the sum.
The pipeline makes a `PlanRequest`, a planner returns a `Plan` or a `NoPlan` that says why.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Protocol

from companion.geometry import ZERO, add, norm, scale, subtract
from companion.messages import PlanMade, Vec3
from companion.planning.limits import Limits, ProvenBounds, widest
from companion.planning.obstacle import Obstacle
from companion.planning.trajectory import Trajectory
from companion.planning.view import FieldOfView


@dataclass(frozen=True, slots=True)
class DescentCone:
    """Below `top_m` above the pad the vehicle stays within `radius_m + slope * height` of the pad's centre."""

    radius_m: float
    slope: float
    top_m: float


@dataclass(frozen=True, slots=True)
class PlanRequest:
    """From where to where, over which pad, within which limits.

    The pad's velocity is taken to stay between `pad_velocity_m_s` and that plus `pad_acceleration_m_s2 * pad_preview_s`,
    its acceleration between zero and `pad_acceleration_m_s2`: limits are proven for all of that range. Obstacles stand in
    W and are given relative to the pad at `t_ns`; seen from the pad they move with minus `pad_velocity_m_s`.
    `approach_direction` (unit, horizontal) is the travel direction of the pad for planners that arrive along it.
    """

    t_ns: int
    position_m: Vec3
    velocity_m_s: Vec3
    limits: Limits
    acceleration_m_s2: Vec3 = ZERO
    goal_position_m: Vec3 = ZERO
    goal_velocity_m_s: Vec3 = ZERO
    pad_velocity_m_s: Vec3 = ZERO
    pad_acceleration_m_s2: Vec3 = ZERO
    pad_preview_s: float = 0.5
    min_duration_s: float = 0.4
    max_duration_s: float = 30.0
    cone: DescentCone | None = None
    field_of_view: FieldOfView | None = None
    obstacles: tuple[Obstacle, ...] = ()
    waypoints_m: tuple[Vec3, ...] = ()
    approach_direction: Vec3 | None = None


@dataclass(frozen=True, slots=True)
class Plan:
    """A trajectory from the request's state to its goal, with what is proven about it.

    `proven` are upper bounds over the whole plan, not samples; `cost` is the integral of squared jerk, m2/s5.
    """

    method: str
    trajectory: Trajectory
    proven: ProvenBounds
    cost: float
    control_points_m: tuple[Vec3, ...] = ()


@dataclass(frozen=True, slots=True)
class NoPlan:
    """Nothing to offer, and why, with the numbers of the nearest attempt."""

    method: str
    t_ns: int
    reason: str


UNHURRIED = 3.0
"""A plan may take this many times as long as the way would at the speed limits: planners take about 2."""

START_MARGIN = 0.01
"""m/s over what a start takes: rounding."""


class Planner(Protocol):
    """One method. Deterministic: the same requests in the same order give the same plans."""

    def plan(self, request: PlanRequest) -> Plan | NoPlan: ...


def admitting_start(request: PlanRequest) -> PlanRequest:
    """The same request with each limit raised to what the start state itself already takes, and no further.

    A planner refuses a start beyond the limits, because no plan could hold them. A vehicle that is replanned many times a
    second is now and then a little beyond them and must get back inside, so the pipeline asks through this. The longest
    duration is raised to what a long way takes.
    """
    limits = request.limits
    vx, vy, vz = request.velocity_m_s
    ax, ay, az = request.acceleration_m_s2
    px, py, pz = request.pad_velocity_m_s
    acceleration = 1.1 * max(norm((ax, ay, az)), norm(add((ax, ay, az), request.pad_acceleration_m_s2)))
    preview = scale(request.pad_acceleration_m_s2, request.pad_preview_s)
    speed = max(math.hypot(vx + px, vy + py), math.hypot(vx + px + preview[0], vy + py + preview[1]))
    # What an acceleration still adds until the jerk limit has ended it.
    carried = norm((ax, ay, 0.0)) ** 2 / (2.0 * limits.max_jerk_m_s3)
    carried_z = az * abs(az) / (2.0 * limits.max_jerk_m_s3)
    climb = -(vz + pz + min(0.0, preview[2])) + max(0.0, -carried_z)
    descent = vz + pz + max(0.0, preview[2]) + max(0.0, carried_z)
    return replace(
        request,
        max_duration_s=max(request.max_duration_s, UNHURRIED * least_duration_s(request)),
        limits=replace(
            limits,
            max_speed_m_s=_admitting(limits.max_speed_m_s, speed + carried),
            max_climb_m_s=_admitting(limits.max_climb_m_s, climb),
            max_descent_m_s=_admitting(limits.max_descent_m_s, descent),
            relative_speed_m_s=_admitting(limits.relative_speed_m_s, math.hypot(vx, vy) + carried),
            max_acceleration_m_s2=max(limits.max_acceleration_m_s2, acceleration),
        ),
    )


def least_duration_s(request: PlanRequest) -> float:
    """No plan is shorter: the way at the speed limits all along."""
    limits, pad = request.limits, request.pad_velocity_m_s
    north, east, down = subtract(request.goal_position_m, request.position_m)
    vertical_limit = limits.max_descent_m_s if down > 0.0 else limits.max_climb_m_s
    return max(
        request.min_duration_s,
        math.hypot(north, east) / min(limits.relative_speed_m_s, limits.max_speed_m_s + math.hypot(pad[0], pad[1])),
        abs(down) / (vertical_limit + abs(pad[2])),
    )


def _admitting(limit: float, taken: float) -> float:
    """The limit, or what the start takes: with anything on top, each of many plans would be faster than the one before."""
    return max(limit, taken + START_MARGIN)


def joined(first: Plan, second: Plan) -> Plan:
    """One plan out of two that follow each other."""
    early, late = first.trajectory, second.trajectory
    breaks = early.breaks_s + tuple(early.duration_s + t for t in late.breaks_s[1:])
    return Plan(
        method=first.method,
        trajectory=Trajectory(early.start_ns, breaks, early.pieces + late.pieces),
        proven=widest(first.proven, second.proven),
        cost=first.cost + second.cost,
        control_points_m=first.control_points_m + second.control_points_m,
    )


def plan_made(result: Plan | NoPlan, t_ns: int) -> PlanMade:
    """The message that tells everybody else."""
    if isinstance(result, NoPlan):
        return PlanMade(t_ns, result.method, False, result.reason, t_ns, t_ns)
    return PlanMade(
        t_ns=t_ns,
        method=result.method,
        found=True,
        reason="",
        start_ns=result.trajectory.start_ns,
        end_ns=result.trajectory.end_ns,
        control_points_m=result.control_points_m,
        cost=result.cost,
        max_speed_m_s=result.proven.speed_m_s,
        max_acceleration_m_s2=result.proven.acceleration_m_s2,
    )
