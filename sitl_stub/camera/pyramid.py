"""A texture and its halvings, so that whatever is drawn small is drawn by area and does not alias.

Level k has texels 2^k times as large; texel centres follow (i + 0.5) 2^k - 0.5 in texels of level 0. Halving averages 2 x 2
texels, which keeps every edge where it is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from sitl_stub.camera.image import Floats, Image

_COARSER = 0.1
"""Found by measuring edges over random views from 5 to 16 m: mean error at most 0.016 px. With finer levels (-0.3) a pad from 12 m up is
drawn up to 0.3 % too large, with coarser ones (0.2) edges along pixel rows are off by up to 0.09 px. The time of a frame is the same."""
_MOST_TEXELS_PER_PX = 2.0 ** (0.5 + _COARSER)


@dataclass(frozen=True, slots=True, eq=False)
class Pyramid:
    """`levels[0]` is the texture; `metres_per_texel` is that of level 0."""

    levels: tuple[Image, ...]
    metres_per_texel: float

    def level_for(self, texels_per_px: float) -> int:
        """The level with 0.76 to 1.52 texels a pixel, where there is one: with more, pixels would miss texels; with much fewer, the texels'
        own halving moves edges outwards."""
        if not texels_per_px > _MOST_TEXELS_PER_PX:
            return 0
        return min(len(self.levels) - 1, round(math.log2(texels_per_px) - _COARSER))


def build_pyramid(texture: Image, metres_per_texel: float, *, smallest_px: int = 2) -> Pyramid:
    """Halve until a side would be shorter than `smallest_px`. Odd sides are first extended by their last row or column, so
    that texels keep their size."""
    levels = [np.ascontiguousarray(texture)]
    while min(levels[-1].shape[:2]) >= 2 * smallest_px:
        levels.append(_halved(levels[-1]))
    return Pyramid(tuple(levels), metres_per_texel)


def level_from_base(level: int) -> Floats:
    """3 x 3 matrix from texel coordinates of level 0 to those of `level`."""
    scale = 0.5**level
    shift = 0.5 * scale - 0.5
    return np.array([[scale, 0.0, shift], [0.0, scale, shift], [0.0, 0.0, 1.0]])


def _halved(image: Image) -> Image:
    rows, columns = image.shape[:2]
    even = cv2.copyMakeBorder(image, 0, rows % 2, 0, columns % 2, cv2.BORDER_REPLICATE)
    half = cv2.resize(even, ((columns + 1) // 2, (rows + 1) // 2), interpolation=cv2.INTER_AREA)
    return np.asarray(half, np.uint8)
