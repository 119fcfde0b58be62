"""The fisheye paper: places from bearings, and the speeds' times, against cases known by hand."""

from __future__ import annotations

import math

import pytest

from companion.reproduce.kim import located
from companion.reproduce.watched_flight import preset


def test_the_target_is_found_and_located_from_high_up() -> None:
    found = located(preset("kim"), 5.0, 2)
    assert found.seen == found.asked == 2
    assert found.exact_m.max() < 0.05


def test_a_degree_of_tilt_moves_the_place_by_a_degree_of_the_height_or_more() -> None:
    found = located(preset("kim"), 8.0, 2)
    assert (abs(found.tilted_m) > 0.5 * 8.0 * math.radians(1.0)).all()
    assert found.tilted_m.mean() == pytest.approx(8.0 * math.radians(1.0), rel=0.6)
