"""Coming down in a no-land zone is seen from the truth, and only what Companion itself flew counts."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from companion.campaign.no_land_watch import NoLandWatch
from companion.config import Zone
from sitl_stub.world import Truth

ZONES = (Zone(center_m=(50.0, 0.0), radius_m=10.0),)


def truth(north_m: float, height_m: float, mode: str = "OFFBOARD") -> Truth:
    """A deck half a metre high under the vehicle, whose feet are 0.2 m below its reference point."""
    fake: Any = SimpleNamespace(
        mode=mode,
        vehicle=SimpleNamespace(position_ned_m=(north_m, 0.0, -0.5 - height_m)),
        pad_position_ned_m=(north_m, 0.0, -0.5),
        contact=SimpleNamespace(is_touching=height_m <= 0.2, gap_m=height_m - 0.2),
    )
    return cast(Truth, fake)


@pytest.mark.parametrize(
    ("looks", "lowest_m"),
    [
        ([truth(30.0, 3.0), truth(35.0, 0.2)], None),
        ([truth(39.0, 3.0), truth(41.0, 2.0), truth(45.0, 5.0)], 1.8),
        ([truth(39.0, 3.0), truth(41.0, 2.0), truth(45.0, 0.2)], 0.0),
        ([truth(39.0, 0.2), truth(41.0, 0.2)], None),  # it stood on the pad before the pad drove in
        ([truth(41.0, 2.0, "AUTO_LAND"), truth(41.0, 0.2, "AUTO_LAND")], None),  # a pilot's or the autopilot's decision
    ],
)
def test_the_lowest_that_companion_flew_in_a_zone(looks: list[Truth], lowest_m: float | None) -> None:
    watch = NoLandWatch(ZONES)
    for look in looks:
        watch.update(look)
    assert watch.lowest_m == (None if lowest_m is None else pytest.approx(lowest_m))


def test_without_zones_there_is_nothing_to_watch() -> None:
    assert not NoLandWatch(())
    assert NoLandWatch(ZONES)
