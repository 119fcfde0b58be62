"""Coordinated turn with changing turn rate and speed: what a steered vehicle does. Frame O, NED, SI.

Adds to the shared state: turn rate w (rad/s, clockwise from above), its rate of change, the acceleration along travel
(m/s^2), and the yaw of the pad (rad), which turns with w. The yaw that vision measures is thus a direct look at the turn
rate, far better than the curvature of noisy positions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from companion.estimation.constant_velocity import add_velocity_noise
from companion.estimation.kalman import Vector, transform_covariance
from companion.estimation.motion import BX, BY, DEFAULT_BIAS, SHARED, VX, VY, BeaconBias, Motion, X, Y

TURN, TURN_CHANGE, ALONG, YAW = range(SHARED, SHARED + 4)
SIZE = SHARED + 4
MAX_STEP_S = 0.1
MIN_SPEED_M_S = 0.3
"""Below it the direction of travel is noise: the acceleration along travel acts in proportion."""

ENTRIES = (
    (X, VX), (X, VY), (Y, VX), (Y, VY), (X, TURN), (Y, TURN), (X, TURN_CHANGE), (Y, TURN_CHANGE), (X, ALONG), (Y, ALONG),
    (VX, VX), (VX, VY), (VY, VX), (VY, VY), (VX, TURN), (VY, TURN), (VX, TURN_CHANGE), (VY, TURN_CHANGE), (VX, ALONG),
    (VY, ALONG), (TURN, TURN_CHANGE), (TURN_CHANGE, TURN), (TURN_CHANGE, TURN_CHANGE), (ALONG, ALONG), (YAW, TURN),
    (YAW, TURN_CHANGE), (BX, BX), (BY, BY),
)  # fmt: skip
"""Where F differs from the identity, in the order in which `turn_step` gives the values."""
ROWS = tuple(row for row, _ in ENTRIES)
COLUMNS = tuple(column for _, column in ENTRIES)


@dataclass(frozen=True, slots=True)
class CoordinatedTurn:
    """Densities: `turn_psd` of white noise on the turn rate's change (rad^2/s^5), `along_*` of the Gauss-Markov
    acceleration along travel. The turn rate swings back to zero with stiffness `swing_s2`: roads and figures of eight turn
    one way and then the other, and an extrapolated change of turn rate must not wind up into a spiral."""

    turn_psd: float = 0.03
    swing_s2: float = 0.3
    damping_s: float = 0.3
    along_sigma_m_s2: float = 0.7
    along_time_s: float = 2.0
    velocity_psd: float = 0.001
    bias: BeaconBias = DEFAULT_BIAS
    name: str = "coordinated_turn"
    size: int = SIZE
    yaw_index: int | None = YAW
    turn_index: int | None = TURN

    def added(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        along = self.along_sigma_m_s2 * self.along_sigma_m_s2
        return (0.0, 0.0, 0.0, 0.0), (0.25, 0.1, along, 10.0)

    def predict(self, x: Vector, P: Vector, dt_s: float) -> None:
        while dt_s > MAX_STEP_S:
            self._step(x, P, MAX_STEP_S)
            dt_s -= MAX_STEP_S
        self._step(x, P, dt_s)

    def _step(self, x: Vector, P: Vector, dt_s: float) -> None:
        decay = self.bias.decay(dt_s)
        values = turn_step(x, dt_s, self.swing_s2, self.damping_s, math.exp(-dt_s / self.along_time_s))
        values += (decay - 1.0, decay - 1.0)
        x[BX] *= decay
        x[BY] *= decay
        transform_covariance(P, SIZE, ROWS, COLUMNS, values, len(values), [0.0] * (SIZE * SIZE))
        self._add_noise(P, dt_s)

    def _add_noise(self, P: Vector, dt_s: float) -> None:
        q = self.turn_psd * dt_s
        for i, j, value in (
            (TURN_CHANGE, TURN_CHANGE, q),
            (TURN, TURN_CHANGE, q * dt_s / 2.0),
            (TURN_CHANGE, TURN, q * dt_s / 2.0),
            (TURN, TURN, q * dt_s * dt_s / 3.0),
        ):
            P[i * SIZE + j] += value
        P[ALONG * SIZE + ALONG] += 2.0 * self.along_sigma_m_s2**2 / self.along_time_s * dt_s
        P[YAW * SIZE + YAW] += 1e-4 * dt_s
        gained = self.bias.variance_gained(dt_s)
        P[BX * SIZE + BX] += gained
        P[BY * SIZE + BY] += gained
        add_velocity_noise(P, SIZE, self.velocity_psd, dt_s)

    def motion(self, x: Vector) -> Motion:
        speed = max(math.hypot(x[VX], x[VY]), MIN_SPEED_M_S)
        along = x[ALONG] / speed
        return Motion((-x[TURN] * x[VY] + along * x[VX], x[TURN] * x[VX] + along * x[VY]), x[TURN])


def turn_step(x: Vector, dt: float, swing: float, damping: float, fade: float) -> tuple[float, ...]:
    """One short step of the mean, in place; returns the entries of F - I at ENTRIES (without the beacon's two).

    The chord of an arc: direction half way through the turn, length times sinc of the half angle.
    """
    vx, vy, w, change, along = x[VX], x[VY], x[TURN], x[TURN_CHANGE], x[ALONG]
    angle = w * dt + 0.5 * change * dt * dt
    c, s = math.cos(angle), math.sin(angle)
    ch, sh = math.cos(0.5 * angle), math.sin(0.5 * angle)
    speed = max(math.hypot(vx, vy), MIN_SPEED_M_S)
    ux, uy = vx / speed, vy / speed
    half = 0.5 * along * dt
    mx, my = vx + ux * half, vy + uy * half
    chord = dt * (1.0 - angle * angle / 24.0)
    bx, by = ch * mx - sh * my, sh * mx + ch * my
    ex, ey = vx + 2.0 * ux * half, vy + 2.0 * uy * half
    nx, ny = c * ex - s * ey, s * ex + c * ey
    x[X] += chord * bx
    x[Y] += chord * by
    x[VX], x[VY] = nx, ny
    x[TURN] = w + change * dt
    x[TURN_CHANGE] = change - dt * (swing * w + damping * change)
    x[ALONG] = along * fade
    x[YAW] += angle
    t2, t3 = dt * dt / 2.0, dt * dt * dt / 6.0
    return (
        chord * ch, -chord * sh, chord * sh, chord * ch,
        -t2 * by, t2 * bx, -t3 * by, t3 * bx,
        t2 * (ch * ux - sh * uy), t2 * (sh * ux + ch * uy),
        c - 1.0, -s, s, c - 1.0,
        -dt * ny, dt * nx, -t2 * ny, t2 * nx,
        dt * (c * ux - s * uy), dt * (s * ux + c * uy),
        dt, -dt * swing, -dt * damping, fade - 1.0, dt, t2,
    )  # fmt: skip
