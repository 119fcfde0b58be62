"""A swinging quantity whose mean and frequency are learned: heave, roll and pitch of a boat.

    x = (mean, swing, rate, W)    swing' = rate    rate' = -W^2 swing - 2 d W rate + noise    W (rad/s) learned

A sea is narrow in frequency, so one lightly damped oscillator foresees it for about half a period; after that the swing has
faded and the covariance is that of the sea. Extended Kalman filter in plain floats. Units of `swing`: m or rad. Used by sea.py.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from companion.estimation.kalman import Vector, transform_covariance, update_scalar
from companion.estimation.motion import in_steps

MEAN, SWING, RATE, W = range(4)
ROWS, COLUMNS = (SWING, SWING, RATE, RATE, RATE, SWING), (SWING, RATE, SWING, RATE, W, W)
MAX_STEP_S = 0.1
W_LIMITS = (0.3, 4.0)
"""Periods from 21 s down to 1.6 s."""


@dataclass(frozen=True, slots=True)
class Oscillator:
    """`sigma` is the expected standard deviation of the swing; `damping` the fraction of critical damping."""

    sigma: float = 0.3
    damping: float = 0.08
    frequency_rad_s: float = 1.0
    frequency_sigma_rad_s: float = 0.35
    mean_psd: float = 1e-3
    frequency_psd: float = 1e-3

    def start(self, value: float, variance: float) -> tuple[Vector, Vector]:
        w, s2 = self.frequency_rad_s, self.sigma**2
        P = [0.0] * 16
        P[0], P[5], P[10], P[15] = variance + s2, s2, s2 * w * w, self.frequency_sigma_rad_s**2
        P[1] = P[4] = -s2
        return [value, 0.0, 0.0, w], P

    def predict(self, x: Vector, P: Vector, dt_s: float) -> None:
        for step_s in in_steps(dt_s, MAX_STEP_S):
            self._step(x, P, step_s)

    def move(self, x: Vector, dt_s: float) -> None:
        """The mean alone, to the same bits."""
        for step_s in in_steps(dt_s, MAX_STEP_S):
            self._moved(x, step_s)

    def _step(self, x: Vector, P: Vector, dt: float) -> None:
        values = self._moved(x, dt)
        transform_covariance(P, 4, ROWS, COLUMNS, values)
        self._add_noise(P, x[W], dt)

    def _moved(self, x: Vector, dt: float) -> tuple[float, ...]:
        """Exact rotation of the damped oscillator, the frequency's influence to first order; returns the entries of F - I."""
        h, r, w = x[SWING], x[RATE], x[W]
        decay = self.damping * w
        wd = w * math.sqrt(1.0 - self.damping**2)
        e, c, s = math.exp(-decay * dt), math.cos(wd * dt), math.sin(wd * dt)
        a, b = e * (c + decay / wd * s), e * s / wd
        ar, br = -e * w * w / wd * s, e * (c - decay / wd * s)
        x[SWING], x[RATE] = a * h + b * r, ar * h + br * r
        by_w = -2.0 * (w * h + self.damping * r) * dt
        return (a - 1.0, b, ar, br - 1.0, by_w, 0.5 * by_w * dt)

    def _add_noise(self, P: Vector, w: float, dt: float) -> None:
        """White acceleration of the density that keeps a swing of standard deviation sigma alive: 4 d W^3 sigma^2."""
        q = 4.0 * self.damping * w**3 * self.sigma**2 * dt
        P[5] += q * dt * dt / 3.0
        P[6] += 0.5 * q * dt
        P[9] += 0.5 * q * dt
        P[10] += q
        P[0] += self.mean_psd * dt
        P[15] += self.frequency_psd * dt

    def update(self, x: Vector, P: Vector, value: float, R: float) -> None:
        update_scalar(x, P, 4, (MEAN, SWING), (1.0, 1.0), value - x[MEAN] - x[SWING], R, [0.0] * 4)
        x[W] = min(max(x[W], W_LIMITS[0]), W_LIMITS[1])

    def variance(self, P: Vector) -> float:
        """Of mean plus swing."""
        return P[0] + 2.0 * P[1] + P[5]

    def acceleration(self, x: Vector) -> float:
        return -x[W] * x[W] * x[SWING] - 2.0 * self.damping * x[W] * x[RATE]
