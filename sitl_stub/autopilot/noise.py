"""Normal random numbers drawn in blocks: a NumPy generator's seed with the price of a list access."""

from __future__ import annotations

from typing import Any

import numpy as np

from sitl_stub.compiled import COMPILED, room

_BLOCK = 1024


class NormalTape:
    """Endless standard normal numbers as plain floats; a kernel reads `numbers` itself, from `at` on."""

    __slots__ = ("_rng", "at", "numbers")

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self.numbers: Any = room([])
        self.at = 0

    def reserve(self, count: int) -> None:
        """Have so many numbers from `at` on; the sequence is the same however it is read."""
        while len(self.numbers) - self.at < count:
            fresh, rest = self._rng.standard_normal(_BLOCK)[::-1], self.numbers[self.at :]
            self.numbers = np.concatenate((rest, fresh)) if COMPILED else rest + fresh.tolist()
            self.at = 0

    def next(self) -> float:
        """The next number."""
        if self.at >= len(self.numbers):
            self.reserve(1)
        self.at += 1
        return float(self.numbers[self.at - 1])
