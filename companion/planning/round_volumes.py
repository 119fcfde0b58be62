"""Any planner, led round no-fly volumes: where its own way meets one, two of its plans in a row by a place beside it.

The way without volumes says when and where it would be deepest in one. The place lies there, moved across the travel over the
ground until it is clear, and is passed with the velocity that the way had there. Both halves are plans of the wrapped planner,
each proven against every limit and every volume, which drifts with minus the pad's velocity. Relative to the pad, NED, SI.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

from companion.geometry import ZERO, add, horizontal_norm, subtract
from companion.messages import Vec3
from companion.planning.obstacle import Obstacle, centre_at, moved
from companion.planning.proof import misses_volumes
from companion.planning.request import NoPlan, Plan, Planner, PlanRequest, joined

WIDTHS = (1.25, 1.8)
"""How far from a volume's centre it is passed, in radii."""
SAMPLES = 60
"""Places of the direct way at which it is asked how deep it is in a volume; no proof, only where to pass."""
LONGEST = 2.5
"""A half takes at most this many times as long as the whole direct way."""
SLOW_M_S = 0.1
"""Below this speed over the ground the travel is the line of sight."""


@dataclass(frozen=True, slots=True)
class Meeting:
    """Where the direct way is deepest in a volume: seconds after the start, and its state there."""

    obstacle: Obstacle
    t_s: float
    position_m: Vec3
    velocity_m_s: Vec3


class RoundVolumes:
    """`planner` may have state of its own; this adds none."""

    def __init__(self, planner: Planner) -> None:
        self._planner = planner

    def plan(self, request: PlanRequest) -> Plan | NoPlan:
        """The direct way where it is clear, else the first way round that is; else what the planner itself finds, or why not."""
        if not request.obstacles:
            return self._planner.plan(request)
        direct = self._planner.plan(replace(request, obstacles=()))
        if isinstance(direct, NoPlan) or misses_volumes(direct.trajectory, request):
            return direct
        meeting = deepest(direct, request)
        longest_s = min(request.max_duration_s, LONGEST * direct.trajectory.duration_s)
        for across in _sideways(meeting, request):
            way = self._by(replace(request, max_duration_s=longest_s), meeting, across)
            if way is not None:
                return way
        return self._planner.plan(request)

    def _by(self, request: PlanRequest, meeting: Meeting, across: Vec3) -> Plan | None:
        """Two plans that pass the volume's centre at `across`; when the first gets there says where the centre is then."""
        first = self._planner.plan(_to(request, meeting, across, meeting.t_s))
        if isinstance(first, Plan) and request.pad_velocity_m_s != ZERO:
            first = self._planner.plan(_to(request, meeting, across, first.trajectory.duration_s))
        if isinstance(first, NoPlan) or not misses_volumes(first.trajectory, request):
            return None
        onwards = _onwards(request, first)
        second = self._planner.plan(replace(onwards, obstacles=()))
        if isinstance(second, NoPlan) or not misses_volumes(second.trajectory, onwards):
            return None
        return joined(first, second)


def _to(request: PlanRequest, meeting: Meeting, across: Vec3, arrival_s: float) -> PlanRequest:
    """To the place beside the volume where that is after `arrival_s`, and not sooner."""
    x, y, _ = centre_at(meeting.obstacle, request.pad_velocity_m_s, arrival_s)
    return replace(
        request,
        goal_position_m=(x + across[0], y + across[1], meeting.position_m[2]),
        goal_velocity_m_s=meeting.velocity_m_s,
        min_duration_s=max(request.min_duration_s, arrival_s),
        obstacles=(),
    )


def _onwards(request: PlanRequest, first: Plan) -> PlanRequest:
    """The rest of the way, from the end of the first half."""
    used_s = first.trajectory.duration_s
    position, velocity, acceleration = first.trajectory.sample(used_s)
    return replace(
        request,
        t_ns=first.trajectory.end_ns,
        position_m=position,
        velocity_m_s=velocity,
        acceleration_m_s2=acceleration,
        obstacles=tuple(moved(obstacle, request.pad_velocity_m_s, used_s) for obstacle in request.obstacles),
    )


def deepest(direct: Plan, request: PlanRequest) -> Meeting:
    """The time at which the way is nearest to a volume's axis, measured in its radii."""
    trajectory = direct.trajectory
    found, least = None, math.inf
    for k in range(1, SAMPLES):
        t_s = trajectory.duration_s * k / SAMPLES
        position, velocity, _ = trajectory.sample(t_s)
        for obstacle in request.obstacles:
            centre = centre_at(obstacle, request.pad_velocity_m_s, t_s)
            depth = math.dist(position[:2], centre[:2]) / obstacle.radius_m
            if depth < least:
                least, found = depth, Meeting(obstacle, t_s, position, velocity)
    assert found is not None, "asked only where there are volumes"
    return found


def _sideways(meeting: Meeting, request: PlanRequest) -> Iterator[Vec3]:
    """From the volume's centre to the place, across the travel over the ground: the side on which the way passes it first."""
    travel = add(meeting.velocity_m_s, request.pad_velocity_m_s)
    if horizontal_norm(travel) < SLOW_M_S:
        travel = subtract(request.goal_position_m, request.position_m)
    length = horizontal_norm(travel) or 1.0
    right = (-travel[1] / length, travel[0] / length)
    centre = centre_at(meeting.obstacle, request.pad_velocity_m_s, meeting.t_s)
    passes = right[0] * (meeting.position_m[0] - centre[0]) + right[1] * (meeting.position_m[1] - centre[1])
    for width in WIDTHS:
        for side in (1.0, -1.0) if passes >= 0.0 else (-1.0, 1.0):
            reach = side * width * meeting.obstacle.radius_m
            yield (reach * right[0], reach * right[1], 0.0)
