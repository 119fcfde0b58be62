"""What may be in the picture, with numbers that a person can check."""

from __future__ import annotations

import math

import pytest

from companion.config import Camera
from companion.vision.field_of_view import half_field_rad, may_be_in_view
from companion.vision.lens import from_config


def test_the_half_field_is_the_angle_to_the_corner_of_the_picture() -> None:
    corner = math.atan(math.hypot(375.5, 239.5) / 420.0)
    assert half_field_rad(from_config(Camera())) == pytest.approx(corner, abs=1e-6)


@pytest.mark.parametrize(
    ("place", "spread_m", "seen"),
    [
        ((0.0, 0.0, 10.0), 1.0, True),
        ((30.0, 0.0, 9.5), 5.0, False),
        ((30.0, 0.0, 9.5), 20.0, True),
        ((0.0, 0.0, -10.0), 1.0, False),
        ((0.0, 0.0, -10.0), 11.0, True),
        ((11.0, 0.0, 10.0), 0.1, False),
        ((11.0, 0.0, 10.0), 1.0, True),
    ],
)
def test_a_pad_beside_the_cone_is_not_expected_unless_its_place_is_vague(
    place: tuple[float, float, float], spread_m: float, seen: bool
) -> None:
    assert may_be_in_view(place, spread_m, math.radians(46.0)) is seen
