"""Height of a deck at sea: mean level plus heave, an oscillator whose frequency is learned. Down position in O, m.

Vision tells the height; the beacon's height carries its bias as noise, because a bias cannot be told from the level here.
Chosen with `estimator = "boat"`. A Vertical for bank_track.py.
"""

from __future__ import annotations

from dataclasses import dataclass

from companion.estimation.kalman import Vector
from companion.estimation.oscillator import MEAN, RATE, SWING, Oscillator
from companion.estimation.vertical import State, VerticalView

HEAVE = Oscillator(sigma=0.7, mean_psd=3e-4)
BEACON_HEIGHT_SIGMA_M = 2.0


@dataclass(frozen=True, slots=True)
class Sea:
    """State (mean, heave, heave rate, frequency)."""

    heave: Oscillator = HEAVE

    def start(self, z_m: float, variance_m2: float, bias_variance_m2: float) -> State:
        return self.heave.start(z_m, variance_m2 + bias_variance_m2)

    def copied(self, state: State) -> State:
        return state[0][:], state[1][:]

    def predict(self, state: State, dt_s: float) -> None:
        self.heave.predict(*state, dt_s)

    def move(self, x: Vector, dt_s: float) -> None:
        self.heave.move(x, dt_s)

    def innovation(self, state: State, z_m: float, R: float, *, biased: bool) -> tuple[float, float]:
        x, P = state
        return z_m - x[MEAN] - x[SWING], self.heave.variance(P) + _noise(R, biased)

    def update(self, state: State, z_m: float, R: float, *, biased: bool) -> None:
        self.heave.update(*state, z_m, _noise(R, biased))

    def distrust(self, state: State, variance_m2: float, *, biased: bool) -> None:
        if not biased:
            state[1][0] += variance_m2

    def view(self, state: State) -> VerticalView:
        x, P = state
        return VerticalView(
            z_m=x[MEAN] + x[SWING],
            rate_m_s=x[RATE],
            acceleration_m_s2=self.heave.acceleration(x),
            variance_m2=self.heave.variance(P),
            covariance=P[2] + P[6],
            rate_variance=P[10],
        )


def _noise(R: float, biased: bool) -> float:
    return R + BEACON_HEIGHT_SIGMA_M**2 if biased else R
