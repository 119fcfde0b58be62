"""The follower that leaves a plan where it is over the ground."""

from __future__ import annotations

from dataclasses import replace

import pytest

from companion.config import Planning
from companion.planning import FOLLOWERS, PLANNERS, Cylinder
from companion.planning.follower import FollowRequest
from companion.planning.ground_follower import GroundFollower

STEP_NS = 20_000_000
CONFIG = Planning(planner="four_point", deviation_threshold_m=1.0, min_duration_s=4.0, relative_speed_m_s=5.0)
ABOVE = (0.0, 0.0, -0.5)
FIRST = FollowRequest(
    t_ns=0,
    lead_s=0.0,
    style="plan",
    position_m=(-4.0, 0.0, -2.0),
    velocity_m_s=(0.0, 0.0, 0.0),
    goal_position_m=ABOVE,
    goal_velocity_m_s=(0.0, 0.0, 0.0),
    pad_velocity_m_s=(0.2, 0.0, 0.0),
    pad_acceleration_m_s2=(0.0, 0.0, 0.0),
    max_descent_m_s=None,
    pad_position_m=(100.0, 0.0, 0.0),
)


def follower(config: Planning = CONFIG) -> GroundFollower:
    made = FOLLOWERS["ground"](PLANNERS[config.planner](config), config)
    assert isinstance(made, GroundFollower)
    return made


def later(t_s: float, pad_moved_m: float, **changes: object) -> FollowRequest:
    pad = (100.0 + pad_moved_m, 0.0, 0.0)
    return replace(FIRST, t_ns=round(t_s * 1e9), pad_position_m=pad, **changes)  # type: ignore[arg-type]


def test_the_plan_stays_over_the_ground_while_the_pad_drives_on() -> None:
    kept = follower()
    planned = kept.follow(FIRST)
    assert planned.plan is not None
    assert planned.plan.found
    still = kept.follow(later(2.0, 0.0)).now[0]
    moved = kept.follow(later(2.0, 0.4))
    assert moved.plan is None
    assert moved.now[0] == pytest.approx((still[0] - 0.4, still[1], still[2]))


def test_the_reference_moves_over_the_ground_with_the_plan_alone() -> None:
    kept = follower()
    kept.follow(FIRST)
    over_pad = kept.follow(later(2.0, 0.4)).now[1]
    ahead, behind = kept.follow(later(2.01, 0.4)).now[0], kept.follow(later(1.99, 0.4)).now[0]
    assert over_pad[0] + 0.2 == pytest.approx((ahead[0] - behind[0]) / 0.02, abs=1e-3)


def test_a_pad_that_has_gone_further_than_the_threshold_is_planned_for_again() -> None:
    kept = follower()
    kept.follow(FIRST)
    assert kept.follow(later(3.0, 0.99)).plan is None
    again = kept.follow(later(3.02, 1.01, position_m=(-2.0, 0.0, -1.0)))
    assert again.plan is not None
    assert again.now[0] == pytest.approx((-2.0, 0.0, -1.0))
    assert kept.to_go_s(round(3.02e9)) == pytest.approx(4.0)


def test_after_the_end_of_the_plan_the_reference_is_the_pad_itself() -> None:
    kept = follower()
    kept.follow(FIRST)
    assert kept.to_go_s(round(1e9)) == pytest.approx(3.0)
    ended = kept.follow(later(4.1, 0.8))
    assert kept.to_go_s(round(4.1e9)) == 0.0
    assert ended.now == (ABOVE, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def test_no_plan_is_shorter_than_the_shortest_asked_for() -> None:
    near = replace(FIRST, position_m=(-0.3, 0.0, -0.5))
    kept = follower()
    kept.follow(near)
    assert kept.to_go_s(0) == pytest.approx(4.0)


def test_the_way_down_is_left_to_the_follower_that_moves_with_the_pad() -> None:
    kept = follower()
    kept.follow(FIRST)
    down = replace(later(4.2, 0.8), style="ramp", goal_velocity_m_s=(0.0, 0.0, 0.5))
    reference = kept.follow(down).now
    assert reference[0][:2] == (0.0, 0.0)
    assert reference[1] == (0.0, 0.0, 0.5)
    assert kept.to_go_s(down.t_ns) is None


def test_a_no_fly_volume_in_the_way_is_no_way_for_it_either() -> None:
    planned = follower().follow(replace(FIRST, obstacles=(Cylinder((-2.0, 0.0), 1.0),)))
    assert planned.plan is not None
    assert not planned.plan.found
    assert "no-fly volume" in planned.plan.reason
