"""Where in the image the board's corners have been: a grid of cells, for the terminal and for the verdict.

A lens is known where it was looked through. Cells that a fisheye's round image does not reach do not count against it.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

COLUMNS, ROWS = 8, 6
SHADES = "·░▒▓█"
FULL = 8
"""Corners that make a cell as dark as it gets."""


class Coverage:
    """Counts of corners in COLUMNS x ROWS cells of an image."""

    def __init__(self, width_px: int, height_px: int, *, is_round: bool = False) -> None:
        self._size = (width_px, height_px)
        self.counts: npt.NDArray[np.int64] = np.zeros((ROWS, COLUMNS), np.int64)
        y, x = np.mgrid[0:ROWS, 0:COLUMNS]
        x, y = (x + 0.5) / COLUMNS * 2.0 - 1.0, (y + 0.5) / ROWS * 2.0 - 1.0
        self._matters = (x * x + y * y <= 1.0) if is_round else np.ones((ROWS, COLUMNS), bool)

    def add(self, pixels: npt.NDArray[np.float64]) -> int:
        """How many cells that were empty these corners are in."""
        before = self.counts.copy()
        columns = np.clip((pixels[:, 0] + 0.5) / self._size[0] * COLUMNS, 0, COLUMNS - 1).astype(int)
        rows = np.clip((pixels[:, 1] + 0.5) / self._size[1] * ROWS, 0, ROWS - 1).astype(int)
        np.add.at(self.counts, (rows, columns), 1)
        return int(np.count_nonzero((before == 0) & (self.counts > 0)))

    @property
    def fraction(self) -> float:
        """Of the cells that matter, those with at least one corner."""
        return float(np.count_nonzero((self.counts > 0) & self._matters) / np.count_nonzero(self._matters))

    def grid(self) -> str:
        """One line a row, two characters a cell; blank where it does not matter."""
        return "\n".join("".join(2 * (self._shade(row, column)) for column in range(COLUMNS)) for row in range(ROWS))

    def missing(self) -> str:
        """Words for the emptiest side: where to hold the board next."""
        empty = (self.counts == 0) & self._matters
        if not empty.any():
            return ""
        half_x, half_y = COLUMNS // 2, ROWS // 2
        sides = {
            "left": empty[:, :half_x].sum(),
            "right": empty[:, half_x:].sum(),
            "top": empty[:half_y].sum(),
            "bottom": empty[half_y:].sum(),
        }
        return max(sides, key=lambda side: int(sides[side]))

    def _shade(self, row: int, column: int) -> str:
        count = int(self.counts[row, column])
        if count == 0 and not self._matters[row, column]:
            return " "
        return SHADES[0] if count == 0 else SHADES[1 + min(3, count * 4 // (FULL + 1))]
