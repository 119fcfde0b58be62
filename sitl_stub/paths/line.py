"""A straight line at constant speed, from rest or already rolling."""

from __future__ import annotations

import numpy as np

from sitl_stub.paths.reference import Path, PathReference
from sitl_stub.paths.speed import RampedSpeed
from sitl_stub.section import NonNegative, Section


class LineSettings(Section, frozen=True, tag_field="kind", tag="line"):
    """[path] kind = "line"."""

    speed_m_s: NonNegative
    start_delay_s: NonNegative = 0.0
    """The carrier stands for this long first."""
    acceleration_m_s2: NonNegative = 0.0
    """How fast it gathers speed; 0: it is already at full speed when it starts."""

    def build(self, rng: np.random.Generator) -> Path:
        return Line(RampedSpeed(self.speed_m_s, self.start_delay_s, self.acceleration_m_s2))


class Line:
    """North from the origin."""

    def __init__(self, speed: RampedSpeed) -> None:
        self._speed = speed

    def at(self, t_s: float) -> PathReference:
        distance, speed, acceleration = self._speed.at(t_s)
        return PathReference(distance, 0.0, 0.0, speed, acceleration, 0.0)
