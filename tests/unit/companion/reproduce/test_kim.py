"""The fisheye paper: places from bearings, and the speeds' times, against cases known by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

from companion.reproduce.kim import located, speed_delay_s
from companion.reproduce.watched_flight import preset


def test_the_target_is_found_and_located_from_high_up() -> None:
    found = located(preset("kim"), 5.0, 2)
    assert found.seen == found.asked == 2
    assert found.exact_m.max() < 0.05


def test_from_near_the_middle_of_the_disc_is_found_and_not_of_its_image() -> None:
    """Half a metre above a disc of one metre and 0.35 m aside, its image is an egg whose centroid is 0.1 m off."""
    found = located(preset("kim"), 0.5, 3)
    assert found.exact_m.max() < 0.01


def test_the_delay_of_a_speed_is_the_shift_between_the_two_curves() -> None:
    def speed(t_s: float) -> tuple[float, float, float]:
        return (math.sin(0.7 * t_s), 0.5 * math.cos(0.9 * t_s), 0.0)

    times = [0.05 * k for k in range(600)]
    watch = SimpleNamespace(
        instants=[SimpleNamespace(t_s=t, velocity_m_s=speed(t - 0.6)) for t in times],
        estimates=[(t, SimpleNamespace(velocity_ned_m_s=speed(t))) for t in times],
        entered_s=lambda phase: 0.0,
    )
    assert speed_delay_s(SimpleNamespace(watch=watch)) == pytest.approx(0.6, abs=0.05)  # type: ignore[arg-type]


def test_a_degree_of_tilt_moves_the_place_by_a_degree_of_the_height_or_more() -> None:
    found = located(preset("kim"), 8.0, 2)
    assert (abs(found.tilted_m) > 0.5 * 8.0 * math.radians(1.0)).all()
    assert found.tilted_m.mean() == pytest.approx(8.0 * math.radians(1.0), rel=0.6)
