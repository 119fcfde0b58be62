"""The follower: a reference that never steps, a planner that is asked again, heights that are kept."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import pytest

from companion.config import Planning
from companion.planning import PLANNERS
from companion.planning.follower import RAMP_AHEAD_M, FollowRequest, ReferenceFollower
from companion.planning.request import NoPlan, Plan, PlanRequest

STEP_NS = 20_000_000
ASKED = FollowRequest(
    t_ns=0,
    lead_s=0.3,
    style="plan",
    position_m=(-10.0, 2.0, -8.0),
    velocity_m_s=(0.0, 0.0, 0.0),
    goal_position_m=(0.0, 0.0, -5.0),
    goal_velocity_m_s=(0.0, 0.0, 0.0),
    pad_velocity_m_s=(1.5, 0.0, 0.0),
    pad_acceleration_m_s2=(0.0, 0.0, 0.0),
    max_descent_m_s=None,
)


@dataclass
class CountingPlanner:
    """The default planner, or refusals for as long as `refuse` says."""

    refuse: int = 0
    asked: list[PlanRequest] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._inner = PLANNERS["bspline"](Planning())

    def plan(self, request: PlanRequest) -> Plan | NoPlan:
        self.asked.append(request)
        if len(self.asked) <= self.refuse:
            return NoPlan("test", request.t_ns, "for the test")
        return self._inner.plan(request)


def at(tick: int, **changes: object) -> FollowRequest:
    return replace(ASKED, t_ns=tick * STEP_NS, **changes)  # type: ignore[arg-type]


def test_a_perfect_follower_is_planned_for_once_and_arrives() -> None:
    planner = CountingPlanner()
    follower = ReferenceFollower(planner, Planning())
    position = ASKED.position_m
    for tick in range(700):
        followed = follower.follow(at(tick, position_m=position))
        position = followed.now[0]
    assert len(planner.asked) == 1
    assert position == pytest.approx((0.0, 0.0, -5.0))


def test_a_refused_plan_is_asked_for_again_at_the_replanning_rate_while_the_old_reference_holds() -> None:
    planner = CountingPlanner()
    follower = ReferenceFollower(planner, Planning(replan_hz=10.0))
    first = follower.follow(at(0))
    planner.refuse = 5
    for tick in range(1, 60):
        followed = follower.follow(at(tick, position_m=first.now[0], goal_position_m=(0.0, 0.0, -3.0)))
    assert len(planner.asked) >= 6
    assert followed.plan is None or followed.plan.found
    assert planner.asked[-1].goal_position_m == (0.0, 0.0, -3.0)


def test_a_vehicle_that_has_left_its_reference_is_planned_for_from_where_it_is() -> None:
    planner = CountingPlanner()
    follower = ReferenceFollower(planner, Planning())
    follower.follow(at(0))
    follower.follow(at(1, position_m=(-13.0, 2.0, -8.0), velocity_m_s=(1.0, 0.0, 0.0)))
    assert planner.asked[-1].position_m == (-13.0, 2.0, -8.0)
    assert planner.asked[-1].velocity_m_s == (1.0, 0.0, 0.0)


def test_a_reference_that_has_sunk_ahead_of_the_vehicle_is_planned_anew_from_the_vehicle() -> None:
    planner = CountingPlanner()
    follower = ReferenceFollower(planner, Planning())
    follower.follow(at(0))
    held_up = {"position_m": (-10.0, 2.0, -8.3), "velocity_m_s": (0.0, 0.0, 1.5)}
    follower.follow(at(1, **held_up))
    assert len(planner.asked) == 1  # no more than control errors are
    held_up["position_m"] = (-10.0, 2.0, -8.5)
    followed = follower.follow(at(2, **held_up))
    assert planner.asked[-1].position_m == (-10.0, 2.0, -8.5)
    assert planner.asked[-1].velocity_m_s == (0.0, 0.0, 1.5)
    assert followed.now[0] == pytest.approx((-10.0, 2.0, -8.5))


def test_a_reference_above_the_vehicle_is_kept() -> None:
    planner = CountingPlanner()
    follower = ReferenceFollower(planner, Planning())
    follower.follow(at(0))
    follower.follow(at(1, position_m=(-10.0, 2.0, -7.3)))
    assert len(planner.asked) == 1


def test_level_keeps_the_height_at_which_it_was_first_asked_for() -> None:
    planner = CountingPlanner()
    follower = ReferenceFollower(planner, Planning())
    for tick in range(50):
        follower.follow(at(tick, style="level", position_m=(-0.5, 0.0, -4.0 + 0.004 * tick)))
    assert {request.goal_position_m for request in planner.asked} == {(0.0, 0.0, -4.0)}


def test_the_ramp_sinks_over_the_centre_and_does_not_run_away_below_a_vehicle_that_stands() -> None:
    follower = ReferenceFollower(CountingPlanner(), Planning())
    down = (0.0, 0.0, 0.5)
    standing = {"style": "ramp", "position_m": (0.1, 0.0, -0.22), "goal_velocity_m_s": down}
    for tick in range(200):
        followed = follower.follow(at(tick, **standing))
    assert followed.now[0] == pytest.approx((0.0, 0.0, -0.22 + RAMP_AHEAD_M))
    assert followed.now[1] == down
