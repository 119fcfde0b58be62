"""One independent random generator per purpose, all from the scenario's seed.

A purpose keeps its stream whatever the others draw, so that switching gusts off does not change the beacon's error.
"""

from __future__ import annotations

import zlib

import numpy as np


def generator(seed: int, purpose: str) -> np.random.Generator:
    """The generator of that purpose ("wind", "beacon", "camera down", ...)."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(zlib.crc32(purpose.encode()),)))
