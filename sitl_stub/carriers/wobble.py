"""Small slow disturbance of a carrier's speed or steering: a first-order Gauss-Markov process, exact at any step."""

from __future__ import annotations

import math

import numpy as np

from sitl_stub.randomness import NormalDraws


class Wobble:
    """Zero mean, standard deviation `sigma` and correlation time `time_s`; starts from its stationary distribution."""

    __slots__ = ("_decay", "_kick", "_rng", "value")

    def __init__(self, sigma: float, time_s: float, dt_s: float, rng: np.random.Generator | NormalDraws) -> None:
        self._rng = rng
        self._decay = math.exp(-dt_s / time_s)
        self._kick = sigma * math.sqrt(1.0 - self._decay**2)
        self.value = sigma * float(rng.standard_normal())

    def advance(self) -> float:
        if self._kick > 0.0:
            self.value = self._decay * self.value + self._kick * self._rng.standard_normal()
        return self.value
