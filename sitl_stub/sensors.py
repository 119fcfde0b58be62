"""The range sensor: distance along the vehicle's own downward axis to the deck or the ground.

A thin ray from the centre of gravity: no cone, no echo from edges. Between its samples it holds the last value, as the
autopilot's driver does.
"""

from __future__ import annotations

import math

import numpy as np

from sitl_stub.carriers.deck import DeckState
from sitl_stub.contact import DeckShape, Quaternion, Vec3

_NEVER = math.inf


def distance_down(position_ned_m: Vec3, q_ned_frd: Quaternion, deck: DeckState, shape: DeckShape) -> float:
    """Distance in m along B +z to what is first hit; infinite where the ray meets nothing (upside down)."""
    w, x, y, z = q_ned_frd
    # B +z in W: the third column of R_WB.
    ray = (2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y))
    on_deck = _deck_distance(position_ned_m, ray, deck, shape)
    if on_deck < _NEVER:
        return on_deck
    return -position_ned_m[2] / ray[2] if ray[2] > 1e-3 and position_ned_m[2] <= 0.0 else _NEVER


def _deck_distance(position: Vec3, ray: Vec3, deck: DeckState, shape: DeckShape) -> float:
    r, o = deck.rotation_ned_deck, deck.position_ned_m
    closing = r[2] * ray[0] + r[5] * ray[1] + r[8] * ray[2]
    dx, dy, dz = position[0] - o[0], position[1] - o[1], position[2] - o[2]
    above = -(r[2] * dx + r[5] * dy + r[8] * dz)
    if closing < 1e-3 or above < 0.0:
        return _NEVER
    distance = above / closing
    hit = (dx + distance * ray[0], dy + distance * ray[1], dz + distance * ray[2])
    x = r[0] * hit[0] + r[3] * hit[1] + r[6] * hit[2] - shape.center_x_m
    y = r[1] * hit[0] + r[4] * hit[1] + r[7] * hit[2] - shape.center_y_m
    inside = abs(x) <= 0.5 * shape.length_m and abs(y) <= 0.5 * shape.width_m
    return distance if inside else _NEVER


class RangeSensor:
    """Samples `distance_down` at a rate, with noise and limits; None outside them."""

    def __init__(
        self, *, rate_hz: float, min_m: float, max_m: float, noise_sigma_m: float, rng: np.random.Generator
    ) -> None:
        self.period_us = round(1e6 / rate_hz)
        self.is_stuck = False
        self.is_lost = False
        self.value_m: float | None = None
        self._min_m, self._max_m, self._noise_sigma_m = min_m, max_m, noise_sigma_m
        self._rng = rng

    def sample(self, true_m: float) -> None:
        noise = self._noise_sigma_m * float(self._rng.standard_normal())
        if self.is_stuck:
            return
        measured = true_m + noise
        in_range = self._min_m <= measured <= self._max_m
        self.value_m = measured if in_range and not self.is_lost else None
