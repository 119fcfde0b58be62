"""Normal random numbers drawn in blocks: a NumPy generator's seed with the price of a list access."""

from __future__ import annotations

import numpy as np

_BLOCK = 1024


class NormalTape:
    """Endless standard normal numbers as plain floats."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._block: list[float] = []

    def next(self) -> float:
        """The next number."""
        if not self._block:
            self._block = self._rng.standard_normal(_BLOCK).tolist()
        return self._block.pop()
