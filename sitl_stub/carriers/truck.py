"""A car or truck (Ackermann steering, the bicycle model): 0 to 20 m/s with limits on acceleration and steering.

The rear axle follows the path; the pad's centre lies `pad_ahead_of_rear_axle_m` in front of it, so that in a turn the pad
swings out. turn rate = speed tan(steering) / wheelbase.
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

_WOBBLE_TIME_S = 2.0
_PREVIEW_S = 0.8


class TruckSettings(Section, frozen=True, tag_field="kind", tag="truck"):
    """[carrier] kind = "truck"."""

    wheelbase_m: Positive = 2.8
    pad_ahead_of_rear_axle_m: float = 0.5
    max_speed_m_s: Positive = 20.0
    max_acceleration_m_s2: Positive = 2.5
    max_braking_m_s2: Positive = 5.0
    max_steering_deg: Positive = 35.0
    max_steering_rate_deg_s: Positive = 40.0
    speed_lag_s: Positive = 0.5
    speed_wobble_m_s: NonNegative = 0.05
    steering_wobble_deg: NonNegative = 0.05

    def build(self, path: PlacedPath, deck_height_m: float, rng: np.random.Generator) -> Carrier:
        return Truck(self, path, deck_height_m, rng)


class Truck:
    """Follows its path with its rear axle; starts so that the pad's centre is where the scenario wants it."""

    def __init__(
        self, settings: TruckSettings, path: PlacedPath, deck_height_m: float, rng: np.random.Generator
    ) -> None:
        self._settings = settings
        self._path = path
        self._deck_height_m = deck_height_m
        start = path.at(0.0)
        self._north_m, self._east_m, self._heading_rad = start.north_m, start.east_m, start.heading_rad
        # The scenario places the pad, the path leads the axle: the whole path lies this much behind.
        ahead = settings.pad_ahead_of_rear_axle_m
        self._back_north_m = -ahead * math.cos(start.heading_rad)
        self._back_east_m = -ahead * math.sin(start.heading_rad)
        self._speed_m_s = min(start.speed_m_s, settings.max_speed_m_s)
        self._steering_rad = math.atan(settings.wheelbase_m * start.curvature_1_m)
        draws = NormalDraws(rng)
        self._speed_wobble = Wobble(settings.speed_wobble_m_s, _WOBBLE_TIME_S, KNOT_S, draws)
        self._steering_wobble = Wobble(math.radians(settings.steering_wobble_deg), _WOBBLE_TIME_S, KNOT_S, draws)
        self._knot = 0

    def motion(self) -> CarrierMotion:
        v, h, ahead = self._speed_m_s, self._heading_rad, self._settings.pad_ahead_of_rear_axle_m
        c, s, w = math.cos(h), math.sin(h), self._turn_rad_s()
        north = self._north_m + self._back_north_m + ahead * c
        east = self._east_m + self._back_east_m + ahead * s
        rate = (v * c - w * ahead * s, v * s + w * ahead * c, 0.0, 0.0, 0.0, w)
        return CarrierMotion((north, east, -self._deck_height_m, 0.0, 0.0, h), rate)

    def _turn_rad_s(self) -> float:
        return self._speed_m_s * math.tan(self._steering_rad) / self._settings.wheelbase_m

    def advance(self) -> None:
        self._knot += 1
        v0, w0, h0 = self._speed_m_s, self._turn_rad_s(), self._heading_rad
        self._drive(self._knot * KNOT_S)
        turn = 0.5 * (w0 + self._turn_rad_s()) * KNOT_S
        way = 0.5 * (v0 + self._speed_m_s) * KNOT_S
        self._north_m += way * math.cos(h0 + 0.5 * turn)
        self._east_m += way * math.sin(h0 + 0.5 * turn)
        self._heading_rad = h0 + turn

    def _drive(self, t_s: float) -> None:
        s = self._settings
        reference = self._path.at(t_s)
        here = (self._north_m, self._east_m, self._heading_rad)
        settle_m = max(1.5 * s.wheelbase_m, _PREVIEW_S * self._speed_m_s)
        wanted_v, wanted_w = follow(reference, *here, lead_s=s.speed_lag_s, settle_m=settle_m)
        rolling = reference.speed_m_s > 0.0
        wanted_v += self._speed_wobble.advance() if rolling else 0.0
        self._speed_m_s = self._accelerated(min(wanted_v, s.max_speed_m_s))
        steering = math.atan(s.wheelbase_m * wanted_w / max(self._speed_m_s, 0.5))
        steering += self._steering_wobble.advance() if rolling else 0.0
        limit = math.radians(s.max_steering_deg)
        steering = min(max(steering, -limit), limit)
        self._steering_rad = slew(self._steering_rad, steering, math.radians(s.max_steering_rate_deg_s) * KNOT_S)

    def _accelerated(self, wanted_m_s: float) -> float:
        s, v = self._settings, self._speed_m_s
        lagged = v + (wanted_m_s - v) * KNOT_S / (s.speed_lag_s + KNOT_S)
        return min(max(lagged, v - s.max_braking_m_s2 * KNOT_S, 0.0), v + s.max_acceleration_m_s2 * KNOT_S)

    def highest_deck_m(self) -> float:
        return self._deck_height_m
