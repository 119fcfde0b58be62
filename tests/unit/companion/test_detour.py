"""No-fly zones become cylinders around the pad that neither the vehicle nor its goal is inside of."""

from __future__ import annotations

import pytest

from companion.detour import MARGIN_M, cylinders
from companion.mission.zones import LocalZone

PAD = (100.0, 50.0, -1.0)
MAST = LocalZone("mast", ((80.0, 50.0),), 3.0)


def test_a_circle_is_seen_from_the_pad_with_a_margin() -> None:
    (seen,) = cylinders([MAST], vehicle_ned_m=(40.0, 50.0, -6.0), pad_ned_m=PAD, goal_m=(0.0, 0.0, -5.0))
    assert seen.centre_m == pytest.approx((-20.0, 0.0))
    assert seen.radius_m == pytest.approx(3.0 + MARGIN_M)
    assert seen.top_m is None


def test_a_polygon_is_taken_as_the_circle_round_it() -> None:
    yard = LocalZone("yard", ((76.0, 47.0), (84.0, 47.0), (84.0, 53.0), (76.0, 53.0)), None)
    (seen,) = cylinders([yard], vehicle_ned_m=(20.0, 50.0, -6.0), pad_ned_m=PAD, goal_m=(0.0, 0.0, -5.0))
    assert seen.centre_m == pytest.approx((-20.0, 0.0))
    assert seen.radius_m == pytest.approx(5.0 + MARGIN_M)


@pytest.mark.parametrize(("vehicle_north_m", "pad_north_m"), [(76.0, 100.0), (40.0, 84.0)])
def test_the_margin_gives_way_where_vehicle_or_goal_is_nearer(vehicle_north_m: float, pad_north_m: float) -> None:
    vehicle, pad = (vehicle_north_m, 50.0, -6.0), (pad_north_m, 50.0, -1.0)
    (seen,) = cylinders([MAST], vehicle_ned_m=vehicle, pad_ned_m=pad, goal_m=(0.0, 0.0, -5.0))
    assert 3.0 < seen.radius_m < 4.0


def test_a_zone_out_of_reach_is_left_out() -> None:
    far = LocalZone("far", ((900.0, 0.0),), 3.0)
    assert cylinders([far], vehicle_ned_m=(0.0, 0.0, -6.0), pad_ned_m=PAD, goal_m=(0.0, 0.0, -5.0)) == ()
