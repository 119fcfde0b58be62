"""Minimum snap against an independent dense solution and the `guo` comparison on the printed waypoints."""

from __future__ import annotations

import itertools
import json
import math
import os
import subprocess
import sys

import numpy as np
import pytest

from companion.planning import Limits, NoPlan, Plan, PlanRequest
from companion.planning.catmull_rom import catmull_rom_path
from companion.planning.min_snap import (
    MinSnapPlanner,
    SnapPath,
    distance_to_segment,
    durations_by_distance,
    improved_minimum_snap,
    minimum_snap,
    sample_segments,
    segment_deviations,
)
from companion.planning.trajectory import Trajectory, derivative, horner

WAYPOINTS = np.array([(10, 30, 0), (20, 70, 0), (60, 70, 0), (40, 30, 0), (90, 30, 0)], dtype=float)
TOTAL_S = 180.0


def deviation(trajectory: Trajectory, count: int = 4000) -> np.ndarray:
    """Distance from the nearest of the straight lines at equal times, m."""
    points = np.array([trajectory.sample(t)[0] for t in np.linspace(0.0, trajectory.duration_s, count + 1)])
    return np.min([distance_to_segment(points, a, b) for a, b in itertools.pairwise(WAYPOINTS)], axis=0)


def dense_solution(waypoints: np.ndarray, durations: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Coefficients (n, 8, 3), lowest power first, from conditions written out: values, C1 to C6 joints, end derivatives."""
    n = len(durations)
    rows, values = [], []

    def row(piece: int, t: float, order: int) -> np.ndarray:
        line = np.zeros(8 * n)
        for m in range(order, 8):
            line[8 * piece + m] = math.perm(m, order) * t ** (m - order)
        return line

    for i in range(n):
        rows += [row(i, 0.0, 0), row(i, durations[i], 0)]
        values += [waypoints[i], waypoints[i + 1]]
    for k in range(1, 4):
        rows += [row(0, 0.0, k), row(n - 1, durations[-1], k)]
        values += [start[k - 1], end[k - 1]]
    for i in range(n - 1):
        for k in range(1, 7):
            rows.append(row(i, durations[i], k) - row(i + 1, 0.0, k))
            values.append(np.zeros(3))
    return np.linalg.solve(np.array(rows), np.array(values)).reshape(n, 8, 3)


@pytest.mark.parametrize("n", [1, 2, 3, 8])
def test_the_closed_form_is_the_solution_of_the_conditions_written_out(n: int) -> None:
    rng = np.random.default_rng(n)
    waypoints, durations = rng.normal(size=(n + 1, 3)) * 5.0, rng.uniform(0.6, 1.8, n)
    start, end = rng.normal(size=(3, 3)), rng.normal(size=(3, 3))
    path = minimum_snap(waypoints, durations, start, end)
    expected = dense_solution(waypoints, durations, start, end)
    for i, piece in enumerate(path.trajectory().pieces):
        for axis in range(3):
            assert piece[axis][::-1] == pytest.approx(expected[i, :, axis], abs=1e-6)


def test_a_thousand_segments_are_six_times_smooth_at_the_joints() -> None:
    rng = np.random.default_rng(0)
    waypoints, durations = np.cumsum(rng.normal(size=(1001, 3)), axis=0), rng.uniform(0.5, 2.0, 1000)
    pieces = minimum_snap(waypoints, durations).trajectory().pieces
    for i in range(0, 999, 37):
        for order in range(4, 7):
            before = horner(derivative(pieces[i][0], order), float(durations[i]))
            after = horner(derivative(pieces[i + 1][0], order), 0.0)
            assert before == pytest.approx(after, rel=1e-5, abs=1e-4)


def test_plain_minimum_snap_swings_wide_on_the_printed_waypoints() -> None:
    path = minimum_snap(WAYPOINTS, durations_by_distance(WAYPOINTS, TOTAL_S))
    away = deviation(path.trajectory())
    assert away.mean() == pytest.approx(3.860, abs=0.01)
    assert away.std() == pytest.approx(5.412, abs=0.01)
    assert away.max() == pytest.approx(18.51, abs=0.01)
    assert path.cost == pytest.approx(5.034e-5, rel=1e-3)


@pytest.mark.parametrize(
    ("rule", "threshold", "mean", "std", "largest", "segments"),
    [
        ("all", 2.0, 0.378, 0.300, 1.09, 14),
        ("worst", 2.0, 0.564, 0.479, 1.93, 9),
        ("all", 1.0, 0.275, 0.256, 0.95, 22),
        ("all", 0.5, 0.124, 0.106, 0.45, 32),
    ],
)
def test_midpoints_keep_the_path_within_the_threshold(
    rule: str, threshold: float, mean: float, std: float, largest: float, segments: int
) -> None:
    path = improved_minimum_snap(WAYPOINTS, TOTAL_S, threshold, rounds=12, rule=rule)  # type: ignore[arg-type]
    away = deviation(path.trajectory())
    assert away.mean() == pytest.approx(mean, abs=0.002)
    assert away.std() == pytest.approx(std, abs=0.002)
    assert away.max() == pytest.approx(largest, abs=0.01)
    assert len(path.durations_s) == segments
    assert segment_deviations(path).max() <= threshold


def test_the_rounds_bound_the_number_of_midpoints() -> None:
    assert len(improved_minimum_snap(WAYPOINTS, TOTAL_S, 2.0, rounds=0).durations_s) == 4
    assert len(improved_minimum_snap(WAYPOINTS, TOTAL_S, 0.01, rounds=1).durations_s) == 8


@pytest.mark.parametrize("total_s", [20.0, 700.0, 1000.0])
def test_the_shape_from_rest_to_rest_does_not_depend_on_the_total_time(total_s: float) -> None:
    reference = sample_segments(minimum_snap(WAYPOINTS, durations_by_distance(WAYPOINTS, TOTAL_S)), 16)
    other = sample_segments(minimum_snap(WAYPOINTS, durations_by_distance(WAYPOINTS, total_s)), 16)
    assert np.abs(reference - other).max() < 1e-8


def test_the_order_of_the_methods_is_the_papers() -> None:
    durations = durations_by_distance(WAYPOINTS, TOTAL_S)
    plain = deviation(minimum_snap(WAYPOINTS, durations).trajectory()).mean()
    catmull_rom = deviation(catmull_rom_path(WAYPOINTS, durations)).mean()
    improved = deviation(improved_minimum_snap(WAYPOINTS, TOTAL_S, 2.0).trajectory()).mean()
    assert improved < catmull_rom < plain
    assert catmull_rom == pytest.approx(1.94, abs=0.01)
    assert deviation(catmull_rom_path(WAYPOINTS, durations)).max() == pytest.approx(5.0, abs=0.01)


def test_catmull_rom_passes_through_the_waypoints_along_the_neighbours_chord() -> None:
    durations = durations_by_distance(WAYPOINTS, TOTAL_S)
    path = catmull_rom_path(WAYPOINTS, durations)
    position, velocity, _ = path.sample(float(durations[0]))
    assert position == pytest.approx(WAYPOINTS[1], abs=1e-9)
    chord = WAYPOINTS[2] - WAYPOINTS[0]
    assert np.cross(velocity, chord) == pytest.approx(np.zeros(3), abs=1e-9)


@pytest.mark.parametrize(
    ("waypoints", "durations"),
    [(WAYPOINTS, np.ones(3)), (WAYPOINTS[:1], np.ones(0)), (WAYPOINTS, np.array([1.0, 1, 0, 1]))],
)
def test_impossible_inputs_are_refused(waypoints: np.ndarray, durations: np.ndarray) -> None:
    with pytest.raises(ValueError, match="minimum snap needs"):
        minimum_snap(waypoints, durations)


def test_coinciding_waypoints_are_refused() -> None:
    with pytest.raises(ValueError, match="coincide"):
        durations_by_distance(WAYPOINTS[[0, 1, 1]], 10.0)
    request = PlanRequest(
        t_ns=0,
        position_m=(0.0, 0.0, -3.0),
        velocity_m_s=(0.0, 0.0, 0.0),
        goal_position_m=(0.0, 0.0, -3.0),
        limits=Limits(),
    )
    result = MinSnapPlanner().plan(request)
    assert isinstance(result, NoPlan)
    assert "coincide" in result.reason


def test_the_planner_flies_through_the_waypoints_of_the_request() -> None:
    waypoints = ((-15.0, 8.0, -8.0), (-5.0, 8.0, -6.0))
    request = PlanRequest(
        t_ns=0,
        position_m=(-30.0, 0.0, -10.0),
        velocity_m_s=(0.5, 0.0, 0.0),
        goal_position_m=(-5.0, 0.0, -4.0),
        waypoints_m=waypoints,
        limits=Limits(),
    )
    plan = MinSnapPlanner().plan(request)
    assert isinstance(plan, Plan)
    points = np.array([plan.trajectory.sample(t)[0] for t in np.linspace(0.0, plan.trajectory.duration_s, 4000)])
    for waypoint in waypoints:
        assert np.linalg.norm(points - np.array(waypoint), axis=1).min() < 0.01


def test_the_snap_cost_is_the_integral_of_squared_snap() -> None:
    path: SnapPath = minimum_snap(WAYPOINTS, durations_by_distance(WAYPOINTS, 20.0))
    nodes, weights = np.polynomial.legendre.leggauss(8)
    total = 0.0
    for width, piece in zip(path.durations_s, path.trajectory().pieces, strict=True):
        for axis in piece:
            values = np.polyval(derivative(axis, 4), 0.5 * width * (nodes + 1.0))
            total += 0.5 * width * float((weights * values**2).sum())
    assert path.cost == pytest.approx(total, rel=1e-9)


SOLUTION = """
import json
import numpy as np
from companion.compiled import COMPILED
from companion.planning.min_snap import minimum_snap
rng = np.random.default_rng(9)
path = minimum_snap(rng.normal(size=(6, 3)), rng.uniform(0.5, 2.0, 5), rng.normal(size=(3, 3)), rng.normal(size=(3, 3)))
print(json.dumps([COMPILED, path.state.ravel().tolist()]))
"""


def test_compiled_and_plain_kernels_agree() -> None:
    pytest.importorskip("numba")
    plain, compiled = (
        json.loads(
            subprocess.run(
                [sys.executable, "-c", SOLUTION],
                capture_output=True,
                text=True,
                check=True,
                env={**os.environ, **extra},
            ).stdout
        )
        for extra in ({"NUMBA_DISABLE_JIT": "1"}, {})
    )
    assert (plain[0], compiled[0]) == (False, True)
    assert plain[1] == pytest.approx(compiled[1], rel=1e-11)
