"""No motion: a pad that stands still."""

from __future__ import annotations

import numpy as np

from sitl_stub.paths.reference import Path, PathReference
from sitl_stub.section import Section


class StillSettings(Section, frozen=True, tag_field="kind", tag="still"):
    """[path] kind = "still": the carrier stands."""

    def build(self, rng: np.random.Generator) -> Path:
        return Still()


class Still:
    """Always at the origin, heading north."""

    def at(self, t_s: float) -> PathReference:
        return PathReference(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
