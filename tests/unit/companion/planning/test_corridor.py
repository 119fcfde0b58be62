"""Minimum snap inside a corridor: the comparison's numbers, and the corridor itself."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("piqp")

import itertools

from companion.planning import Limits, NoPlan, Plan, PlanRequest
from companion.planning.corridor import (
    CorridorError,
    CorridorPlanner,
    across,
    boxed_minimum_snap,
    corridor_minimum_snap,
)
from companion.planning.min_snap import distance_to_segment, durations_by_distance, minimum_snap, sample_segments

WAYPOINTS = np.array([(10, 30, 0), (20, 70, 0), (60, 70, 0), (40, 30, 0), (90, 30, 0)], dtype=float)
DURATIONS = durations_by_distance(WAYPOINTS, 180.0)


def largest_offset(segments: np.ndarray, waypoints: np.ndarray) -> float:
    """Largest distance across its segment's line, in either of the two directions."""
    return max(
        float(np.abs((points - waypoints[i]) @ normal).max())
        for i, points in enumerate(segments)
        for normal in across(waypoints[i + 1] - waypoints[i])
    )


def test_through_the_waypoints_the_path_is_the_one_of_the_comparison() -> None:
    path = corridor_minimum_snap(WAYPOINTS, DURATIONS, 1.5)
    points = np.array([path.trajectory().sample(t)[0] for t in np.linspace(0.0, 180.0, 4001)])
    away = np.min([distance_to_segment(points, a, b) for a, b in itertools.pairwise(WAYPOINTS)], axis=0)
    assert away.mean() == pytest.approx(0.267, abs=0.001)
    assert away.std() == pytest.approx(0.206, abs=0.001)
    assert away.max() == pytest.approx(0.705, abs=0.002)
    assert path.cost == pytest.approx(2.95e-4, rel=0.01)


@pytest.mark.parametrize("half_width", [0.5, 1.5, 4.0])
@pytest.mark.parametrize("through", [True, False])
def test_the_path_stays_within_the_half_width_across_each_line(half_width: float, through: bool) -> None:
    path = corridor_minimum_snap(WAYPOINTS, DURATIONS, half_width, [through] * 5)
    assert largest_offset(sample_segments(path, 200), WAYPOINTS) <= half_width + 1e-5


def test_in_three_dimensions_both_directions_across_are_held() -> None:
    rng = np.random.default_rng(2)
    waypoints = np.cumsum(rng.uniform(4.0, 12.0, size=(5, 3)) * rng.choice([-1, 1], size=(5, 3)), axis=0)
    path = corridor_minimum_snap(waypoints, durations_by_distance(waypoints, 30.0), 1.0)
    assert largest_offset(sample_segments(path, 200), waypoints) <= 1.0 + 1e-5
    assert largest_offset(sample_segments(minimum_snap(waypoints, path.durations_s), 200), waypoints) > 1.0


def test_a_corridor_wide_enough_changes_nothing() -> None:
    path = corridor_minimum_snap(WAYPOINTS, DURATIONS, 1000.0)
    assert path.cost == pytest.approx(minimum_snap(WAYPOINTS, DURATIONS).cost, rel=1e-4)


def test_freeing_the_waypoints_costs_less_snap_and_still_meets_the_ends() -> None:
    free = corridor_minimum_snap(WAYPOINTS, DURATIONS, 1.5, [False] * 5)
    assert free.cost < corridor_minimum_snap(WAYPOINTS, DURATIONS, 1.5).cost
    assert free.state[0, 0] == pytest.approx(WAYPOINTS[0])
    assert free.state[-1, 0] == pytest.approx(WAYPOINTS[-1])


def test_a_start_that_leaves_the_corridor_at_once_is_refused() -> None:
    start = np.zeros((3, 3))
    start[0, 0] = 50.0
    with pytest.raises(CorridorError, match="the end states alone leave"):
        corridor_minimum_snap(WAYPOINTS, DURATIONS, 0.5, None, start)


def test_the_planner_says_so_where_no_path_keeps_within_the_corridor() -> None:
    request = PlanRequest(
        t_ns=0,
        position_m=(-20.0, 0.0, -8.0),
        velocity_m_s=(0.0, 3.0, 0.0),
        goal_position_m=(0.0, 0.0, -4.0),
        limits=Limits(),
    )
    result = CorridorPlanner(half_width_m=0.1).plan(request)
    assert isinstance(result, NoPlan)
    assert "leave the corridor of 0.10 m" in result.reason
    assert isinstance(CorridorPlanner(half_width_m=15.0).plan(request), Plan)


def test_boxes_are_kept_at_the_waypoints_and_cost_less_snap_than_meeting_them() -> None:
    waypoints = np.array([(0, 0, 0), (10, 1, 0), (20, 12, -3), (30, 10, 0)], dtype=float)
    durations = durations_by_distance(waypoints, 30.0)
    path = boxed_minimum_snap(waypoints, durations, 0.5)
    away = np.abs(path.state[:, 0] - waypoints)
    assert away.max() == pytest.approx(0.5, abs=1e-6)
    assert away[[0, -1]].max() == 0.0
    assert path.cost < minimum_snap(waypoints, durations).cost
    met = boxed_minimum_snap(waypoints, durations, 1e-6)
    assert np.allclose(met.state, minimum_snap(waypoints, durations).state, atol=1e-4)
