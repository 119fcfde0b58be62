"""Which views to keep while somebody waves a board in front of a camera.

A view is worth keeping when the board is still (a moving one is blurred, and skewed by a rolling shutter) and differs from
those kept: elsewhere in the image, nearer or farther, or tilted otherwise. Pictures of a folder were chosen by hand: all are kept.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np

from companion.calibration.board import Board, BoardView, find
from companion.calibration.coverage import Coverage
from companion.messages import Image

STILL_PX = 1.5
NEW_SHARE = 0.08
"""Of the image's width: so far the board's outline must have moved, on average, to be a new view."""


@dataclass(slots=True)
class Collection:
    """Views so far, and what the latest picture was good for."""

    board: Board
    is_live: bool
    is_round: bool = False
    views: list[BoardView] = field(default_factory=list)
    coverage: Coverage | None = None
    size: tuple[int, int] | None = None
    pictures: int = 0
    said: str = ""
    _outlines: list[np.ndarray] = field(default_factory=list)
    _last: BoardView | None = None

    def add(self, image: Image | None, name: str = "") -> bool:
        """Whether the picture was kept; `said` has the reason. ValueError where its size differs from the others'."""
        self.pictures += 1
        if image is None:
            return self._refuse("not a readable picture")
        size = (image.shape[1], image.shape[0])
        if self.size is None:
            self.size, self.coverage = size, Coverage(*size, is_round=self.is_round)
        elif size != self.size:
            raise ValueError(f"{name or 'a picture'} has {size} px, the others {self.size}: one camera, one size")
        view = find(self.board, image)
        if view is None:
            self._last = None
            return self._refuse("no board found")
        still = self._is_still(view)
        self._last = view
        if self.is_live and not still:
            return self._refuse("hold still")
        return self._keep(BoardView(view.board_points, view.pixels, name))

    def _keep(self, view: BoardView) -> bool:
        assert self.coverage is not None
        outline = _outline(self.board, view)
        if self.is_live and not self._is_new(outline):
            side = self.coverage.missing()
            return self._refuse(f"seen already; try the {side}" if side else "seen already; tilt it")
        self._outlines.append(outline)
        self.views.append(view)
        self.coverage.add(view.pixels)
        self.said = f"kept: {len(view.pixels)} corners"
        return True

    def _refuse(self, reason: str) -> bool:
        self.said = reason
        return False

    def _is_still(self, view: BoardView) -> bool:
        if self._last is None or len(self._last.pixels) != len(view.pixels):
            return False
        if not np.array_equal(self._last.board_points, view.board_points):
            return False
        return float(np.abs(view.pixels - self._last.pixels).mean()) <= STILL_PX

    def _is_new(self, outline: np.ndarray) -> bool:
        assert self.size is not None
        least = NEW_SHARE * self.size[0]
        return all(float(np.linalg.norm(outline - other, axis=1).mean()) > least for other in self._outlines)


def _outline(board: Board, view: BoardView) -> np.ndarray:
    """(4, 2) the whole board's corners in pixels, also where only a part of it was seen."""
    w, h = board.columns * board.square_m, board.rows * board.square_m
    H, _ = cv2.findHomography(view.board_points[:, :2], view.pixels)
    corners = np.array([[[0.0, 0.0], [w, 0.0], [w, h], [0.0, h]]])
    if H is None:
        return np.asarray(view.pixels[[0, 0, -1, -1]])
    return np.asarray(cv2.perspectiveTransform(corners, H)[0])
