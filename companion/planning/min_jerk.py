"""Minimum-jerk fan: a closed form to many end times and approach directions, the cheapest that is proven wins.

The method of the `falanga` paper (after Mueller, Hehn, D'Andrea 2015): candidates end uniformly over a horizon in the
predicted state of the pad, those that break a limit are refused, the least integral of squared jerk is flown, and the
running plan is kept unless the end differs significantly. Here the batch is checked by a kernel (fan.py) that runs
compiled with the extra `fast`, plain without. Relative to the pad, NED, SI. The planner remembers its running plan.
"""

from __future__ import annotations

import math
from collections.abc import MutableSequence, Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np

from companion.compiled import COMPILED
from companion.config import Planning
from companion.geometry import norm, subtract
from companion.messages import Vec3
from companion.planning import fan
from companion.planning.limits import GRAVITY_M_S2, TOLERANCE, capped, excess
from companion.planning.proof import misses_volumes, pad_velocities, prove
from companion.planning.request import NoPlan, Plan, PlanRequest, least_duration_s
from companion.planning.trajectory import Trajectory, quintic

FAR = 2.3
"""The second horizon, in times of what the way takes at the speed limits: a quintic from rest to rest has 1.9 times its mean
speed in the middle."""
OBSTACLE_TRIES = 10
"""Where no-fly volumes stand in the way, this many of the cheapest candidates are tried against them."""


class MinJerkPlanner:
    """Best of `end_times` x `approaches` quintics."""

    def __init__(
        self,
        end_times: int = 40,
        approaches: int = 5,
        approach_speed_m_s: float = 0.2,
        horizon_s: float = 12.0,
        switch_distance_m: float = 0.1,
        duration_weight: float = 2.0,
    ) -> None:
        self._end_times = end_times
        self._end_velocities = approach_velocities(approaches, approach_speed_m_s)
        self._horizon_s = horizon_s
        self._switch_distance_m = switch_distance_m
        self._duration_weight = float(duration_weight)
        self._running: tuple[Plan, PlanRequest] | None = None
        count = end_times * approaches
        self._work, self._costs, self._verdicts = floats(fan.WORKSPACE), floats(count), integers(count)
        self._evaluate([], [0.0] * 9, [], floats_of([0.0] * 9), floats_of([0.0] * fan.LIMIT_COUNT), True)  # compiles

    @classmethod
    def from_config(cls, planning: Planning) -> MinJerkPlanner:
        return cls(
            end_times=planning.end_times,
            approaches=planning.approach_directions,
            approach_speed_m_s=planning.approach_speed_m_s,
            horizon_s=planning.horizon_s,
            switch_distance_m=planning.switch_distance_m,
            duration_weight=planning.duration_weight,
        )

    def plan(self, request: PlanRequest) -> Plan | NoPlan:
        """The running Plan while it still leads to the same end, else the best new one, or NoPlan with what refused most."""
        if self._running is not None and self._still_good(*self._running, request):
            return self._running[0]
        result = self._best(request)
        self._running = (result, request) if isinstance(result, Plan) else None
        return result

    def _best(self, request: PlanRequest) -> Plan | NoPlan:
        """Within the horizon; where that is too short for the way, within what the way takes."""
        horizon_s = min(self._horizon_s, request.max_duration_s)
        result = self._within(horizon_s, request)
        longest_s = min(FAR * least_duration_s(request), request.max_duration_s)
        if isinstance(result, Plan) or longest_s <= horizon_s:
            return result
        return self._within(longest_s, request)

    def _within(self, horizon_s: float, request: PlanRequest) -> Plan | NoPlan:
        durations = end_times(request.min_duration_s, horizon_s, self._end_times)
        candidates = [(t, v) for t in durations for v in self._end_velocities]
        ends = [value for _, v in candidates for value in _end_state(request, v)]
        start = [*request.position_m, *request.velocity_m_s, *request.acceleration_m_s2]
        durations_s = [t for t, _ in candidates]
        prune = not request.obstacles
        best = self._evaluate(durations_s, start, ends, pad_array(request), limit_array(request), prune)
        if best < 0:
            return NoPlan("min_jerk", request.t_ns, _refusals(self._verdicts, len(candidates)))
        for k in self._in_order(candidates) if request.obstacles else [best]:
            plan = _plan(request, candidates[k][0], ends[9 * k : 9 * k + 9], float(self._costs[k]))
            if misses_volumes(plan.trajectory, request):
                return plan
        return NoPlan("min_jerk", request.t_ns, "every candidate meets a no-fly volume")

    def _evaluate(
        self, durations_s: list[float], start: list[float], ends: list[float], pad: Any, limits: Any, prune: bool
    ) -> int:
        """The kernel on this planner's room for work; no candidates at construction, so that it compiles on the ground."""
        durations, first, last = floats_of(durations_s), floats_of(start), floats_of(ends)
        weight = self._duration_weight
        return fan.evaluate(durations, first, last, pad, limits, weight, prune, self._work, self._costs, self._verdicts)

    def _in_order(self, candidates: Sequence[tuple[float, Vec3]]) -> list[int]:
        accepted = [k for k in range(len(candidates)) if self._verdicts[k] == 0]
        accepted.sort(key=lambda k: self._costs[k] + self._duration_weight * candidates[k][0])
        stride = max(1, len(accepted) // OBSTACLE_TRIES)
        return accepted[::stride]

    def _still_good(self, plan: Plan, planned: PlanRequest, request: PlanRequest) -> bool:
        """The vehicle is on the plan, the end moved less than the switch distance, and the limits hold for today's pad."""
        elapsed = (request.t_ns - plan.trajectory.start_ns) * 1e-9
        left = plan.trajectory.duration_s - elapsed
        if not elapsed >= 0.0 or left < request.min_duration_s or _asks_something_else(planned, request):
            return False
        position, velocity, _ = plan.trajectory.sample(elapsed)
        drift = norm(subtract(position, request.position_m)) + left * norm(subtract(velocity, request.velocity_m_s))
        pad_change = norm(subtract(request.pad_velocity_m_s, planned.pad_velocity_m_s))
        moved = norm(subtract(request.goal_position_m, planned.goal_position_m)) + left * pad_change
        return drift + moved < self._switch_distance_m and _holds_for(plan, planned, request, pad_change)


def _asks_something_else(planned: PlanRequest, request: PlanRequest) -> bool:
    return (
        request.goal_velocity_m_s != planned.goal_velocity_m_s
        or request.cone != planned.cone
        or request.field_of_view != planned.field_of_view
        or bool(request.obstacles)
    )


def _holds_for(plan: Plan, planned: PlanRequest, request: PlanRequest, pad_change_m_s: float) -> bool:
    """The bounds proven then, widened by how much the pad's motion is now another."""
    preview = request.pad_preview_s * norm(subtract(request.pad_acceleration_m_s2, planned.pad_acceleration_m_s2))
    faster = pad_change_m_s + preview
    harder = norm(subtract(request.pad_acceleration_m_s2, planned.pad_acceleration_m_s2))
    then = plan.proven
    lift = then.thrust_min_m_s2 - harder
    now = replace(
        then,
        speed_m_s=then.speed_m_s + faster,
        climb_m_s=then.climb_m_s + faster,
        descent_m_s=then.descent_m_s + faster,
        acceleration_m_s2=then.acceleration_m_s2 + harder,
        thrust_max_m_s2=then.thrust_max_m_s2 + harder,
        thrust_min_m_s2=lift,
        body_rate_rad_s=then.jerk_m_s3 / lift if lift > 0.0 else math.inf,
    )
    return harder == 0.0 or (request.field_of_view is None and excess(now, request.limits)[0] <= 1.0 + TOLERANCE)


def approach_velocities(count: int, speed_m_s: float) -> list[Vec3]:
    """End velocities added to the goal's: none first, then `count - 1` directions evenly around."""
    around = [2.0 * math.pi * k / max(count - 1, 1) for k in range(count - 1)]
    return [(0.0, 0.0, 0.0), *((speed_m_s * math.cos(a), speed_m_s * math.sin(a), 0.0) for a in around)]


def end_times(shortest_s: float, longest_s: float, count: int) -> list[float]:
    """Uniform over the horizon, both ends included."""
    longest_s = max(longest_s, shortest_s)
    return [shortest_s + (longest_s - shortest_s) * k / max(count - 1, 1) for k in range(count)]


def limit_array(request: PlanRequest) -> Any:
    """The request's limits in the kernel's layout, with the same slack against rounding as everywhere."""
    limits, cone, view = request.limits, request.cone, request.field_of_view
    slack, squared = 1.0 + TOLERANCE, (1.0 + TOLERANCE) ** 2
    values = [0.0] * fan.LIMIT_COUNT
    values[fan.L_SPEED2] = squared * limits.max_speed_m_s**2
    values[fan.L_CLIMB] = slack * limits.max_climb_m_s
    values[fan.L_DESCENT] = slack * limits.max_descent_m_s
    values[fan.L_RELATIVE2] = squared * limits.relative_speed_m_s**2
    values[fan.L_ACCELERATION2] = squared * limits.max_acceleration_m_s2**2
    values[fan.L_JERK2] = squared * limits.max_jerk_m_s3**2
    values[fan.L_THRUST2] = squared * (limits.thrust_to_weight * GRAVITY_M_S2) ** 2
    values[fan.L_LIFT] = limits.min_thrust_to_weight * GRAVITY_M_S2 / slack
    values[fan.L_RATE2] = squared * limits.max_body_rate_rad_s**2
    values[fan.L_FLOOR_Z] = math.inf if limits.floor_m is None else TOLERANCE - limits.floor_m
    values[fan.L_VIEW_COSINE] = math.cos(view.half_angle_rad) if view else -1.0
    values[fan.L_VIEW_HEIGHT] = view.min_height_m if view else math.inf
    values[fan.L_CONE_RADIUS] = cone.radius_m + TOLERANCE if cone else -1.0
    values[fan.L_CONE_SLOPE] = cone.slope if cone else 0.0
    values[fan.L_CONE_TOP] = cone.top_m - TOLERANCE if cone else -math.inf
    values[fan.L_GRAVITY] = GRAVITY_M_S2
    return floats_of(values)


def pad_array(request: PlanRequest) -> Any:
    velocities = pad_velocities(request)
    return floats_of([*velocities[0], *velocities[-1], *request.pad_acceleration_m_s2])


def _end_state(request: PlanRequest, approach: Vec3) -> list[float]:
    vx, vy, vz = request.goal_velocity_m_s
    return [*request.goal_position_m, vx + approach[0], vy + approach[1], vz + approach[2], 0.0, 0.0, 0.0]


def _plan(request: PlanRequest, duration_s: float, end: Sequence[float], cost: float) -> Plan:
    p, v, a = request.position_m, request.velocity_m_s, request.acceleration_m_s2
    x, y, z = (quintic(duration_s, (p[i], v[i], a[i]), (end[i], end[3 + i], end[6 + i])) for i in range(3))
    trajectory = Trajectory(request.t_ns, (0.0, duration_s), ((x, y, z),))
    proven = capped(prove(trajectory, request).bounds, request.limits)
    return Plan("min_jerk", trajectory, proven, cost, (p, (end[0], end[1], end[2])))


def _refusals(verdicts: Sequence[int], count: int) -> str:
    """What refused how many candidates, most first."""
    counts = [(sum(1 for k in range(count) if verdicts[k] == code), name) for code, name in enumerate(fan.REASONS)]
    found = sorted(((n, name) for n, name in counts if n), key=lambda item: -item[0])
    return f"all {count} candidates refused: " + ", ".join(f"{name} {n}" for n, name in found)


def floats(count: int) -> MutableSequence[float]:
    """Room for floats: an array for compiled kernels, a list (faster by element) for plain ones."""
    return cast(MutableSequence[float], floats_of([0.0] * count))


def integers(count: int) -> MutableSequence[int]:
    room: Any = np.zeros(count, dtype=np.int64) if COMPILED else [0] * count
    return cast(MutableSequence[int], room)


def floats_of(values: list[float]) -> Any:
    return np.array(values, dtype=np.float64) if COMPILED else values
