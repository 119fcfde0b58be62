"""The landing curve against the paper's four tables, and the planner made of it."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from companion.config import Planning
from companion.planning import Limits, Plan, PlanRequest, limits_from_config
from companion.planning.bezier import (
    BezierCurve,
    BezierPlanner,
    ParallelHeadings,
    arc_length,
    fallback_curve,
    landing_curve,
)

PAD = (0.0, 0.0, 0.0)
CASES = [
    # start, initial heading deg, ratio, P1, P2, P3, arc length m, largest curvature 1/m
    ((10.0, 10.0), -180, 0.5, (5, 10), (0, 10), (0, 5), 17.114, 0.2121),
    ((10.0, 10.0), -180, 0.1, (9, 10), (0, 10), (0, 9), 17.436, 0.2753),
    ((10.0, 10.0), -180, 0.3, (7, 10), (0, 10), (0, 7), 17.196, 0.2319),
    ((10.0, 10.0), -180, 0.7, (3, 10), (0, 10), (0, 3), 17.196, 0.2319),
    ((10.0, 10.0), -180, 0.9, (1, 10), (0, 10), (0, 1), 17.436, 0.2753),
    ((10.0, 15.0), -180, 0.5, (5, 15), (0, 15), (0, 7.5), 21.507, 0.1849),
    ((9.0, 13.0), -180, 0.5, (4.5, 13), (0, 13), (0, 6.5), 18.909, 0.2070),
    ((8.0, 11.0), -180, 0.5, (4, 11), (0, 11), (0, 5.5), 16.313, 0.2355),
    ((6.0, 10.0), -180, 0.5, (3, 10), (0, 10), (0, 5), 13.806, 0.3035),
    ((10.0, 10.0), -170, 0.5, (5, 9.12), (0, 8.24), (0, 4.12), 16.268, 0.1832),
    ((10.0, 10.0), -160, 0.5, (5, 8.18), (0, 6.36), (0, 3.18), 15.536, 0.1767),
    ((10.0, 10.0), -150, 0.5, (5, 7.11), (0, 4.23), (0, 2.11), 14.889, 0.2257),
]


def curve_of(start: tuple[float, float], heading_deg: float, ratio: float) -> BezierCurve:
    return landing_curve((*start, 0.0), math.radians(heading_deg), PAD, math.radians(-90.0), ratio)


@pytest.mark.parametrize(("start", "heading", "ratio", "p1", "p2", "p3", "length", "curvature"), CASES)
def test_control_points_length_and_curvature_are_the_papers(
    start: tuple[float, float],
    heading: float,
    ratio: float,
    p1: tuple[float, float],
    p2: tuple[float, float],
    p3: tuple[float, float],
    length: float,
    curvature: float,
) -> None:
    curve = curve_of(start, heading, ratio)
    for point, printed in zip(curve.points_m[1:4], (p1, p2, p3), strict=True):
        assert point[:2] == pytest.approx(printed, abs=0.0051)
    assert arc_length(curve, levels=11).total_m == pytest.approx(length, abs=6e-4)
    assert max(abs(curve.curvature(k / 2000)) for k in range(2001)) == pytest.approx(curvature, abs=6e-5)


@pytest.mark.parametrize(("start", "heading", "ratio"), [case[:3] for case in CASES])
def test_the_end_headings_are_met_and_the_end_curvatures_are_zero(
    start: tuple[float, float], heading: float, ratio: float
) -> None:
    curve = curve_of(start, heading, ratio)
    assert math.remainder(curve.heading(0.0) - math.radians(heading), 2 * math.pi) == pytest.approx(0.0, abs=1e-9)
    assert math.remainder(curve.heading(1.0) + math.pi / 2, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)
    assert abs(curve.curvature(0.0)) <= 1e-9
    assert abs(curve.curvature(1.0)) <= 1e-9


def test_the_even_ratio_has_the_lowest_peak_curvature_of_case_two() -> None:
    peaks = {
        a: max(abs(curve_of((10.0, 10.0), -180, a).curvature(k / 500)) for k in range(501))
        for a in (0.1, 0.3, 0.5, 0.7, 0.9)
    }
    assert min(peaks, key=peaks.__getitem__) == 0.5


def test_the_table_maps_distance_to_parameter_and_holds_at_the_ends() -> None:
    curve = curve_of((10.0, 10.0), -180, 0.5)
    table = arc_length(curve, levels=10)
    tau = table.parameter_at(5.0)
    travelled = sum(math.dist(curve.position(tau * k / 500), curve.position(tau * (k + 1) / 500)) for k in range(500))
    assert travelled == pytest.approx(5.0, abs=1e-4)
    assert table.parameter_at(-1.0) == 0.0
    assert table.parameter_at(table.total_m + 1.0) == 1.0


@pytest.mark.parametrize("heading_deg", [-90.0, 90.0])
def test_parallel_headings_are_refused_clearly(heading_deg: float) -> None:
    with pytest.raises(ParallelHeadings, match="parallel"):
        curve_of((10.0, 10.0), heading_deg, 0.5)


def test_a_meeting_point_behind_the_start_is_refused_clearly() -> None:
    with pytest.raises(ParallelHeadings, match="behind the start"):
        curve_of((10.0, 10.0), 0.0, 0.5)


@pytest.mark.parametrize("heading_deg", [-90.0, 90.0, 0.0, 37.0])
def test_the_fallback_meets_the_same_end_conditions(heading_deg: float) -> None:
    curve = fallback_curve((10.0, 10.0, -3.0), math.radians(heading_deg), PAD, math.radians(-90.0))
    assert curve.position(0.0) == (10.0, 10.0, -3.0)
    assert curve.position(1.0) == pytest.approx(PAD, abs=1e-12)
    assert curve.heading(0.0) == pytest.approx(math.radians(heading_deg), abs=1e-9)
    assert curve.heading(1.0) == pytest.approx(math.radians(-90.0), abs=1e-9)
    assert abs(curve.curvature(0.0)) <= 1e-9
    assert abs(curve.curvature(1.0)) <= 1e-9


def test_a_ratio_outside_its_range_is_refused() -> None:
    with pytest.raises(ValueError, match="not in"):
        curve_of((10.0, 10.0), -180, 0.0)


def test_the_planner_arrives_along_the_pads_travel() -> None:
    request = PlanRequest(
        t_ns=0,
        position_m=(-6.0, 5.0, -6.0),
        velocity_m_s=(1.0, 0.0, 0.0),
        goal_position_m=(0.0, 0.0, -2.0),
        approach_direction=(0.0, -1.0, 0.0),
        pad_velocity_m_s=(0.0, -3.0, 0.0),
        limits=Limits(),
    )
    plan = BezierPlanner.from_config(Planning()).plan(request)
    assert isinstance(plan, Plan)
    _, velocity, _ = plan.trajectory.sample(0.93 * plan.trajectory.duration_s)
    assert math.atan2(velocity[1], velocity[0]) == pytest.approx(-math.pi / 2, abs=0.15)


def test_the_planner_lands_where_headings_are_parallel() -> None:
    request = PlanRequest(
        t_ns=0,
        position_m=(-8.0, 3.0, -6.0),
        velocity_m_s=(1.0, 0.0, 0.0),
        approach_direction=(1.0, 0.0, 0.0),
        limits=limits_from_config(Planning()),
    )
    plan = BezierPlanner().plan(request)
    assert isinstance(plan, Plan)
    assert plan.trajectory.sample(plan.trajectory.duration_s)[0] == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


def test_given_headings_are_taken_where_the_velocities_say_none() -> None:
    planner = BezierPlanner(0.5, start_heading_rad=-math.pi, end_heading_rad=-math.pi / 2.0)
    still = PlanRequest(
        t_ns=0,
        position_m=(10.0, 10.0, -3.0),
        velocity_m_s=(0.0,) * 3,
        limits=Limits(),
        goal_position_m=(0.0, 0.0, -1.0),
    )
    plan = planner.plan(still)
    assert isinstance(plan, Plan)
    assert plan.control_points_m[2][:2] == pytest.approx((0.0, 10.0))
    drifting = planner.plan(replace(still, velocity_m_s=(-0.35, -0.35, 0.0)))
    assert isinstance(drifting, Plan)
    assert drifting.control_points_m[1][1] < 10.0
