"""A pad on the ground or on a table: it does not move."""

from __future__ import annotations

import numpy as np

from sitl_stub.carriers.motion import Carrier, CarrierMotion
from sitl_stub.carriers.placement import PlacedPath
from sitl_stub.section import Section


class StillCarrierSettings(Section, frozen=True, tag_field="kind", tag="still"):
    """[carrier] kind = "still"."""

    def build(self, path: PlacedPath, deck_height_m: float, rng: np.random.Generator) -> Carrier:
        return StillCarrier(path, deck_height_m)


class StillCarrier:
    """Stands where its path begins."""

    def __init__(self, path: PlacedPath, deck_height_m: float) -> None:
        start = path.at(0.0)
        pose = (start.north_m, start.east_m, -deck_height_m, 0.0, 0.0, start.heading_rad)
        self._motion = CarrierMotion(pose, (0.0,) * 6)
        self._deck_height_m = deck_height_m

    def motion(self) -> CarrierMotion:
        return self._motion

    def advance(self) -> None:
        pass

    def highest_deck_m(self) -> float:
        return self._deck_height_m
