"""Coordinated turn: a steady curve, the turn rate a slow random walk. Frame O, NED, SI.

Adds to the shared state: turn rate w (rad/s, clockwise from above), the acceleration along travel (m/s^2), and the yaw of
the pad (rad), which turns with w. The yaw that vision measures is thus a direct look at the turn rate, far better than the
curvature of noisy positions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from companion.estimation.constant_velocity import velocity_noise, velocity_noise_at
from companion.estimation.kalman import Covariance, Step, Vector, predict_covariance
from companion.estimation.motion import DEFAULT_BIAS, FADING, SHARED, VX, VY, BeaconBias, Motion, X, Y, in_steps
from companion.estimation.turn import ARC_ENTRIES, Arc, arc, arc_acceleration, arc_entries

TURN, ALONG, YAW = range(SHARED, SHARED + 3)
SIZE = SHARED + 3
MAX_STEP_S = 0.2

ENTRIES = (
    *ARC_ENTRIES,
    *((state, TURN) for state in (X, Y, VX, VY)),
    *((state, ALONG) for state in (X, Y, VX, VY)),
    (ALONG, ALONG),
    (YAW, TURN),
)
ROWS = tuple(row for row, _ in ENTRIES)
COLUMNS = tuple(column for _, column in ENTRIES)
STEP = Step(SIZE, ROWS, COLUMNS, (TURN * SIZE + TURN, ALONG * SIZE + ALONG, *velocity_noise_at(SIZE)), FADING)


@dataclass(frozen=True, slots=True)
class CoordinatedTurn:
    """`turn_psd` (rad^2/s^3) is the wander of the turn rate; the acceleration along travel fades over `along_time_s`."""

    turn_psd: float = 0.002
    along_sigma_m_s2: float = 0.15
    along_time_s: float = 2.0
    velocity_psd: float = 0.001
    bias: BeaconBias = DEFAULT_BIAS
    name: str = "coordinated_turn"
    size: int = SIZE
    yaw_index: int | None = YAW
    turn_index: int | None = TURN

    def added(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        return (0.0, 0.0, 0.0), (0.25, self.along_sigma_m_s2**2, 10.0)

    def predict(self, x: Vector, P: Covariance, dt_s: float) -> None:
        for step_s in in_steps(dt_s, MAX_STEP_S):
            self._step(x, P, step_s)

    def move(self, x: Vector, dt_s: float) -> None:
        for step_s in in_steps(dt_s, MAX_STEP_S):
            self._moved(x, step_s)

    def _step(self, x: Vector, P: Covariance, dt_s: float) -> None:
        fade, moved = self._moved(x, dt_s)
        values = (*arc_entries(moved, dt_s), fade - 1.0, dt_s)
        along = self.along_sigma_m_s2**2 * (1.0 - fade * fade)
        noise = (self.turn_psd * dt_s, along, *velocity_noise(self.velocity_psd, dt_s))
        predict_covariance(P, STEP, values, noise, *self.bias.fading(dt_s))

    def _moved(self, x: Vector, dt_s: float) -> tuple[float, Arc]:
        """The mean a step on; returns the factor of the acceleration along travel, and the arc."""
        fade = math.exp(-dt_s / self.along_time_s)
        moved = arc(x, x[TURN], x[ALONG], dt_s)
        x[YAW] += x[TURN] * dt_s
        x[ALONG] *= fade
        self.bias.move(x, dt_s)
        return fade, moved

    def motion(self, x: Vector) -> Motion:
        return Motion(arc_acceleration(x, x[TURN], x[ALONG]), x[TURN])
