"""Did the vehicle come down in a zone in which Companion must not land? Judged by the simulator's truth, for the row of a flight.

Only zones in metres are watched (those in degrees hang on the autopilot's home). What counts is a vehicle that flew into the
zone while Companion's setpoints were flown: one that already stands on a pad that drives into the zone has landed before it.
"""

from __future__ import annotations

from collections.abc import Sequence

from companion.config import Zone
from companion.mission.zones import inside, place_zones
from sitl_stub.world import Truth

OFFBOARD = "OFFBOARD"


class NoLandWatch:
    """State: the lowest that was flown over what lies below, in the zones."""

    def __init__(self, zones: Sequence[Zone]) -> None:
        self._zones = place_zones(zones, None).no_land
        self._flies_in_it = False
        self.lowest_m: float | None = None
        """Least distance of the feet from deck or ground while flown in a zone, 0 for a touch; None: never in one."""

    def __bool__(self) -> bool:
        return bool(self._zones)

    def update(self, truth: Truth) -> None:
        """At each look, a few times a second."""
        north, east, down = truth.vehicle.position_ned_m
        if truth.mode != OFFBOARD or inside(self._zones, (north, east)) is None:
            self._flies_in_it = False
            return
        touching = truth.contact.is_touching
        self._flies_in_it = self._flies_in_it or not touching
        if self._flies_in_it:
            over_deck_m = truth.pad_position_ned_m[2] - down
            height_m = 0.0 if touching else max(0.0, min(truth.contact.gap_m, over_deck_m))
            self.lowest_m = height_m if self.lowest_m is None else min(self.lowest_m, height_m)
