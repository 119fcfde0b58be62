"""Views of a board by a known lens, exact or rendered; independent of the code under test but for the lens models."""

from __future__ import annotations

import functools
from typing import Any

import cv2
import numpy as np

from companion.calibration.board import Board, BoardView, squares
from companion.vision.pinhole import Pinhole

PX_PER_M = 4000.0
OVER = 2


def poses(count: int, seed: int, *, spread: float = 0.35, distance_m: tuple[float, float] = (0.25, 0.6)) -> list[Any]:
    """(R_CBoard, p_CBoard) that look at the board from all sides."""
    rng = np.random.default_rng(seed)
    found = []
    for index in range(count):
        distance = rng.uniform(*distance_m)
        tilt = np.radians(rng.uniform(10.0, 35.0)) if index % 4 else 0.0
        axis = rng.uniform(-np.pi, np.pi)
        R = cv2.Rodrigues(tilt * np.array([np.cos(axis), np.sin(axis), 0.0]))[0]
        middle = np.array(
            [rng.uniform(-spread, spread) * distance, 0.7 * rng.uniform(-spread, spread) * distance, distance]
        )
        sight = middle / np.linalg.norm(middle)
        across = np.cross([0.0, 0.0, 1.0], sight)
        turn = across / max(float(np.linalg.norm(across)), 1e-9) * np.arccos(sight[2])
        R = cv2.Rodrigues(turn)[0] @ R  # the board faces the camera, wherever it is held
        found.append((R, middle - R @ np.array([0.12, 0.09, 0.0])))
    return found


def exact_view(board: Board, lens: Any, R: Any, p: Any, rng: Any, noise_px: float) -> BoardView:
    """Inner corners that fall into the image, with noise."""
    grid = [
        (c * board.square_m, r * board.square_m, 0.0) for r in range(1, board.rows) for c in range(1, board.columns)
    ]
    points = np.array(grid)
    pixels = lens.project(points @ R.T + p)
    inside = (
        (pixels[:, 0] >= 0) & (pixels[:, 0] < lens.width_px) & (pixels[:, 1] >= 0) & (pixels[:, 1] < lens.height_px)
    )
    pixels = pixels + rng.normal(0.0, noise_px, pixels.shape)
    return BoardView(points[inside], pixels[inside])


@functools.cache
def _fine_rays(lens: Any) -> Any:
    """A direction for every quarter of a pixel, row by row."""
    x, y = np.meshgrid(np.arange(lens.width_px * OVER), np.arange(lens.height_px * OVER))
    return lens.ray((np.stack((x.ravel(), y.ravel()), 1) + 0.5) / OVER - 0.5)


def rendered(texture: Any, lens: Any, R: Any, p: Any, rng: Any) -> Any:
    """Grey picture of the printed board (PX_PER_M, origin at its corner) on grey."""
    rays = _fine_rays(lens)
    normal = R[:, 2]
    reach = (p @ normal) / (rays @ normal)
    on_board = (rays * reach[:, None] - p) @ R
    maps = [(on_board[:, k] * PX_PER_M - 0.5).reshape(OVER * lens.height_px, -1).astype(np.float32) for k in (0, 1)]
    big = cv2.remap(texture, maps[0], maps[1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=200)
    image = cv2.resize(big, (lens.width_px, lens.height_px), interpolation=cv2.INTER_AREA).astype(np.float32)
    return np.clip(image + rng.normal(0.0, 2.0, image.shape), 0, 255).astype(np.uint8)


LENS = Pinhole(480, 320, 300.0, 299.0, 236.0, 162.0, (-0.2, 0.05, 0.0, 0.0))


@functools.cache
def board_texture() -> Any:
    """The default board as printed."""
    texture = np.full((round(0.18 * PX_PER_M), round(0.24 * PX_PER_M)), 240, np.uint8)
    for r in squares(Board()):
        left, top, right, bottom = (round(v * PX_PER_M) for v in (r.x, r.y, r.x + r.width, r.y + r.height))
        texture[top:bottom, left:right] = 20
    return texture


@functools.cache
def waved_board() -> tuple[Any, ...]:
    """Pictures by LENS of the default board held at 20 places."""
    rng = np.random.default_rng(11)
    views = poses(20, 5, spread=0.55, distance_m=(0.2, 0.4))
    return tuple(rendered(board_texture(), LENS, R, p, rng) for R, p in views)
