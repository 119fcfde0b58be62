"""The map projection against PX4's convention and against numbers that can be checked by hand."""

from __future__ import annotations

import math

import pytest

from companion.mavlink.geodesy import EARTH_RADIUS_M, GeoOrigin

ZURICH = GeoOrigin.from_degrees(47.3977418, 8.5455939, 489.0)


def test_the_origin_is_zero() -> None:
    assert ZURICH.ned_from_degrees(47.3977418, 8.5455939, 489.0) == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)


def test_a_degree_of_latitude_is_111_km_of_north() -> None:
    north, east, down = ZURICH.ned_from_degrees(48.3977418, 8.5455939, 489.0)
    assert north == pytest.approx(EARTH_RADIUS_M * math.pi / 180.0, rel=1e-9)
    assert (east, down) == pytest.approx((0.0, 0.0), abs=1e-6)


def test_a_little_longitude_is_east_times_the_cosine_of_latitude() -> None:
    _, east, _ = ZURICH.ned_from_degrees(47.3977418, 8.5465939, 489.0)
    assert east == pytest.approx(EARTH_RADIUS_M * math.radians(0.001) * math.cos(math.radians(47.3977418)), rel=1e-7)


def test_higher_is_negative_down() -> None:
    assert ZURICH.ned_from_degrees(47.3977418, 8.5455939, 499.5)[2] == pytest.approx(-10.5)


@pytest.mark.parametrize("north", [-20_000.0, -3.0, 0.0, 0.01, 500.0])
@pytest.mark.parametrize("east", [-5_000.0, 0.0, 0.02, 12_345.0])
@pytest.mark.parametrize("latitude", [-60.0, 0.0, 47.4])
def test_there_and_back_is_the_same_point(north: float, east: float, latitude: float) -> None:
    origin = GeoOrigin.from_degrees(latitude, 179.99, 100.0)
    back = origin.ned_from_degrees(*origin.degrees_from_ned((north, east, -7.0)))
    assert back == pytest.approx((north, east, -7.0), abs=1e-3)
