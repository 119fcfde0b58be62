"""Calibration boards: what is printed, and where its corners are in a picture.

Board frame: x right, y down, z into the board, origin at the top left corner of the board's squares, metres, as OpenCV numbers
them. ChArUco is the default: it may stick out of the picture, so that it reaches the edges of the image, where the distortion is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
import numpy.typing as npt

from companion.calibration.sheet import Rectangle
from companion.messages import Image

Points = npt.NDArray[np.float64]
MIN_CORNERS = 8
FAMILY = "DICT_5X5_250"
"""Not the family of the default pad: nobody lands on a calibration board."""


@dataclass(frozen=True, slots=True)
class Board:
    """Counts are squares; `marker_share` is the side of a marker over that of its square (ChArUco)."""

    kind: Literal["charuco", "chessboard"] = "charuco"
    columns: int = 8
    rows: int = 6
    square_m: float = 0.03
    marker_share: float = 0.75

    def __post_init__(self) -> None:
        if not (3 <= self.columns <= 40 and 3 <= self.rows <= 40):
            raise ValueError(f"a board has 3 to 40 squares each way, not {self.columns} x {self.rows}")
        if not 0.001 <= self.square_m <= 1.0:
            raise ValueError(f"a square has 1 mm to 1 m, not {self.square_m * 1000:g} mm")
        if self.kind == "charuco" and self.columns * self.rows // 2 > 250:
            raise ValueError(f"{self.columns} x {self.rows} squares need more than the 250 markers of {FAMILY}")


@dataclass(frozen=True, slots=True, eq=False)
class BoardView:
    """The board in one picture: (N, 3) corners on the board, metres, and (N, 2) the same in pixels."""

    board_points: Points
    pixels: Points
    name: str = ""


def find(board: Board, image: Image) -> BoardView | None:
    """The corners to a fraction of a pixel; None where the board is not there, or too little of it."""
    grey = image if image.ndim == 2 else np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)
    if min(grey.shape) < 32:
        return None
    view = _find_charuco(board, grey) if board.kind == "charuco" else _find_chessboard(board, grey)
    return view if view is not None and _spans_an_area(view.board_points) else None


def squares(board: Board) -> list[Rectangle]:
    """The black rectangles of the board, metres from its top left corner."""
    s = board.square_m
    black = [
        Rectangle(column * s, row * s, s, s)
        for row in range(board.rows)
        for column in range(board.columns)
        if (row + column) % 2 == 0
    ]
    return black + (_markers(board) if board.kind == "charuco" else [])


def charuco(board: Board) -> cv2.aruco.CharucoBoard:
    """OpenCV's board; its top left square is black."""
    family = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, FAMILY))
    size = (board.columns, board.rows)
    return cv2.aruco.CharucoBoard(size, board.square_m, board.square_m * board.marker_share, family)


def _markers(board: Board) -> list[Rectangle]:
    """Every marker as its black frame and cells, one rectangle a cell."""
    made = charuco(board)
    cells = int(made.getDictionary().markerSize) + 2
    black: list[Rectangle] = []
    for marker_id, corners in zip(np.ravel(made.getIds()), made.getObjPoints(), strict=True):
        bits = cv2.aruco.generateImageMarker(made.getDictionary(), int(marker_id), cells)
        x0, y0, _ = (float(v) for v in np.min(np.asarray(corners), axis=0))
        cell = board.square_m * board.marker_share / cells
        black += [
            Rectangle(x0 + int(column) * cell, y0 + int(row) * cell, cell, cell)
            for row, column in np.argwhere(bits == 0)
        ]
    return black


def _find_charuco(board: Board, grey: Image) -> BoardView | None:
    made = charuco(board)
    corners, ids, _, _ = cv2.aruco.CharucoDetector(made).detectBoard(grey)
    if np.size(ids) < MIN_CORNERS:  # None where there is no board
        return None
    points = np.asarray(made.getChessboardCorners(), np.float64)[np.ravel(ids)]
    return BoardView(points, np.asarray(corners, np.float64).reshape(-1, 2))


def _find_chessboard(board: Board, grey: Image) -> BoardView | None:
    inner = (board.columns - 1, board.rows - 1)
    found, corners = cv2.findChessboardCornersSB(grey, inner, flags=cv2.CALIB_CB_NORMALIZE_IMAGE)
    if not found:
        return None
    points = [
        ((i % inner[0] + 1) * board.square_m, (i // inner[0] + 1) * board.square_m, 0.0)
        for i in range(inner[0] * inner[1])
    ]
    return BoardView(np.array(points), np.asarray(corners, np.float64).reshape(-1, 2))


def _spans_an_area(points: Points) -> bool:
    """Corners of a single row give no pose."""
    if len(points) < MIN_CORNERS:
        return False
    return bool(np.linalg.svd(points[:, :2] - points[:, :2].mean(axis=0), compute_uv=False)[1] > 1e-6)
