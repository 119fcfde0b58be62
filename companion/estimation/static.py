"""A pad that stands still: position only. The velocity stays zero; `drift_psd` (m^2/s) lets the position follow the drift of
frame O, which moves with the vehicle's velocity error.
"""

from __future__ import annotations

from dataclasses import dataclass

from companion.estimation.kalman import Covariance, Vector, forget
from companion.estimation.motion import DEFAULT_BIAS, SHARED, VX, VY, BeaconBias, Motion, X, Y


@dataclass(frozen=True, slots=True)
class Static:
    """`drift_psd` in m^2/s."""

    drift_psd: float = 0.01
    bias: BeaconBias = DEFAULT_BIAS
    name: str = "static"
    size: int = SHARED
    yaw_index: int | None = None
    turn_index: int | None = None

    def added(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        return (), ()

    def predict(self, x: Vector, P: Covariance, dt_s: float) -> None:
        for position, velocity in ((X, VX), (Y, VY)):
            x[velocity] = 0.0
            forget(P, SHARED, velocity, 1e-6)
            P[position * SHARED + position] += self.drift_psd * dt_s
        self.bias.predict(x, P, SHARED, dt_s)

    def move(self, x: Vector, dt_s: float) -> None:
        x[VX] = x[VY] = 0.0
        self.bias.move(x, dt_s)

    def motion(self, x: Vector) -> Motion:
        return Motion((0.0, 0.0), 0.0)
