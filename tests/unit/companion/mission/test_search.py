"""Searches stay where they are allowed, move at their speed, and see the whole area."""

from __future__ import annotations

import itertools
import math

import pytest

from companion.config import Mission
from companion.messages import Vec2
from companion.mission.search import PATTERNS
from companion.mission.search_area import SearchArea

DT_NS = 20_000_000


def walk(mission: Mission, seconds: float, *, drift: Vec2 = (0.0, 0.0), allowed: object = None) -> list[Vec2]:
    area = SearchArea(
        mission,
        t_ns=0,
        here_ned_m=(3.0, 0.0, -10.0),
        centre_ned_m=(0.0, 0.0, -10.0),
        drift_m_s=drift,
        allowed=allowed or (lambda point: True),  # type: ignore[arg-type]
    )
    return [area.step(step * DT_NS).position_ned_m[:2] for step in range(1, round(seconds / 0.02))]


@pytest.mark.parametrize("name", sorted(PATTERNS))
def test_a_pattern_begins_at_its_centre_and_stays_within_its_radius(name: str) -> None:
    corners = PATTERNS[name](8.0, 25.0)
    assert corners[0] == (0.0, 0.0)
    assert all(math.hypot(*corner) <= 25.0 + 1e-9 for corner in corners)


@pytest.mark.parametrize("name", sorted(PATTERNS))
def test_everything_well_inside_the_radius_comes_near_the_path(name: str) -> None:
    path = walk(Mission(search_pattern=name), 200.0)  # type: ignore[arg-type]
    for north in range(-12, 13, 4):
        for east in range(-12, 13, 4):
            assert min(math.dist((north, east), point) for point in path) < 8.0


@pytest.mark.parametrize("name", sorted(PATTERNS))
def test_the_point_never_jumps_further_than_its_speed_allows(name: str) -> None:
    path = walk(Mission(search_pattern=name, search_speed_m_s=3.0), 200.0)  # type: ignore[arg-type]
    steps = [math.dist(a, b) for a, b in itertools.pairwise(path)]
    assert max(steps) <= 3.0 * 0.02 + 1e-9


def test_the_way_to_the_centre_leads_by_the_waypoints_in_order() -> None:
    area = SearchArea(
        Mission(),
        t_ns=0,
        here_ned_m=(0.0, 0.0, -10.0),
        centre_ned_m=(20.0, 20.0, -10.0),
        drift_m_s=(0.0, 0.0),
        allowed=lambda point: True,
        by_ned_m=((20.0, 0.0), (30.0, 10.0)),
    )
    path = [area.step(step * DT_NS).position_ned_m[:2] for step in range(1, 1500)]
    passed = [min(range(len(path)), key=lambda k: math.dist(path[k], at)) for at in ((20.0, 0.0), (30.0, 10.0))]
    assert passed == sorted(passed)
    assert max(math.dist(path[k], at) for k, at in zip(passed, ((20.0, 0.0), (30.0, 10.0)), strict=True)) < 0.1
    assert math.dist(path[-1], (20.0, 20.0)) <= Mission().search_radius_m


@pytest.mark.parametrize("name", sorted(PATTERNS))
def test_what_is_not_allowed_is_never_entered_nor_crossed(name: str) -> None:
    def allowed(point: Vec2) -> bool:
        return math.dist(point, (12.0, 6.0)) > 5.0

    path = walk(Mission(search_pattern=name), 200.0, allowed=allowed)  # type: ignore[arg-type]
    assert all(allowed(point) for point in path)
    assert max(math.dist(path[-1], point) for point in path[-1000:]) > 3.0, "it goes on elsewhere"


def test_the_centre_drifts_with_the_pads_last_velocity_for_as_long_as_configured() -> None:
    still = walk(Mission(search_cone_s=10.0), 30.0)
    drifting = walk(Mission(search_cone_s=10.0), 30.0, drift=(2.0, 0.0))
    assert drifting[249][0] - still[249][0] == pytest.approx(10.0)
    assert drifting[-1][0] - still[-1][0] == pytest.approx(20.0)
