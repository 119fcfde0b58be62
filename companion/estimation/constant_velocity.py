"""Constant velocity: straight and steady, the velocity a slow random walk. Frame O, NED, m, m/s.

`acceleration_psd` (m^2/s^3) is how much the velocity wanders: variance gained per second. Besides the pad's own
unevenness it holds the wander of the vehicle's velocity error, which frame O carries.
"""

from __future__ import annotations

from dataclasses import dataclass

from companion.estimation.kalman import Vector, transform_covariance
from companion.estimation.motion import DEFAULT_BIAS, SHARED, VX, VY, BeaconBias, Motion, X, Y

ROWS = (X, Y)
COLUMNS = (VX, VY)


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

    def predict(self, x: Vector, P: Vector, dt_s: float) -> None:
        x[X] += dt_s * x[VX]
        x[Y] += dt_s * x[VY]
        transform_covariance(P, SHARED, ROWS, COLUMNS, (dt_s, dt_s))
        add_velocity_noise(P, SHARED, self.acceleration_psd, dt_s)
        self.bias.predict(x, P, SHARED, dt_s)

    def motion(self, x: Vector) -> Motion:
        return Motion((0.0, 0.0), 0.0)


def add_velocity_noise(P: Vector, n: int, psd: float, dt_s: float) -> None:
    """White acceleration of density `psd` on both axes, integrated over dt_s into velocity and position."""
    vv = psd * dt_s
    pv = 0.5 * vv * dt_s
    pp = vv * dt_s * dt_s / 3.0
    for p, v in ((X, VX), (Y, VY)):
        P[p * n + p] += pp
        P[p * n + v] += pv
        P[v * n + p] += pv
        P[v * n + v] += vv
