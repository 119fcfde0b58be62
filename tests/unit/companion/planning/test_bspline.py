"""The default planner against SciPy's splines, its own bounds and geometry that gets in the way."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import BSpline

from companion.config import Planning
from companion.planning import (
    DescentCone,
    FieldOfView,
    Limits,
    NoPlan,
    Plan,
    PlanRequest,
    admitting_start,
    limits_from_config,
    plan_made,
)
from companion.planning.bspline import BSplinePlanner, shape_of
from companion.planning.proof import jerk_cost, prove

REQUEST = PlanRequest(
    t_ns=5_000_000_000,
    position_m=(-8.0, 2.0, -6.0),
    velocity_m_s=(1.0, 0.3, 0.2),
    acceleration_m_s2=(0.5, 0.0, 0.0),
    goal_position_m=(0.0, 0.0, -1.0),
    goal_velocity_m_s=(0.0, 0.0, 0.3),
    pad_velocity_m_s=(4.2, 0.0, 0.0),
    pad_acceleration_m_s2=(0.0, 1.0, 0.0),
    limits=limits_from_config(Planning()),
)
AT_REST = PlanRequest(
    t_ns=0,
    position_m=(-10.0, 0.0, -5.0),
    velocity_m_s=(0.0, 0.0, 0.0),
    goal_position_m=(0.0, 0.0, -5.0),
    limits=Limits(),
)


def planned(request: PlanRequest, degree: int = 3, count: int = 10) -> Plan:
    result = BSplinePlanner(degree, count).plan(request)
    assert isinstance(result, Plan), result
    return result


@pytest.mark.parametrize(("degree", "count"), [(3, 6), (3, 10), (4, 9), (5, 10), (5, 6), (7, 12), (7, 8)])
def test_the_pieces_are_the_b_spline_of_the_control_points(degree: int, count: int) -> None:
    plan = planned(REQUEST, degree, count)
    spans = count - degree
    duration = plan.trajectory.duration_s
    knots = np.concatenate([np.zeros(degree), np.linspace(0.0, duration, spans + 1), np.full(degree, duration)])
    spline = BSpline(knots, np.array(plan.control_points_m), degree)
    for t in np.linspace(0.0, duration, 50):
        position, velocity, acceleration = plan.trajectory.sample(t)
        assert position == pytest.approx(spline(t), abs=1e-9)
        assert velocity == pytest.approx(spline(t, 1), abs=1e-8)
        assert acceleration == pytest.approx(spline(t, 2), abs=1e-8)


@pytest.mark.parametrize("degree", [3, 4, 5, 7])
def test_start_and_end_states_are_met(degree: int) -> None:
    plan = planned(REQUEST, degree, degree + 7)
    start, end = plan.trajectory.sample(0.0), plan.trajectory.sample(plan.trajectory.duration_s)
    assert start[0] == pytest.approx(REQUEST.position_m, abs=1e-12)
    assert start[1] == pytest.approx(REQUEST.velocity_m_s, abs=1e-12)
    assert start[2] == pytest.approx(REQUEST.acceleration_m_s2, abs=1e-11)
    assert end[0] == pytest.approx(REQUEST.goal_position_m, abs=1e-12)
    assert end[1] == pytest.approx(REQUEST.goal_velocity_m_s, abs=1e-12)
    assert end[2] == pytest.approx((0.0, 0.0, 0.0), abs=1e-11)


def test_the_cost_is_the_integral_of_squared_jerk_and_no_other_free_points_have_less() -> None:
    plan = planned(REQUEST)
    assert plan.cost == pytest.approx(jerk_cost(plan.trajectory), rel=1e-9)
    shape = shape_of(3, 10)
    jerk_matrix = np.diff(np.eye(10), axis=0)
    for order in range(3):
        jerk_matrix = np.array(shape.factors[order])[:, None] * (
            jerk_matrix if order == 0 else np.diff(jerk_matrix, axis=0)
        )
    form = jerk_matrix.T @ np.array(shape.jerk_gram) @ jerk_matrix
    points = np.array(plan.control_points_m)
    gradient = (form @ points)[3:-3]
    assert np.abs(gradient).max() < 1e-9 * np.abs(form @ np.abs(points)).max()


@pytest.mark.parametrize(
    ("limits", "bound"),
    [
        (Limits(max_speed_m_s=2.0), "speed_m_s"),
        (Limits(max_acceleration_m_s2=0.5), "acceleration_m_s2"),
        (Limits(max_jerk_m_s3=0.5), "jerk_m_s3"),
        (Limits(max_body_rate_rad_s=0.05), "body_rate_rad_s"),
    ],
)
def test_the_duration_is_scaled_until_the_binding_limit_is_just_met(limits: Limits, bound: str) -> None:
    plan = planned(replace(AT_REST, limits=limits))
    limit = getattr(limits, "max_" + bound)
    assert 0.9 * limit <= getattr(plan.proven, bound) <= limit * (1.0 + 1e-5)


def test_the_pads_motion_counts_against_the_limits() -> None:
    alone = planned(replace(AT_REST, limits=Limits(max_speed_m_s=6.0)))
    with_pad = planned(replace(AT_REST, limits=Limits(max_speed_m_s=6.0), pad_velocity_m_s=(5.0, 0.0, 0.0)))
    assert with_pad.trajectory.duration_s > 1.5 * alone.trajectory.duration_s
    assert with_pad.proven.speed_m_s <= 6.0 * (1.0 + 1e-5)
    assert with_pad.proven.relative_speed_m_s <= 1.0 + 1e-5


def test_a_pad_faster_than_the_vehicle_is_refused_with_the_numbers() -> None:
    result = BSplinePlanner().plan(replace(AT_REST, pad_velocity_m_s=(13.0, 0.0, 0.0)))
    assert isinstance(result, NoPlan)
    assert "speed 13" in result.reason
    assert "limit 12" in result.reason


def test_a_start_beyond_the_limits_is_refused_unless_it_is_admitted() -> None:
    fast = replace(AT_REST, velocity_m_s=(13.0, 0.0, 0.0), position_m=(-60.0, 0.0, -5.0))
    assert isinstance(BSplinePlanner().plan(fast), NoPlan)
    plan = planned(admitting_start(fast))
    assert plan.proven.speed_m_s <= 13.0 + 0.02


def test_a_plan_never_goes_below_the_deck() -> None:
    sinking = replace(
        REQUEST, position_m=(-4.0, 0.0, -1.2), velocity_m_s=(0.0, 0.0, 0.9), goal_position_m=(0.0, 0.0, 0.0)
    )
    plan = planned(sinking)
    assert max(p[2] for p in plan.control_points_m) <= 1e-6


def test_the_descent_cone_is_entered_by_its_top() -> None:
    cone = DescentCone(radius_m=0.5, slope=0.3, top_m=4.0)
    request = replace(REQUEST, cone=cone, goal_position_m=(0.0, 0.0, -0.2))
    plan = planned(request)
    for t in np.linspace(0.0, plan.trajectory.duration_s, 500):
        (x, y, z), _, _ = plan.trajectory.sample(t)
        assert -z >= cone.top_m - 1e-6 or math.hypot(x, y) <= cone.radius_m - cone.slope * z + 1e-6
    assert prove(plan.trajectory, request, parts=8).holds


def test_a_start_beside_the_cone_is_refused() -> None:
    low = replace(REQUEST, position_m=(-8.0, 0.0, -2.0), cone=DescentCone(0.5, 0.3, 4.0))
    result = BSplinePlanner().plan(low)
    assert isinstance(result, NoPlan)
    assert result.reason == "starts beside the descent cone, below its top"


def test_a_pad_out_of_view_at_the_start_is_refused() -> None:
    result = BSplinePlanner().plan(replace(REQUEST, field_of_view=FieldOfView(0.5)))
    assert isinstance(result, NoPlan)
    assert result.reason == "the pad is not in view at the start"


@pytest.mark.parametrize(("degree", "count"), [(2, 8), (3, 5), (7, 7)])
def test_shapes_that_cannot_meet_both_end_states_are_refused(degree: int, count: int) -> None:
    with pytest.raises(ValueError, match="cannot meet both end states"):
        BSplinePlanner(degree, count)


def test_the_message_tells_what_was_planned_or_why_not() -> None:
    plan = planned(REQUEST)
    told = plan_made(plan, REQUEST.t_ns)
    assert told.found
    assert told.start_ns == REQUEST.t_ns
    assert told.end_ns == plan.trajectory.end_ns
    assert told.max_speed_m_s == plan.proven.speed_m_s
    refused = plan_made(NoPlan("bspline", 7, "because"), 7)
    assert (refused.found, refused.reason) == (False, "because")


def test_the_same_request_gives_the_same_plan() -> None:
    assert planned(REQUEST) == planned(REQUEST)
