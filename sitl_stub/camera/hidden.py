"""Which parts of the frame the deck's top hides: there the ground need not be painted."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sitl_stub.camera.image import Floats
from sitl_stub.camera.mount import Pose
from sitl_stub.camera.outline import Box
from sitl_stub.camera.projection import Projection
from sitl_stub.pad_layout import PadLayout

TILE_PX = 96
"""A multiple of the curved painter's steps."""

_MARGIN = 1.05
"""Between the corners of a tile a curved edge may bulge; this is more than it does."""

_LOW_RAY = 0.05
_WORTH_IT = 0.7
"""Each box costs a little; a small deck is better painted over."""


@dataclass(frozen=True, slots=True, eq=False)
class HiddenByDeck:
    """`rays_C` (rows + 1, columns + 1, 3) look through the corners of the frame's tiles."""

    rays_C: Floats
    width_px: int
    height_px: int
    pad: PadLayout

    def boxes(self, X_CP: Pose) -> list[Box]:
        """Regions of the frame, in whole tiles, that together hold everything but the deck's inside."""
        camera_P = -(X_CP.R.T @ X_CP.p)
        if camera_P[2] >= 0.0:
            return [(0, 0, self.width_px, self.height_px)]
        rays_P = self.rays_C @ X_CP.R
        reach = -camera_P[2] / np.maximum(rays_P[..., 2:], _LOW_RAY)
        away = np.abs(camera_P[:2] + rays_P[..., :2] * reach - self.pad.deck_center_m) * _MARGIN
        inside = (away < (self.pad.length_m / 2.0, self.pad.width_m / 2.0)).all(axis=-1) & (rays_P[..., 2] > _LOW_RAY)
        hidden = inside[:-1, :-1] & inside[1:, :-1] & inside[:-1, 1:] & inside[1:, 1:]
        if hidden.mean() < _WORTH_IT:
            return [(0, 0, self.width_px, self.height_px)]
        return self._open(hidden.tolist())

    def _open(self, hidden: list[list[bool]]) -> list[Box]:
        """Rows of tiles that are open in the same columns are taken together."""
        boxes: list[Box] = []
        top = 0
        for row in range(1, len(hidden) + 1):
            if row < len(hidden) and hidden[row] == hidden[top]:
                continue
            y0, y1 = top * TILE_PX, min(row * TILE_PX, self.height_px)
            boxes += [(x0, y0, min(x1, self.width_px), y1) for x0, x1 in _open_runs(hidden[top])]
            top = row
        return boxes


def hidden_by_deck(projection: Projection, width_px: int, height_px: int, pad: PadLayout) -> HiddenByDeck:
    columns, rows = math.ceil(width_px / TILE_PX), math.ceil(height_px / TILE_PX)
    x = np.minimum(np.arange(columns + 1) * TILE_PX, width_px - 1).astype(np.float64)
    y = np.minimum(np.arange(rows + 1) * TILE_PX, height_px - 1).astype(np.float64)
    right, down = np.meshgrid(x, y)
    rays = projection.rays(np.column_stack([right.ravel(), down.ravel()]))
    return HiddenByDeck(rays.reshape(rows + 1, columns + 1, 3), width_px, height_px, pad)


def _open_runs(hidden: list[bool]) -> list[tuple[int, int]]:
    """(first pixel, end) of the runs of False."""
    runs = []
    start: int | None = None
    for column, is_hidden in enumerate([*hidden, True]):
        if not is_hidden and start is None:
            start = column
        elif is_hidden and start is not None:
            runs.append((start * TILE_PX, column * TILE_PX))
            start = None
    return runs
