"""Constant acceleration that fades (Singer): the model for braking, starting and whatever nobody foresaw.

Adds the acceleration NED (m/s^2) to the shared state. It forgets over `time_s`, with stationary `sigma_m_s2`: without
fading, an extrapolated acceleration runs off with t^2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from companion.estimation.constant_velocity import velocity_noise, velocity_noise_at
from companion.estimation.kalman import Covariance, Step, Vector, predict_covariance
from companion.estimation.motion import DEFAULT_BIAS, FADING, SHARED, VX, VY, BeaconBias, Motion, X, Y, in_steps

AX, AY = SHARED, SHARED + 1
SIZE = SHARED + 2
ROWS = (X, Y, VX, VY, X, Y, AX, AY)
COLUMNS = (VX, VY, AX, AY, AX, AY, AX, AY)
AXES = ((X, VX, AX), (Y, VY, AY))
JERK_AT = tuple(
    i * SIZE + j
    for p, v, a in AXES
    for i, j in ((a, a), (a, v), (v, a), (a, p), (p, a), (v, v), (v, p), (p, v), (p, p))
)
STEP = Step(SIZE, ROWS, COLUMNS, (*JERK_AT, *velocity_noise_at(SIZE)), FADING)
MAX_STEP_S = 0.5


@dataclass(frozen=True, slots=True)
class ConstantAcceleration:
    """Singer model: acceleration of `sigma_m_s2` that is correlated over `time_s`."""

    sigma_m_s2: float = 2.0
    time_s: float = 2.0
    velocity_psd: float = 0.001
    bias: BeaconBias = DEFAULT_BIAS
    name: str = "constant_acceleration"
    size: int = SIZE
    yaw_index: int | None = None
    turn_index: int | None = None

    def added(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        variance = self.sigma_m_s2 * self.sigma_m_s2
        return (0.0, 0.0), (variance, variance)

    def predict(self, x: Vector, P: Covariance, dt_s: float) -> None:
        for step_s in in_steps(dt_s, MAX_STEP_S):
            self._step(x, P, step_s)

    def move(self, x: Vector, dt_s: float) -> None:
        for step_s in in_steps(dt_s, MAX_STEP_S):
            self._moved(x, step_s)

    def _step(self, x: Vector, P: Covariance, dt_s: float) -> None:
        values = self._moved(x, dt_s)
        predict_covariance(P, STEP, values, self._noise(dt_s), *self.bias.fading(dt_s))

    def _moved(self, x: Vector, dt_s: float) -> tuple[float, ...]:
        """The mean a step on; returns the entries of F - I."""
        fade = math.exp(-dt_s / self.time_s)
        to_velocity = self.time_s * (1.0 - fade)
        to_position = self.time_s * (dt_s - to_velocity)
        for p, v, a in AXES:
            x[p] += dt_s * x[v] + to_position * x[a]
            x[v] += to_velocity * x[a]
            x[a] *= fade
        self.bias.move(x, dt_s)
        return (dt_s, dt_s, to_velocity, to_velocity, to_position, to_position, fade - 1.0, fade - 1.0)

    def _noise(self, dt_s: float) -> tuple[float, ...]:
        """White jerk of the density that keeps the stationary variance, integrated (exact to the first order of dt/T)."""
        psd = 2.0 * self.sigma_m_s2 * self.sigma_m_s2 / self.time_s
        aa, av, ap = psd * dt_s, psd * dt_s**2 / 2.0, psd * dt_s**3 / 6.0
        vv, vp, pp = psd * dt_s**3 / 3.0, psd * dt_s**4 / 8.0, psd * dt_s**5 / 20.0
        jerk = (aa, av, av, ap, ap, vv, vp, vp, pp)
        return (*jerk, *jerk, *velocity_noise(self.velocity_psd, dt_s))

    def motion(self, x: Vector) -> Motion:
        v2 = x[VX] * x[VX] + x[VY] * x[VY]
        turn = (x[VX] * x[AY] - x[VY] * x[AX]) / v2 if v2 > 0.25 else 0.0
        return Motion((x[AX], x[AY]), turn)
