"""The four-point curve of the odometry-only paper."""

from __future__ import annotations

import numpy as np
import pytest

from companion.planning import Limits, NoPlan, Plan, PlanRequest
from companion.planning.bspline import basis_polynomials
from companion.planning.four_point import FourPointPlanner, control_points, four_point_trajectory

START, GOAL = (-8.0, 4.0, -3.0), (0.0, 0.0, -0.4)


def test_the_control_points_stand_where_the_paper_puts_them() -> None:
    assert control_points(START, GOAL, 0.4) == (
        START,
        (-6.0, 3.0, pytest.approx(-1.2)),
        (-2.0, 1.0, pytest.approx(-0.6)),
        GOAL,
    )


def test_the_curve_is_the_clamped_b_spline_by_cox_de_boor() -> None:
    points = control_points(START, GOAL, 0.4)
    basis = basis_polynomials(3, np.array([0.0] * 4 + [1.0] * 4), 3)
    path = four_point_trajectory(points, 5.0)
    for share in np.linspace(0.0, 1.0, 11):
        weights = [float(np.polynomial.polynomial.polyval(share, b)) for b in basis]
        assert path.sample(5.0 * share)[0] == pytest.approx(np.array(weights) @ np.array(points), abs=1e-12)


def test_the_derivative_has_the_degree_as_its_factor() -> None:
    points = control_points(START, GOAL, 0.4)
    _, velocity, _ = four_point_trajectory(points, 5.0).sample(0.0)
    assert velocity == pytest.approx(3.0 * (np.array(points[1]) - np.array(points[0])) / 5.0)


def test_the_speed_limit_sets_the_duration() -> None:
    request = PlanRequest(
        t_ns=0, position_m=START, velocity_m_s=(0.0, 0.0, 0.0), goal_position_m=GOAL, limits=Limits(max_speed_m_s=1.0)
    )
    plan = FourPointPlanner(0.4).plan(request)
    assert isinstance(plan, Plan)
    assert 0.9 < plan.proven.speed_m_s <= 1.0 + 1e-6
    impossible = FourPointPlanner(0.4).plan(
        PlanRequest(
            t_ns=3, position_m=START, velocity_m_s=(0.0,) * 3, limits=Limits(), pad_velocity_m_s=(13.0, 0.0, 0.0)
        )
    )
    assert isinstance(impossible, NoPlan)
    assert impossible.reason.startswith("speed")
