"""What a motion model is, and the order of the horizontal state that all models share.

    0 x   1 y      pad position in O, m (north, east)
    2 bx  3 by     beacon bias: beacon reads position + bias, m
    4 vx  5 vy     velocity, m/s
    6 ...          what the model adds

The shared part comes first, so that a bank can mix models that add different things.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from companion.estimation.kalman import Covariance, Vector, scale_state

X, Y, BX, BY, VX, VY = range(6)
SHARED = 6
FADING = (BX, BY)
"""The states that `BeaconBias` multiplies, last in each step."""


class Motion(NamedTuple):
    """Horizontal motion as one model sees it: acceleration NED m/s^2 and turn rate rad/s."""

    acceleration_m_s2: tuple[float, float]
    turn_rate_rad_s: float


class MotionModel(Protocol):
    """Final classes, one a file; they hold settings, never state."""

    @property
    def name(self) -> str: ...

    @property
    def size(self) -> int:
        """Number of states n."""

    @property
    def yaw_index(self) -> int | None:
        """State that is the pad's yaw, if the model has one."""

    @property
    def turn_index(self) -> int | None:
        """State that is the turn rate, if the model has one."""

    @property
    def bias(self) -> BeaconBias: ...

    def added(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Initial mean and variance of the states after the shared ones."""

    def predict(self, x: Vector, P: Covariance, dt_s: float) -> None:
        """Advance mean and covariance in place. `dt_s` >= 0; the model splits long steps itself."""

    def move(self, x: Vector, dt_s: float) -> None:
        """Advance the mean alone, to the same bits: for questions that need no covariance."""

    def motion(self, x: Vector) -> Motion: ...


def in_steps(dt_s: float, longest_s: float) -> tuple[float, ...]:
    """`dt_s` in steps of at most `longest_s`, for models whose step is exact only over a short time."""
    if dt_s <= longest_s:
        return (dt_s,)  # nearly always
    steps = []
    while dt_s > longest_s:
        steps.append(longest_s)
        dt_s -= longest_s
    return (*steps, dt_s)


@dataclass(frozen=True, slots=True)
class BeaconBias:
    """First-order Gauss-Markov: `sigma_m` stationary, correlated over `time_s`. Every model predicts it the same way."""

    sigma_m: float = 1.5
    time_s: float = 60.0

    def fading(self, dt_s: float) -> tuple[float, float]:
        """(factor of the bias, variance gained) of a step of dt_s."""
        decay = math.exp(-dt_s / self.time_s)
        return decay, self.sigma_m * self.sigma_m * (1.0 - decay * decay)

    def move(self, x: Vector, dt_s: float) -> tuple[float, float]:
        """Let the mean fade by dt_s, in place; returns `fading`."""
        decay, gained = self.fading(dt_s)
        x[BX] *= decay
        x[BY] *= decay
        return decay, gained

    def predict(self, x: Vector, P: Covariance, n: int, dt_s: float) -> None:
        """Let the bias fade by dt_s, in place."""
        decay, gained = self.move(x, dt_s)
        for b in (BX, BY):
            scale_state(P, n, b, decay)
            P[b * n + b] += gained


DEFAULT_BIAS = BeaconBias()
