"""A rover with differential drive (unicycle): speed and turn rate follow their commands with a lag and limits.

The pad's centre is above the axle. Flat ground: the deck stays level.
"""

from __future__ import annotations

import math

import numpy as np

from sitl_stub.carriers.guidance import follow, slew
from sitl_stub.carriers.motion import KNOT_S, Carrier, CarrierMotion
from sitl_stub.carriers.placement import PlacedPath
from sitl_stub.carriers.wobble import Wobble
from sitl_stub.randomness import NormalDraws
from sitl_stub.section import NonNegative, Positive, Section

_WOBBLE_TIME_S = 1.5
_new = tuple.__new__


class RoverSettings(Section, frozen=True, tag_field="kind", tag="rover"):
    """[carrier] kind = "rover"."""

    speed_lag_s: Positive = 0.25
    turn_lag_s: Positive = 0.15
    max_acceleration_m_s2: Positive = 2.5
    max_turn_acceleration_rad_s2: Positive = 3.0
    speed_wobble_m_s: NonNegative = 0.02
    """Standard deviation of the unwanted part of the speed: uneven ground."""
    turn_wobble_rad_s: NonNegative = 0.01

    def build(self, path: PlacedPath, deck_height_m: float, rng: np.random.Generator) -> Carrier:
        return Rover(self, path, deck_height_m, rng)


class Rover:
    """Follows its path; starts on it, at the path's speed."""

    def __init__(
        self, settings: RoverSettings, path: PlacedPath, deck_height_m: float, rng: np.random.Generator
    ) -> None:
        self._settings = settings
        self._path = path
        self._deck_height_m = deck_height_m
        start = path.at(0.0)
        self._north_m, self._east_m, self._heading_rad = start.north_m, start.east_m, start.heading_rad
        self._speed_m_s = start.speed_m_s
        self._turn_rad_s = start.speed_m_s * start.curvature_1_m
        draws = NormalDraws(rng)
        self._speed_wobble = Wobble(settings.speed_wobble_m_s, _WOBBLE_TIME_S, KNOT_S, draws)
        self._turn_wobble = Wobble(settings.turn_wobble_rad_s, _WOBBLE_TIME_S, KNOT_S, draws)
        self._knot = 0

    def motion(self) -> CarrierMotion:
        v, h = self._speed_m_s, self._heading_rad
        pose = (self._north_m, self._east_m, -self._deck_height_m, 0.0, 0.0, h)
        return _new(CarrierMotion, (pose, (v * math.cos(h), v * math.sin(h), 0.0, 0.0, 0.0, self._turn_rad_s)))

    def advance(self) -> None:
        self._knot += 1
        v0, w0, h0 = self._speed_m_s, self._turn_rad_s, self._heading_rad
        self._steer()
        turn = 0.5 * (w0 + self._turn_rad_s) * KNOT_S
        way = 0.5 * (v0 + self._speed_m_s) * KNOT_S
        self._north_m += way * math.cos(h0 + 0.5 * turn)
        self._east_m += way * math.sin(h0 + 0.5 * turn)
        self._heading_rad = h0 + turn

    def _steer(self) -> None:
        s = self._settings
        reference = self._path.at(self._knot * KNOT_S)
        settle_m = 4.0 * s.turn_lag_s * self._speed_m_s
        settle_m = settle_m if settle_m > 1.5 else 1.5
        here = (self._north_m, self._east_m, self._heading_rad)
        wanted_v, wanted_w = follow(reference, *here, lead_s=s.speed_lag_s, settle_m=settle_m)
        # A rover that is told to stand has its brakes on: no wobble.
        if reference.speed_m_s > 0.0:
            wanted_v += self._speed_wobble.advance()
            wanted_w += self._turn_wobble.advance()
        v, w = self._speed_m_s, self._turn_rad_s
        lagged_v = v + (wanted_v - v) * KNOT_S / (s.speed_lag_s + KNOT_S)
        lagged_w = w + (wanted_w - w) * KNOT_S / (s.turn_lag_s + KNOT_S)
        self._speed_m_s = slew(v, lagged_v, s.max_acceleration_m_s2 * KNOT_S)
        self._turn_rad_s = slew(w, lagged_w, s.max_turn_acceleration_rad_s2 * KNOT_S)

    def highest_deck_m(self) -> float:
        return self._deck_height_m
