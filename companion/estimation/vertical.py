"""Height of a pad on the ground: down position in O and its rate, and the beacon's vertical bias.

A road is level, but frame O is not quite: it drifts with the vehicle's vertical velocity error. So the rate is a first-order
Gauss-Markov process of `rate_sigma_m_s` over `rate_time_s` around zero: slopes and drift are followed, and without
measurements the height soon stays where it was. Called by track.py.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from companion.estimation.kalman import Vector, transform_covariance, update_scalar

Z, VZ, BZ = range(3)
ROWS = (Z, VZ, BZ)
COLUMNS = (VZ, VZ, BZ)


@dataclass(frozen=True, slots=True)
class LevelGround:
    """Settings; the state is x = (z, vz, bias) with its 3 x 3 covariance."""

    rate_sigma_m_s: float = 0.25
    rate_time_s: float = 5.0
    bias_sigma_m: float = 2.0
    bias_time_s: float = 60.0

    def start(self, z_m: float, variance_m2: float, bias_m: float = 0.0) -> tuple[list[float], list[float]]:
        rate = self.rate_sigma_m_s**2
        return [z_m, 0.0, bias_m], [variance_m2, 0.0, 0.0, 0.0, rate, 0.0, 0.0, 0.0, self.bias_sigma_m**2]

    def predict(self, x: Vector, P: Vector, dt_s: float) -> None:
        fade, decay = math.exp(-dt_s / self.rate_time_s), math.exp(-dt_s / self.bias_time_s)
        gain = self.rate_time_s * (1.0 - fade)
        x[Z] += gain * x[VZ]
        x[VZ] *= fade
        x[BZ] *= decay
        transform_covariance(P, 3, ROWS, COLUMNS, (gain, fade - 1.0, decay - 1.0))
        vv = self.rate_sigma_m_s**2 * (1.0 - fade * fade)
        P[0] += vv * dt_s * dt_s / 3.0
        P[1] += 0.5 * vv * dt_s
        P[3] += 0.5 * vv * dt_s
        P[4] += vv
        P[8] += self.bias_sigma_m**2 * (1.0 - decay * decay)


def update_height(x: Vector, P: Vector, z_m: float, R: float, *, biased: bool) -> None:
    """Fuse a height; `biased` when it is the beacon's."""
    if biased:
        update_scalar(x, P, 3, (Z, BZ), (1.0, 1.0), z_m - x[Z] - x[BZ], R, [0.0] * 3)
    else:
        update_scalar(x, P, 3, (Z,), (1.0,), z_m - x[Z], R, [0.0] * 3)


def height_variance(P: Vector, R: float, *, biased: bool) -> float:
    """S of a height measurement."""
    return P[0] + R + ((2.0 * P[2] + P[8]) if biased else 0.0)
