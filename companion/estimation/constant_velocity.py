"""Constant velocity: straight and steady, the velocity a slow random walk. Frame O, NED, m, m/s.

`acceleration_psd` (m^2/s^3) is how much the velocity wanders: variance gained per second. Besides the pad's own
unevenness it holds the wander of the vehicle's velocity error, which frame O carries.
"""

from __future__ import annotations

from dataclasses import dataclass

from companion.estimation.kalman import Covariance, Step, Vector, predict_covariance
from companion.estimation.motion import DEFAULT_BIAS, FADING, SHARED, VX, VY, BeaconBias, Motion, X, Y


def velocity_noise_at(n: int) -> tuple[int, ...]:
    """Where in an n x n covariance the numbers of `velocity_noise` go."""
    return tuple(i * n + j for p, v in ((X, VX), (Y, VY)) for i, j in ((p, p), (p, v), (v, p), (v, v)))


STEP = Step(SHARED, (X, Y), (VX, VY), velocity_noise_at(SHARED), FADING)


@dataclass(frozen=True, slots=True)
class ConstantVelocity:
    """`acceleration_psd` in m^2/s^3."""

    acceleration_psd: float = 0.001
    bias: BeaconBias = DEFAULT_BIAS
    name: str = "constant_velocity"
    size: int = SHARED
    yaw_index: int | None = None
    turn_index: int | None = None

    def added(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        return (), ()

    def predict(self, x: Vector, P: Covariance, dt_s: float) -> None:
        self.move(x, dt_s)
        noise = velocity_noise(self.acceleration_psd, dt_s)
        predict_covariance(P, STEP, (dt_s, dt_s), noise, *self.bias.fading(dt_s))

    def move(self, x: Vector, dt_s: float) -> None:
        x[X] += dt_s * x[VX]
        x[Y] += dt_s * x[VY]
        self.bias.move(x, dt_s)

    def motion(self, x: Vector) -> Motion:
        return Motion((0.0, 0.0), 0.0)


def velocity_noise(psd: float, dt_s: float) -> tuple[float, ...]:
    """White acceleration of density `psd` on both axes, integrated over dt_s: what is added at `velocity_noise_at`."""
    vv = psd * dt_s
    pv = 0.5 * vv * dt_s
    pp = vv * dt_s * dt_s / 3.0
    return (pp, pv, pv, vv, pp, pv, pv, vv)
