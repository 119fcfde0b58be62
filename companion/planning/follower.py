"""Keeps a plan current and says where the reference is now and a moment ahead.

A new plan starts from the running reference, so that the reference never steps; only when vehicle and reference have
parted (the estimate jumped, a gust) does it start from the vehicle itself. Relative to the pad, NED axes, SI.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, Protocol

from companion.config import Planning
from companion.geometry import ZERO, norm, subtract
from companion.messages import PlanMade, Vec3
from companion.planning.limits import limits_from_config
from companion.planning.obstacle import Obstacle
from companion.planning.request import NoPlan, Plan, Planner, PlanRequest, admitting_start, plan_made

RESTART_ERROR_M = 1.0
"""Further from its reference than this, the vehicle is not following: plan from where it is."""

BELOW_M = 0.4
"""Likewise where the reference has sunk so far ahead of the vehicle: over a deck that heaves it may ask for more than the
autopilot's speed down, and would brake at its end while the vehicle still comes at that speed."""

SETTLED_S = 1.0
"""A plan with less than this to go is flown to its end: replanning would push the end away for ever."""

PAD_CHANGED_M_S, PAD_CHANGED_M_S2 = 0.7, 1.0
"""The pad moves differently by this much from what the limits of the running plan were proven for: plan again."""

RAMP_AHEAD_M = 0.05
"""The ramp's reference runs at most this far below the vehicle, so that one that is slow at first does not meet the deck
faster for it, and one on the deck is not pushed ever harder."""

State = tuple[Vec3, Vec3, Vec3]
"""Position, velocity, acceleration."""


@dataclass(frozen=True, slots=True)
class FollowRequest:
    """`position_m`, `velocity_m_s`: vehicle minus pad now. The goal is relative to the pad as well.

    `pad_position_m` is the pad in W, `obstacles` are relative to it. Styles: `plan` to the goal; `level` to the goal's place at the height where it was first asked for; `ramp` straight down.
    """

    t_ns: int
    lead_s: float
    style: Literal["plan", "level", "ramp"]
    position_m: Vec3
    velocity_m_s: Vec3
    goal_position_m: Vec3
    goal_velocity_m_s: Vec3
    pad_velocity_m_s: Vec3
    pad_acceleration_m_s2: Vec3
    max_descent_m_s: float | None
    pad_position_m: Vec3 = ZERO
    obstacles: tuple[Obstacle, ...] = ()


@dataclass(frozen=True, slots=True)
class Followed:
    """Reference now and `lead_s` ahead; `plan` where a new one was made (or refused) at this call."""

    now: State
    ahead: State
    plan: PlanMade | None


class Follower(Protocol):
    """What the pipeline asks each tick."""

    def follow(self, request: FollowRequest) -> Followed:
        """The reference for this tick."""

    def to_go_s(self, t_ns: int) -> float | None:
        """Until the running plan ends, 0 after it; None without one."""

    def reset(self) -> None:
        """Forget the plan."""


class ReferenceFollower:
    """`planning.follower = "pad"`: the plan moves with the pad. State: the running plan and what it was made for."""

    def __init__(self, planner: Planner, config: Planning) -> None:
        self._planner = planner
        self._limits = limits_from_config(config)
        self._period_ns = round(1e9 / config.replan_hz)
        self._shortest_s = config.min_duration_s
        self._plan: Plan | None = None
        self._made_for: FollowRequest | None = None
        self._ramp_down_m: float | None = None
        self._level_down_m: float | None = None
        self._found = True
        self._last: tuple[int, State] | None = None

    def reset(self) -> None:
        self._plan, self._made_for, self._last = None, None, None
        self._ramp_down_m, self._level_down_m, self._found = None, None, True

    def to_go_s(self, t_ns: int) -> float | None:
        """Until the running plan ends, 0 after it; None without one."""
        return None if self._plan is None else max(0.0, (self._plan.trajectory.end_ns - t_ns) / 1e9)

    def follow(self, request: FollowRequest) -> Followed:
        """The reference for this tick."""
        if request.style == "ramp":
            followed = self._ramp(request)
        else:
            followed = self._planned(self._levelled(request))
        self._last = (request.t_ns, followed.now)
        return followed

    def _levelled(self, request: FollowRequest) -> FollowRequest:
        if request.style != "level":
            self._level_down_m = None
            return request
        if self._level_down_m is None:
            self._level_down_m = request.position_m[2] if self._last is None else self._last[1][0][2]
        north, east, _ = request.goal_position_m
        return replace(request, goal_position_m=(north, east, self._level_down_m))

    def _ramp(self, request: FollowRequest) -> Followed:
        """Straight down over the pad's centre."""
        dt_s = 0.0 if self._last is None else (request.t_ns - self._last[0]) / 1e9
        if self._ramp_down_m is None:
            self._ramp_down_m = request.position_m[2] if self._last is None else self._last[1][0][2]
        sink = request.goal_velocity_m_s[2]
        self._ramp_down_m = min(self._ramp_down_m + sink * dt_s, request.position_m[2] + RAMP_AHEAD_M)
        self._plan = None
        state = ((0.0, 0.0, self._ramp_down_m), request.goal_velocity_m_s, ZERO)
        return Followed(state, state, None)

    def _planned(self, request: FollowRequest) -> Followed:
        self._ramp_down_m = None
        made = self._replan(request) if self._is_due(request) else None
        if self._plan is None:
            state = self._hold(request)
            return Followed(state, state, made)
        trajectory = self._plan.trajectory
        ahead_ns = request.t_ns + round(request.lead_s * 1e9)
        return Followed(trajectory.sample_at(request.t_ns), trajectory.sample_at(ahead_ns), made)

    def _hold(self, request: FollowRequest) -> State:
        """Without a plan: stay where the reference was, or where the vehicle is."""
        position = request.position_m if self._last is None else self._last[1][0]
        if _is_apart(position, request):
            position = request.position_m
        return (position, ZERO, ZERO)

    def _is_due(self, request: FollowRequest) -> bool:
        made_for = self._made_for
        if made_for is None:
            return True
        rested = request.t_ns - made_for.t_ns >= self._period_ns
        if self._plan is None or not self._found:
            return rested
        if _differs(made_for.goal_position_m, request.goal_position_m) or _has_parted(self._plan, request):
            return True
        if made_for.max_descent_m_s != request.max_descent_m_s:
            return True
        to_go_s = (self._plan.trajectory.end_ns - request.t_ns) / 1e9
        return to_go_s > SETTLED_S and rested and _pad_changed(made_for, request)

    def _replan(self, request: FollowRequest) -> PlanMade:
        position, velocity, acceleration = self._start(request)
        limits = self._limits
        if request.max_descent_m_s is not None:
            limits = replace(limits, max_descent_m_s=min(limits.max_descent_m_s, request.max_descent_m_s))
        wanted = PlanRequest(
            t_ns=request.t_ns,
            position_m=position,
            velocity_m_s=velocity,
            acceleration_m_s2=acceleration,
            limits=limits,
            goal_position_m=request.goal_position_m,
            goal_velocity_m_s=request.goal_velocity_m_s,
            pad_velocity_m_s=request.pad_velocity_m_s,
            pad_acceleration_m_s2=request.pad_acceleration_m_s2,
            min_duration_s=self._shortest_s,
            obstacles=request.obstacles,
        )
        result = self._planner.plan(admitting_start(wanted))
        self._made_for = request
        self._found = not isinstance(result, NoPlan)
        if not isinstance(result, NoPlan):
            self._plan = result
        elif self._plan is not None and _has_parted(self._plan, request):
            self._plan = None
        return plan_made(result, request.t_ns)

    def _start(self, request: FollowRequest) -> State:
        """The running reference where the vehicle is near it, else the vehicle."""
        if self._plan is not None and not _has_parted(self._plan, request):
            return self._plan.trajectory.sample_at(request.t_ns)
        if self._last is not None and not _is_apart(self._last[1][0], request):
            return self._last[1]
        return (request.position_m, request.velocity_m_s, ZERO)


def _pad_changed(made_for: FollowRequest, request: FollowRequest) -> bool:
    velocity = norm(subtract(made_for.pad_velocity_m_s, request.pad_velocity_m_s))
    acceleration = norm(subtract(made_for.pad_acceleration_m_s2, request.pad_acceleration_m_s2))
    return velocity > PAD_CHANGED_M_S or acceleration > PAD_CHANGED_M_S2


def _has_parted(plan: Plan, request: FollowRequest) -> bool:
    return _is_apart(plan.trajectory.sample_at(request.t_ns)[0], request)


def _is_apart(reference_m: Vec3, request: FollowRequest) -> bool:
    away = subtract(reference_m, request.position_m)
    return norm(away) > RESTART_ERROR_M or away[2] > BELOW_M


def _differs(a: Vec3, b: Vec3) -> bool:
    return norm(subtract(a, b)) > 1e-3
