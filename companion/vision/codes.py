"""Which marker a quadrangle holds: the middles of its cells compared with the codes of the pad's markers.

Cells are read through the homography of the four corners, all candidates in one vectorised call. A candidate must be dark
along its border, light around it, and match a code in one of the four rotations, both bit by bit and in grey levels.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from companion.messages import Image
from companion.vision.camera_model import Array

MIN_CORRELATION = 0.7
"""Between grey levels and code. Readings of ground that look like a code by chance stay below 0.5."""
MIN_CONTRAST = 8.0
"""Grey levels between the border and what surrounds it."""


_NO_MAP: Any = None


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """One candidate that is a marker. Its corner `first_corner` is the marker's top-left one."""

    candidate: int
    marker_id: int
    first_corner: int
    correlation: float


class CodeBook:
    """The codes that may be met: the ids of one pad, or a whole family.

    `readable[id]` (cells, cells) is False where another marker covers a cell; such cells are not compared.
    """

    def __init__(
        self,
        dictionary: cv2.aruco.Dictionary,
        ids: list[int],
        readable: dict[int, npt.NDArray[np.bool_]] | None = None,
    ) -> None:
        self._ids = ids
        self._cells = int(dictionary.markerSize)
        whole = np.ones((self._cells, self._cells), dtype=bool)
        bits = np.stack([_bits(dictionary, marker_id) for marker_id in ids])
        compared = np.stack([(readable or {}).get(marker_id, whole) for marker_id in ids])
        self._compare = _turned(compared)
        codes = _turned(bits) * self._compare
        self._to_wrong, self._ones = (self._compare - 2.0 * codes).T, codes.sum(axis=1)
        self._signed, self._compared_cells = (2.0 * codes - self._compare).T, self._compare.sum(axis=1)
        # A family with many ids must be read almost exactly; a few ids may have an eighth of their bits wrong.
        allowed = self._compared_cells // 8 if len(ids) <= 8 else dictionary.maxCorrectionBits // 2
        self._max_wrong = np.maximum(1.0, np.broadcast_to(allowed, len(ids) * 4))
        self._grid = _grid(self._cells)

    def read(self, grey: Image, quads: Array) -> list[Reading]:
        """Markers among candidates (M, 4, 2), whose corners run clockwise from any corner."""
        if len(quads) == 0:
            return []
        code, border, around = self._sampled(grey, quads)
        black, white = border.sum(axis=1) / border.shape[1], around.sum(axis=1) / around.shape[1]
        middle = (black + white)[:, None] / 2.0
        framed = (
            (white - black >= MIN_CONTRAST)
            & (np.count_nonzero(border < middle, axis=1) >= 0.85 * border.shape[1])
            & (np.count_nonzero(around > middle, axis=1) >= 0.7 * around.shape[1])
        )
        wrong, correlation = self._compared(code, middle, black, white)
        best = np.argmax(correlation - wrong, axis=1)
        pick = np.arange(len(quads))
        good = framed & (wrong[pick, best] <= self._max_wrong[best]) & (correlation[pick, best] >= MIN_CORRELATION)
        return [
            Reading(int(m), self._ids[int(best[m]) // 4], (-int(best[m])) % 4, float(correlation[m, best[m]]))
            for m in np.flatnonzero(good)
        ]

    def _sampled(self, grey: Image, quads: Array) -> tuple[Array, Array, Array]:
        """Grey levels of the code's cells, of the border's cells, and of the ground just outside."""
        at = _mapped(self._grid, quads).astype(np.float32)
        values = cv2.remap(grey, at, _NO_MAP, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        inside, frame = self._cells**2, 4 * (self._cells + 1)
        levels = values.astype(np.float64)
        return levels[:, :inside], levels[:, inside : inside + frame], levels[:, inside + frame :]

    def _compared(self, code: Array, middle: Array, black: Array, white: Array) -> tuple[Array, Array]:
        """(M, codes) wrong bits and correlation in grey levels, over the cells that are compared."""
        wrong = (code > middle).astype(np.float64) @ self._to_wrong + self._ones
        levels = np.clip((code - middle) / np.maximum(white - black, 1.0)[:, None], -0.75, 0.75)
        size = np.sqrt((levels * levels) @ self._compare.T * self._compared_cells)
        return wrong, levels @ self._signed / np.maximum(size, 1e-9)


def _turned(cells: npt.NDArray[Any]) -> Array:
    """(ids * 4, cells) rows: each table of cells as read from a quadrangle that starts at each of its corners."""
    turned = np.stack([np.rot90(cells, k, axes=(1, 2)) for k in range(4)], axis=1)
    return turned.reshape(len(cells) * 4, -1).astype(np.float64)


def _bits(dictionary: cv2.aruco.Dictionary, marker_id: int) -> npt.NDArray[np.uint8]:
    cells = int(dictionary.markerSize)
    image = cv2.aruco.generateImageMarker(dictionary, marker_id, cells + 2)
    return np.asarray(image[1:-1, 1:-1] > 127, dtype=np.uint8)


def _grid(cells: int) -> Array:
    """Middles of cells on the unit square: code row by row, the border ring, and a ring 0.4 of a cell outside."""
    n = cells + 2
    middle = (np.arange(n) + 0.5) / n
    code = [(u, v) for v in middle[1:-1] for u in middle[1:-1]]
    border = [(u, v) for v in middle for u in middle if not (middle[0] < u < middle[-1] and middle[0] < v < middle[-1])]
    low, high = -0.4 / n, 1.0 + 0.4 / n
    around = [p for m in middle for p in ((m, low), (m, high), (low, m), (high, m))]
    return np.array([(u, v, 1.0) for u, v in code + border + around])


def _mapped(points: Array, quads: Array) -> Array:
    """(M, N, 2) pixels of unit-square points (N, 3: u, v, 1) under the homographies of the quadrangles (corner 0 at the origin)."""
    p0, p1, p2, p3 = quads[:, 0], quads[:, 1], quads[:, 2], quads[:, 3]
    d1, d2, s = p1 - p2, p3 - p2, p0 - p1 + p2 - p3
    below = d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0]
    below = np.where(np.abs(below) < 1e-9, 1e-9, below)
    g = (s[:, 0] * d2[:, 1] - s[:, 1] * d2[:, 0]) / below
    h = (d1[:, 0] * s[:, 1] - d1[:, 1] * s[:, 0]) / below
    columns = np.empty((len(quads), 3, 3))
    columns[:, 0, :2], columns[:, 0, 2] = p1 - p0 + g[:, None] * p1, g
    columns[:, 1, :2], columns[:, 1, 2] = p3 - p0 + h[:, None] * p3, h
    columns[:, 2, :2], columns[:, 2, 2] = p0, 1.0
    at = points @ columns
    scale = at[..., 2:]
    return np.asarray(at[..., :2] / np.where(np.abs(scale) < 1e-6, 1e-6, scale))
