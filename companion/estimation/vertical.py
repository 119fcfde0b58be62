"""Height of the pad: what a vertical model is, and the one for ground. Down position in O, m.

A road is level, but frame O is not quite: it drifts with the vehicle's vertical velocity error. So the rate is a first-order
Gauss-Markov process of `rate_sigma_m_s` over `rate_time_s` around zero: slopes and drift are followed, and without
measurements the height soon stays where it was. The beacon's vertical bias is a state. Called by bank_track.py.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from companion.estimation.kalman import Vector, update_scalar

State = tuple[Vector, Vector]
"""Mean and covariance."""

Z, VZ, BZ = range(3)


class VerticalView(NamedTuple):
    """Height, its rate and acceleration (down positive), with variances."""

    z_m: float
    rate_m_s: float
    acceleration_m_s2: float
    variance_m2: float
    covariance: float
    rate_variance: float


class Vertical(Protocol):
    """A model of the pad's height. `biased` measurements are the beacon's."""

    def start(self, z_m: float, variance_m2: float, bias_variance_m2: float) -> State: ...

    def copied(self, state: State) -> State: ...

    def predict(self, state: State, dt_s: float) -> None: ...

    def move(self, x: Vector, dt_s: float) -> None:
        """Advance the mean alone, to the same bits."""

    def innovation(self, state: State, z_m: float, R: float, *, biased: bool) -> tuple[float, float]:
        """Residual and its variance."""

    def update(self, state: State, z_m: float, R: float, *, biased: bool) -> None: ...

    def distrust(self, state: State, variance_m2: float, *, biased: bool) -> None:
        """What was measured contradicts the state and is believed: the state is trusted that much less."""

    def view(self, state: State) -> VerticalView: ...


def transformed(P: Vector, g: float, f: float, d: float) -> Vector:
    """F P F' with F = I + g at (Z, VZ), f at (VZ, VZ), d at (BZ, BZ): `transform_covariance` written out, to the same bits."""
    zz, zv, zb, vz, vv, vb, bz, bv, bb = P
    zz, zv, zb = zz + g * vz, zv + g * vv, zb + g * vb
    vz, vv, vb = vz + f * vz, vv + f * vv, vb + f * vb
    bz, bv, bb = bz + d * bz, bv + d * bv, bb + d * bb
    return [
        zz + g * zv, vz + g * vv, bz + g * bv,
        zv + f * zv, vv + f * vv, bv + f * bv,
        zb + d * zb, vb + d * vb, bb + d * bb,
    ]  # fmt: skip


@dataclass(frozen=True, slots=True)
class LevelGround:
    """State (z, vz, beacon bias)."""

    rate_sigma_m_s: float = 0.25
    rate_time_s: float = 5.0
    bias_sigma_m: float = 2.0
    bias_time_s: float = 60.0

    def start(self, z_m: float, variance_m2: float, bias_variance_m2: float) -> State:
        tied, rate = -bias_variance_m2, self.rate_sigma_m_s**2
        bias = bias_variance_m2 if bias_variance_m2 > 0.0 else self.bias_sigma_m**2
        variance = variance_m2 + bias_variance_m2
        return [z_m, 0.0, 0.0], [variance, 0.0, tied, 0.0, rate, 0.0, tied, 0.0, bias]

    def copied(self, state: State) -> State:
        return state[0][:], state[1][:]

    def predict(self, state: State, dt_s: float) -> None:
        x, P = state
        gain, fade, decay = self._moved(x, dt_s)
        P[:] = transformed(P, gain, fade - 1.0, decay - 1.0)
        vv = self.rate_sigma_m_s**2 * (1.0 - fade * fade)
        P[0] += vv * dt_s * dt_s / 3.0
        P[1] += 0.5 * vv * dt_s
        P[3] += 0.5 * vv * dt_s
        P[4] += vv
        P[8] += self.bias_sigma_m**2 * (1.0 - decay * decay)

    def move(self, x: Vector, dt_s: float) -> None:
        self._moved(x, dt_s)

    def _moved(self, x: Vector, dt_s: float) -> tuple[float, float, float]:
        """The mean a step on; returns what the rate adds to the height, and the factors of rate and bias."""
        fade, decay = math.exp(-dt_s / self.rate_time_s), math.exp(-dt_s / self.bias_time_s)
        gain = self.rate_time_s * (1.0 - fade)
        x[Z] += gain * x[VZ]
        x[VZ] *= fade
        x[BZ] *= decay
        return gain, fade, decay

    def innovation(self, state: State, z_m: float, R: float, *, biased: bool) -> tuple[float, float]:
        x, P = state
        if biased:
            return z_m - x[Z] - x[BZ], P[0] + 2.0 * P[2] + P[8] + R
        return z_m - x[Z], P[0] + R

    def update(self, state: State, z_m: float, R: float, *, biased: bool) -> None:
        x, P = state
        if biased:
            update_scalar(x, P, 3, (Z, BZ), (1.0, 1.0), z_m - x[Z] - x[BZ], R, [0.0] * 3)
        else:
            update_scalar(x, P, 3, (Z,), (1.0,), z_m - x[Z], R, [0.0] * 3)

    def distrust(self, state: State, variance_m2: float, *, biased: bool) -> None:
        state[1][8 if biased else 0] += variance_m2

    def view(self, state: State) -> VerticalView:
        x, P = state
        return VerticalView(x[Z], x[VZ], 0.0, P[0], P[1], P[4])
