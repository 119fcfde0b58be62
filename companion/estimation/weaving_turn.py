"""Weaving: the turn rate itself changes, as on a figure of eight or a winding road. Frame O, NED, SI.

Adds to the shared state: turn rate w (rad/s), its rate of change, the acceleration along travel (m/s^2), the yaw of the pad
(rad). The turn rate swings about zero with stiffness `swing_s2`: roads turn one way and then the other, and an extrapolated
change of turn rate must not wind up into a spiral.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from companion.estimation.constant_velocity import velocity_noise, velocity_noise_at
from companion.estimation.kalman import Covariance, Step, Vector, predict_covariance
from companion.estimation.motion import DEFAULT_BIAS, FADING, SHARED, VX, VY, BeaconBias, Motion, X, Y, in_steps
from companion.estimation.turn import ARC_ENTRIES, Arc, arc, arc_acceleration, arc_entries

TURN, CHANGE, ALONG, YAW = range(SHARED, SHARED + 4)
SIZE = SHARED + 4
MAX_STEP_S = 0.2

ENTRIES = (
    *ARC_ENTRIES,
    *((state, TURN) for state in (X, Y, VX, VY)),
    *((state, ALONG) for state in (X, Y, VX, VY)),
    (VX, CHANGE), (VY, CHANGE), (TURN, CHANGE), (CHANGE, TURN), (CHANGE, CHANGE), (ALONG, ALONG), (YAW, TURN),
)  # fmt: skip
ROWS = tuple(row for row, _ in ENTRIES)
COLUMNS = tuple(column for _, column in ENTRIES)
NOISY = ((CHANGE, CHANGE), (TURN, CHANGE), (CHANGE, TURN), (TURN, TURN), (ALONG, ALONG))
STEP = Step(SIZE, ROWS, COLUMNS, (*(i * SIZE + j for i, j in NOISY), *velocity_noise_at(SIZE)), FADING)


@dataclass(frozen=True, slots=True)
class WeavingTurn:
    """`turn_psd` (rad^2/s^5) drives the change of the turn rate, which `swing_s2` (1/s^2) pulls back and `damping_s` (1/s)
    damps; the acceleration along travel fades over `along_time_s`."""

    turn_psd: float = 0.1
    swing_s2: float = 0.3
    damping_s: float = 0.3
    along_sigma_m_s2: float = 0.5
    along_time_s: float = 2.0
    velocity_psd: float = 0.001
    bias: BeaconBias = DEFAULT_BIAS
    name: str = "weaving_turn"
    size: int = SIZE
    yaw_index: int | None = YAW
    turn_index: int | None = TURN

    def added(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        return (0.0, 0.0, 0.0, 0.0), (0.25, 0.1, self.along_sigma_m_s2**2, 10.0)

    def predict(self, x: Vector, P: Covariance, dt_s: float) -> None:
        for step_s in in_steps(dt_s, MAX_STEP_S):
            self._step(x, P, step_s)

    def move(self, x: Vector, dt_s: float) -> None:
        for step_s in in_steps(dt_s, MAX_STEP_S):
            self._moved(x, step_s)

    def _step(self, x: Vector, P: Covariance, dt_s: float) -> None:
        fade, moved = self._moved(x, dt_s)
        values = arc_entries(moved, dt_s)
        to_vx, to_vy = 0.5 * dt_s * values[10], 0.5 * dt_s * values[11]
        swing, damping = -dt_s * self.swing_s2, -dt_s * self.damping_s
        values = (*values, to_vx, to_vy, dt_s, swing, damping, fade - 1.0, dt_s)
        predict_covariance(P, STEP, values, self._noise(dt_s), *self.bias.fading(dt_s))

    def _moved(self, x: Vector, dt_s: float) -> tuple[float, Arc]:
        """The mean a step on; returns the factor of the acceleration along travel, and the arc."""
        fade = math.exp(-dt_s / self.along_time_s)
        turn, change = x[TURN], x[CHANGE]
        mean_turn = turn + 0.5 * change * dt_s
        moved = arc(x, mean_turn, x[ALONG], dt_s)
        swing, damping = -dt_s * self.swing_s2, -dt_s * self.damping_s
        x[YAW] += mean_turn * dt_s
        x[TURN] = turn + change * dt_s
        x[CHANGE] = change + swing * turn + damping * change
        x[ALONG] *= fade
        self.bias.move(x, dt_s)
        return fade, moved

    def _noise(self, dt_s: float) -> tuple[float, ...]:
        fade = math.exp(-dt_s / self.along_time_s)
        q = self.turn_psd * dt_s
        tied = 0.5 * q * dt_s
        along = self.along_sigma_m_s2**2 * (1.0 - fade * fade)
        return (q, tied, tied, q * dt_s * dt_s / 3.0, along, *velocity_noise(self.velocity_psd, dt_s))

    def motion(self, x: Vector) -> Motion:
        return Motion(arc_acceleration(x, x[TURN], x[ALONG]), x[TURN])
