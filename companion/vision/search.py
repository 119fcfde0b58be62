"""Markers anywhere in an image, coarse to fine.

Most of the time a marker is large enough to be read at a quarter of the image's size, for a sixteenth of the work. Finer levels
follow only where that shows nothing, so that speed costs no range. Each level looks at the candidates of best contrast.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from companion.messages import Image
from companion.vision import edges
from companion.vision.camera_model import Array
from companion.vision.codes import CodeBook
from companion.vision.quads import dark_quads


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """A marker in the image: corners (4, 2) clockwise from its top-left one, and how well its code was read (0 to 1)."""

    marker_id: int
    corners: Array
    correlation: float


@dataclass(frozen=True, slots=True)
class Level:
    """One pass over the image shrunk by `shrink`; the sides sought are in pixels of the shrunk image."""

    shrink: int
    contrast: float
    limit: int
    window_px: int = 13
    min_side_px: float = 8.0
    max_side_px: float = 160.0


LEVELS = (Level(4, 5.0, 25), Level(2, 6.0, 40, max_side_px=64.0), Level(1, 6.0, 60, max_side_px=48.0))
"""Coarse to fine. Averaging takes the noise away that would ask for more contrast; a finer level looks only for what the
coarser ones cannot read."""


COARSEST = Level(8, 5.0, 25)
"""Only in pictures so large that a marker may fill them and yet be too large for the first of LEVELS."""


def coarse_to_fine(grey: Image, book: CodeBook) -> Iterator[list[Found]]:
    """Markers level by level, of those that show any; a level is searched when it is asked for. Corners are good to about half
    a pixel of their level."""
    first, *finer = LEVELS
    is_large = min(grey.shape) > first.shrink * first.max_side_px
    for level in (first, COARSEST, *finer) if is_large else LEVELS:
        found = at_level(grey, book, level)
        if found:
            yield found


def all_found(grey: Image, book: CodeBook) -> list[Found]:
    """Markers of all levels, the same marker once: slow, for single images."""
    kept: list[Found] = []
    for level in (
        Level(1, 5.0, 2000),
        Level(1, 10.0, 2000),
        Level(1, 16.0, 2000, window_px=9),
        Level(2, 8.0, 2000),
        Level(4, 8.0, 2000),
    ):
        kept += [new for new in at_level(grey, book, level) if not any(_same(new, old) for old in kept)]
    return kept


def at_level(grey: Image, book: CodeBook, level: Level) -> list[Found]:
    """Markers of one pass; their corners in pixels of the whole image."""
    image = shrunk(grey, level.shrink)
    quads = dark_quads(
        image,
        window_px=level.window_px,
        contrast=level.contrast,
        min_side_px=level.min_side_px,
        max_side_px=level.max_side_px,
        limit=level.limit,
    )
    if len(quads) == 0:
        return []
    side = np.linalg.norm(quads[:, 0] - quads[:, 2], axis=1) * 0.7
    quads, _ = edges.refined(image, quads, reach_px=np.clip(0.08 * side, 1.5, 6.0))
    best: list[Found] = []
    for reading in sorted(book.read(image, quads), key=lambda reading: -reading.correlation):
        corners = np.roll(quads[reading.candidate], -reading.first_corner, axis=0)
        found = Found(reading.marker_id, (corners + 0.5) * level.shrink - 0.5, reading.correlation)
        if not any(_same(found, other) for other in best):
            best.append(found)
    return best


def shrunk(grey: Image, factor: int) -> Image:
    """Averaged over blocks of factor x factor pixels; rows and columns that fill no block are left out."""
    if factor == 1:
        return grey
    height, width = (length - length % factor for length in grey.shape)
    size = (width // factor, height // factor)
    return np.asarray(cv2.resize(grey[:height, :width], size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _same(a: Found, b: Found) -> bool:
    """Two readings of one marker: same id, centres closer than half a side."""
    apart = float(np.linalg.norm(a.corners.mean(axis=0) - b.corners.mean(axis=0)))
    return a.marker_id == b.marker_id and apart < 0.5 * float(np.linalg.norm(a.corners[0] - a.corners[1]))
