"""Yaw of the pad and its rate, where it is measured: x = (yaw, rate), rad and rad/s. The yaw is kept unwrapped; innovations
are wrapped. The rate fades over `rate_time_s`. Called by track.py.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from companion.estimation.kalman import Vector, update_scalar
from companion.geometry import wrap_pi

YAW, RATE = range(2)


@dataclass(frozen=True, slots=True)
class SteadyHeading:
    """Settings of the yaw filter."""

    rate_sigma_rad_s: float = 0.6
    rate_time_s: float = 8.0

    def start(self, yaw_rad: float, variance: float) -> tuple[list[float], list[float]]:
        return [yaw_rad, 0.0], [variance, 0.0, 0.0, self.rate_sigma_rad_s**2]

    def predict(self, x: Vector, P: Vector, dt_s: float) -> None:
        fade = math.exp(-dt_s / self.rate_time_s)
        gain = self.rate_time_s * (1.0 - fade)
        x[YAW] += gain * x[RATE]
        x[RATE] *= fade
        P[:] = _transformed(P, gain, fade - 1.0)
        vv = self.rate_sigma_rad_s**2 * (1.0 - fade * fade)
        P[0] += vv * dt_s * dt_s / 3.0
        P[1] += 0.5 * vv * dt_s
        P[2] += 0.5 * vv * dt_s
        P[3] += vv


def _transformed(P: Vector, g: float, f: float) -> Vector:
    """F P F' with F = I + g at (YAW, RATE), f at (RATE, RATE): `transform_covariance` written out, to the same bits."""
    yy, yr, ry, rr = P
    yy, yr = yy + g * ry, yr + g * rr
    ry, rr = ry + f * ry, rr + f * rr
    return [yy + g * yr, ry + g * rr, yr + f * yr, rr + f * rr]


def update_yaw(x: Vector, P: Vector, yaw_rad: float, R: float) -> None:
    update_scalar(x, P, 2, (YAW,), (1.0,), wrap_pi(yaw_rad - x[YAW]), R, [0.0, 0.0])


def update_rate(x: Vector, P: Vector, rate_rad_s: float, R: float) -> None:
    update_scalar(x, P, 2, (RATE,), (1.0,), rate_rad_s - x[RATE], R, [0.0, 0.0])
