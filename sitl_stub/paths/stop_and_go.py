"""A straight line with the speed of town traffic: gather speed, keep it, brake, stand, again."""

from __future__ import annotations

import numpy as np

from sitl_stub.paths.reference import Path, PathReference
from sitl_stub.section import Fraction, NonNegative, Positive, Section


class StopAndGoSettings(Section, frozen=True, tag_field="kind", tag="stop_and_go"):
    """[path] kind = "stop_and_go"."""

    speed_m_s: Positive
    acceleration_m_s2: Positive = 1.0
    go_s: NonNegative = 8.0
    """Time at full speed."""
    stop_s: NonNegative = 4.0
    """Time standing."""
    start_fraction: Fraction | None = None
    """Where in the cycle it starts, 0 to 1; absent: seeded."""

    def build(self, rng: np.random.Generator) -> Path:
        seeded = float(rng.random())
        return StopAndGo(self, seeded if self.start_fraction is None else self.start_fraction)


class StopAndGo:
    """Periodic trapezoids of speed along north."""

    def __init__(self, settings: StopAndGoSettings, start_fraction: float) -> None:
        self._speed_m_s = settings.speed_m_s
        self._acceleration_m_s2 = settings.acceleration_m_s2
        self._ramp_s = settings.speed_m_s / settings.acceleration_m_s2
        self._go_s = settings.go_s
        self._cycle_s = 2.0 * self._ramp_s + settings.go_s + settings.stop_s
        self._cycle_m = settings.speed_m_s * (self._ramp_s + settings.go_s)
        self._start_s = start_fraction * self._cycle_s
        self._start_m = self._distance(self._start_s)

    def at(self, t_s: float) -> PathReference:
        t = t_s + self._start_s
        speed, acceleration = self._motion(t % self._cycle_s)
        return PathReference(self._distance(t) - self._start_m, 0.0, 0.0, speed, acceleration, 0.0)

    def _motion(self, phase_s: float) -> tuple[float, float]:
        a, ramp = self._acceleration_m_s2, self._ramp_s
        if phase_s < ramp:
            return a * phase_s, a
        if phase_s < ramp + self._go_s:
            return self._speed_m_s, 0.0
        braking_s = phase_s - ramp - self._go_s
        return (self._speed_m_s - a * braking_s, -a) if braking_s < ramp else (0.0, 0.0)

    def _distance(self, t_s: float) -> float:
        cycles, phase = divmod(t_s, self._cycle_s)
        ramp, v, a = self._ramp_s, self._speed_m_s, self._acceleration_m_s2
        rising = min(phase, ramp)
        steady = min(max(phase - ramp, 0.0), self._go_s)
        braking = min(max(phase - ramp - self._go_s, 0.0), ramp)
        in_cycle = 0.5 * a * rising * rising + v * steady + v * braking - 0.5 * a * braking * braking
        return cycles * self._cycle_m + in_cycle
