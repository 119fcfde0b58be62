"""One independent random generator per purpose, all from the scenario's seed.

A purpose keeps its stream whatever the others draw, so that switching gusts off does not change the beacon's error.
"""

from __future__ import annotations

import zlib

import numpy as np


def generator(seed: int, purpose: str) -> np.random.Generator:
    """The generator of that purpose ("wind", "beacon", "camera down", ...)."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(zlib.crc32(purpose.encode()),)))


_BLOCK = 256


class NormalDraws:
    """A generator's standard normal numbers one by one in its own order, but drawn in blocks: a fraction of the time. Nobody else may
    draw from the generator."""

    __slots__ = ("_ready", "_rng")

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._ready: list[float] = []

    def standard_normal(self) -> float:
        """The next number."""
        if not self._ready:
            self._ready = self._rng.standard_normal(_BLOCK)[::-1].tolist()
        return self._ready.pop()
