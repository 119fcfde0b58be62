"""Zones: circles and polygons, in metres and in degrees."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mission_samples import STATUS

from companion.config import ConfigError, Zone, load_with
from companion.mission.zones import Zones, inside, place_zones

AT_HOME = replace(STATUS, home_position_ned_m=(5.0, -3.0, 0.0), home_position_deg=(47.4, 8.5))


@given(st.floats(-5.0, 25.0), st.floats(-5.0, 25.0))
def test_a_rectangle_holds_exactly_what_lies_between_its_sides(north: float, east: float) -> None:
    corners = ((0.0, 0.0), (10.0, 0.0), (10.0, 20.0), (0.0, 20.0))
    zones = place_zones([Zone(polygon_m=corners)], STATUS)
    on_the_border = north in (0.0, 10.0) or east in (0.0, 20.0)
    if not on_the_border:
        held = 0.0 < north < 10.0 and 0.0 < east < 20.0
        assert (inside(zones.no_land, (north, east)) is not None) == held


def test_a_notch_in_a_polygon_is_outside() -> None:
    corners = ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (5.0, 5.0), (0.0, 10.0))
    zones = place_zones([Zone(polygon_m=corners)], STATUS)
    assert inside(zones.no_land, (5.0, 4.0)) is not None
    assert inside(zones.no_land, (5.0, 8.0)) is None


def test_a_circle_has_its_name_and_its_kind() -> None:
    zones = place_zones([Zone(name="mast", kind="no_fly", center_m=(3.0, 4.0), radius_m=2.0)], STATUS)
    assert zones.no_land == ()
    assert inside(zones.no_fly, (3.0, 5.9)) == "mast"
    assert inside(zones.no_fly, (3.0, 6.1)) is None


def test_a_zone_in_degrees_lies_around_the_home() -> None:
    """A thousandth of a degree of latitude is 111.2 m; of longitude 75.3 m at 47.4 degrees north."""
    zones = place_zones([Zone(center_deg=(47.401, 8.501), radius_m=0.5)], AT_HOME)
    assert inside(zones.no_land, (5.0 + 111.19, -3.0 + 75.27)) is not None
    assert inside(zones.no_land, (5.0 + 111.19, -3.0 + 76.27)) is None


def test_a_zone_in_degrees_without_a_home_is_named_and_not_forgotten() -> None:
    zones = place_zones([Zone(name="lock", center_deg=(47.401, 8.501), radius_m=5.0)], STATUS)
    assert zones == Zones(unplaced=("lock",))


@pytest.mark.parametrize(
    "zone",
    [
        {},
        {"center_m": [0.0, 0.0]},
        {"radius_m": 3.0, "polygon_m": [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]},
        {"polygon_m": [[0.0, 0.0], [1.0, 0.0]]},
        {"center_m": [0.0, 0.0], "center_deg": [0.0, 0.0], "radius_m": 1.0},
    ],
    ids=str,
)
def test_a_zone_that_is_no_area_is_refused(zone: dict[str, object]) -> None:
    with pytest.raises(ConfigError, match="zone"):
        load_with([], {"safety.zones": [zone]})
