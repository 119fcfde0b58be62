"""Turns of random sharpness and length at constant speed: what no motion model predicts exactly.

Each piece has a curvature drawn evenly between the limits and a duration drawn evenly around its mean; the curvature
passes from one to the next over `ease_s`, as a steering wheel does.
"""

from __future__ import annotations

import numpy as np

from sitl_stub.paths.curve import integrate_curvature
from sitl_stub.paths.reference import Path, PathReference
from sitl_stub.paths.speed import RampedSpeed
from sitl_stub.section import NonNegative, Positive, Section

_SPACING_M = 0.05


class RandomTurnsSettings(Section, frozen=True, tag_field="kind", tag="random_turns"):
    """[path] kind = "random_turns"."""

    speed_m_s: Positive
    smallest_radius_m: Positive = 8.0
    mean_turn_s: Positive = 4.0
    ease_s: Positive = 0.8
    horizon_s: Positive = 600.0
    """The path is drawn this far ahead; after it the carrier goes on straight."""
    start_delay_s: NonNegative = 0.0

    def build(self, rng: np.random.Generator) -> Path:
        return RandomTurns(self, rng)


class RandomTurns:
    """A fixed path drawn once from the generator."""

    def __init__(self, settings: RandomTurnsSettings, rng: np.random.Generator) -> None:
        self._speed = RampedSpeed(settings.speed_m_s, settings.start_delay_s)
        self._table = integrate_curvature(random_curvature(settings, rng), _SPACING_M)

    def at(self, t_s: float) -> PathReference:
        distance, speed, acceleration = self._speed.at(t_s)
        beyond_m = max(distance - self._table.length_m, 0.0)
        end = self._table.at(distance - beyond_m, speed, acceleration)
        if beyond_m == 0.0:
            return end
        north = end.north_m + beyond_m * np.cos(end.heading_rad)
        east = end.east_m + beyond_m * np.sin(end.heading_rad)
        return PathReference(float(north), float(east), end.heading_rad, speed, acceleration, 0.0)


def random_curvature(settings: RandomTurnsSettings, rng: np.random.Generator) -> list[float]:
    """Curvature at every `_SPACING_M` of the way, eased between the pieces by a moving mean."""
    per_second = settings.speed_m_s / _SPACING_M
    total = int(settings.horizon_s * per_second) + 2
    limit = 1.0 / settings.smallest_radius_m
    pieces: list[np.ndarray] = []
    drawn = 0
    while drawn < total:
        count = max(int(rng.uniform(0.5, 1.5) * settings.mean_turn_s * per_second), 1)
        pieces.append(np.full(count, rng.uniform(-limit, limit)))
        drawn += count
    width = max(int(settings.ease_s * per_second), 1)
    steps = np.concatenate(pieces)[:total]
    padded = np.concatenate((np.full(width, steps[0]), steps))
    sums = np.cumsum(padded)
    eased = (sums[width:] - sums[:-width]) / width
    return [float(k) for k in eased]
