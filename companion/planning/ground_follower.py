"""Keeps a plan where it was made over the ground until the pad has moved further than a threshold (the `dalang` paper).

The plan leads to the place where the pad stood; the pad's velocity plays no part in it. When the plan has been flown to its
end and the pad has not gone further than the threshold, the reference is the pad itself, wherever it is now. Each new plan
starts from the vehicle. What is not a plan (levelling, the ramp down) is left to the follower that moves with the pad.
"""

from __future__ import annotations

import math
from dataclasses import replace

from companion.config import Planning
from companion.geometry import ZERO, add, subtract
from companion.messages import PlanMade, Vec3
from companion.planning.follower import Followed, FollowRequest, ReferenceFollower, State
from companion.planning.limits import limits_from_config
from companion.planning.request import NoPlan, Plan, Planner, PlanRequest, admitting_start, plan_made


class GroundFollower:
    """`planning.follower = "ground"`. State: the running plan, where the pad was then, and what it leads to."""

    def __init__(self, planner: Planner, config: Planning) -> None:
        self._planner = planner
        self._limits = limits_from_config(config)
        self._period_ns = round(1e9 / config.replan_hz)
        self._threshold_m = config.deviation_threshold_m
        self._shortest_s = config.min_duration_s
        self._with_the_pad = ReferenceFollower(planner, config)
        self._plan: Plan | None = None
        self._pad_then_m: Vec3 = ZERO
        self._asked: FollowRequest | None = None

    def reset(self) -> None:
        self._plan, self._asked = None, None
        self._with_the_pad.reset()

    def to_go_s(self, t_ns: int) -> float | None:
        """Until the running plan ends, 0 after it; None without one."""
        if self._plan is None:
            return self._with_the_pad.to_go_s(t_ns)
        return max(0.0, (self._plan.trajectory.end_ns - t_ns) / 1e9)

    def follow(self, request: FollowRequest) -> Followed:
        """The reference for this tick, relative to the pad as it is now."""
        if request.style != "plan":
            self._plan, self._asked = None, None
            return self._with_the_pad.follow(request)
        self._with_the_pad.reset()
        made = self._replan(request) if self._is_due(request) else None
        ahead_ns = request.t_ns + round(request.lead_s * 1e9)
        return Followed(self._state(request, request.t_ns), self._state(request, ahead_ns), made)

    def _state(self, request: FollowRequest, t_ns: int) -> State:
        if self._plan is None:
            return (request.position_m, ZERO, ZERO)
        if t_ns >= self._plan.trajectory.end_ns:
            return (request.goal_position_m, ZERO, ZERO)
        position, velocity, acceleration = self._plan.trajectory.sample_at(t_ns)
        moved = subtract(request.pad_position_m, self._pad_then_m)
        return (subtract(position, moved), subtract(velocity, request.pad_velocity_m_s), acceleration)

    def _is_due(self, request: FollowRequest) -> bool:
        asked = self._asked
        if asked is None:
            return True
        if self._plan is None:
            return request.t_ns - asked.t_ns >= self._period_ns
        if math.dist(asked.goal_position_m, request.goal_position_m) > 1e-3:
            return True
        return math.dist(request.pad_position_m[:2], self._pad_then_m[:2]) > self._threshold_m

    def _replan(self, request: FollowRequest) -> PlanMade:
        limits = self._limits
        if request.max_descent_m_s is not None:
            limits = replace(limits, max_descent_m_s=min(limits.max_descent_m_s, request.max_descent_m_s))
        wanted = PlanRequest(
            t_ns=request.t_ns,
            position_m=request.position_m,
            velocity_m_s=add(request.velocity_m_s, request.pad_velocity_m_s),
            limits=limits,
            goal_position_m=request.goal_position_m,
            min_duration_s=self._shortest_s,
            obstacles=request.obstacles,
        )
        result = self._planner.plan(admitting_start(wanted))
        self._asked = request
        self._plan = None if isinstance(result, NoPlan) else result
        self._pad_then_m = request.pad_position_m
        return plan_made(result, request.t_ns)
