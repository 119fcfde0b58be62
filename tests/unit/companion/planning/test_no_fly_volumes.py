"""A no-fly volume across the way is never flown through, whoever plans: round it, or refused with the reason."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import pytest

from companion.config import Planning
from companion.planning import PLANNERS, Cylinder, Limits, NoPlan, Obstacle, Plan, PlanRequest, Sphere
from companion.planning.obstacle import centre_at
from companion.planning.proof import prove

REFUSES = "four_point"
MAST = Cylinder((10.0, 0.2), 2.0)
REQUEST = PlanRequest(
    t_ns=0,
    position_m=(20.0, 0.0, -6.0),
    velocity_m_s=(0.0, 0.0, 0.0),
    acceleration_m_s2=(0.0, 0.0, 0.0),
    limits=Limits(relative_speed_m_s=4.0),
    goal_position_m=(0.0, 0.0, -5.0),
    obstacles=(MAST,),
)
PLANNING = Planning(corridor_half_width_m=6.0)


def asked(name: str, request: PlanRequest) -> Plan | NoPlan:
    if name == "corridor":
        pytest.importorskip("piqp")
    return PLANNERS[name](PLANNING).plan(request)


def nearest_in_radii(plan: Plan, request: PlanRequest, obstacle: Obstacle) -> float:
    duration_s, radii = plan.trajectory.duration_s, []
    for k in range(1001):
        t_s = duration_s * k / 1000
        position, _, _ = plan.trajectory.sample(t_s)
        centre = centre_at(obstacle, request.pad_velocity_m_s, t_s)
        axes = 3 if isinstance(obstacle, Sphere) else 2
        radii.append(math.dist(position[:axes], centre[:axes]) / obstacle.radius_m)
    return min(radii)


@pytest.mark.parametrize("name", sorted(PLANNERS))
@pytest.mark.parametrize("obstacle", [MAST, Sphere((10.0, 0.2, -5.5), 2.0)])
@pytest.mark.parametrize("pad_velocity", [(0.0, 0.0, 0.0), (1.5, 0.0, 0.0), (0.0, 0.4, 0.0)])
def test_a_volume_on_the_way_is_passed_beside_and_all_limits_hold(
    name: str, obstacle: Obstacle, pad_velocity: tuple[float, float, float]
) -> None:
    request = replace(REQUEST, obstacles=(obstacle,), pad_velocity_m_s=pad_velocity)
    result = asked(name, request)
    if isinstance(result, NoPlan):
        assert name == REFUSES
        assert "no-fly volume of 2.0 m radius" in result.reason
        return
    assert nearest_in_radii(result, request, obstacle) >= 1.0
    assert prove(result.trajectory, request, parts=16).holds
    start, end = result.trajectory.sample(0.0), result.trajectory.sample(result.trajectory.duration_s)
    assert start[0] == pytest.approx(request.position_m)
    assert end[0] == pytest.approx(request.goal_position_m, abs=1e-7)


@pytest.mark.parametrize("name", sorted(set(PLANNERS) - {REFUSES}))
def test_the_way_round_is_one_smooth_plan(name: str) -> None:
    result = asked(name, REQUEST)
    assert isinstance(result, Plan)
    assert all(b > a for a, b in pairwise(result.trajectory.breaks_s))
    for t in result.trajectory.breaks_s[1:-1]:
        before, after = result.trajectory.sample(t - 1e-9), result.trajectory.sample(t + 1e-9)
        for k in range(3):
            assert before[k] == pytest.approx(after[k], abs=1e-5)


@pytest.mark.parametrize(("east_m", "right"), [(0.2, False), (-0.2, True)])
def test_it_is_passed_on_the_side_on_which_the_way_would_pass_it(east_m: float, right: bool) -> None:
    mast = Cylinder((10.0, east_m), 2.0)
    result = asked("bspline", replace(REQUEST, obstacles=(mast,)))
    assert isinstance(result, Plan)
    beside = min((result.trajectory.sample(0.1 * k)[0] for k in range(200)), key=lambda p: abs(p[0] - 10.0))
    assert (beside[1] > east_m) is right


def test_a_volume_that_drifts_out_of_the_way_is_no_obstacle_but_one_that_drifts_in_is() -> None:
    """The pad moves east, so a volume that stands in W drifts west as seen from it."""
    moving = replace(REQUEST, pad_velocity_m_s=(0.0, 2.0, 0.0), obstacles=())
    plan = asked("bspline", moving)
    assert isinstance(plan, Plan)
    drifts_in = Cylinder((10.0, plan.trajectory.duration_s), 1.0)  # it is in the way after half the time
    result = asked("bspline", replace(moving, obstacles=(drifts_in,)))
    assert isinstance(result, Plan)
    assert result != plan
    assert nearest_in_radii(result, moving, drifts_in) >= 1.0
    assert asked("bspline", replace(moving, obstacles=(Cylinder((10.0, -1.5), 1.0),))) == plan


def test_two_masts_in_a_row_are_passed_or_refused() -> None:
    row = (Cylinder((7.0, 0.0), 1.0), Cylinder((13.0, 0.0), 1.0))
    result = asked("bspline", replace(REQUEST, obstacles=row))
    assert isinstance(result, NoPlan) or all(nearest_in_radii(result, REQUEST, mast) >= 1.0 for mast in row)


@pytest.mark.parametrize("name", sorted(PLANNERS))
def test_a_goal_inside_a_volume_is_refused_with_the_reason(name: str) -> None:
    result = asked(name, replace(REQUEST, obstacles=(Cylinder((0.0, 0.0), 1.5),)))
    assert isinstance(result, NoPlan)
    assert "no-fly volume" in result.reason
