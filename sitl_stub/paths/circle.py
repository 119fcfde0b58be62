"""A circle at constant speed, clockwise or counter-clockwise."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from sitl_stub.paths.reference import Path, PathReference
from sitl_stub.paths.speed import RampedSpeed
from sitl_stub.section import NonNegative, Positive, Section


class CircleSettings(Section, frozen=True, tag_field="kind", tag="circle"):
    """[path] kind = "circle"."""

    speed_m_s: NonNegative
    radius_m: Positive
    turn: Literal["clockwise", "counterclockwise", "seeded"] = "seeded"
    start_delay_s: NonNegative = 0.0
    acceleration_m_s2: NonNegative = 0.0

    def build(self, rng: np.random.Generator) -> Path:
        seeded_sign = 1.0 if rng.random() < 0.5 else -1.0
        sign = {"clockwise": 1.0, "counterclockwise": -1.0, "seeded": seeded_sign}[self.turn]
        return Circle(RampedSpeed(self.speed_m_s, self.start_delay_s, self.acceleration_m_s2), sign * self.radius_m)


class Circle:
    """Starts at the origin heading north; a positive radius turns clockwise (centre to the east)."""

    def __init__(self, speed: RampedSpeed, signed_radius_m: float) -> None:
        self._speed = speed
        self._radius_m = signed_radius_m

    def at(self, t_s: float) -> PathReference:
        distance, speed, acceleration = self._speed.at(t_s)
        r = self._radius_m
        heading = distance / r
        return PathReference(
            r * math.sin(heading), r * (1.0 - math.cos(heading)), heading, speed, acceleration, 1.0 / r
        )
