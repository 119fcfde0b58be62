"""Edges of a face against what is behind it: which pixels an edge touches, and how two greys mix there."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from sitl_stub.camera.image import Floats, Image

Integers = npt.NDArray[np.intp]

_REACH_PX = 2
_OFFSETS: Integers = np.arange(-_REACH_PX + 1, _REACH_PX + 1)


def edge_pixels(polygon: Floats, width: int, height: int) -> tuple[Integers, Integers]:
    """(columns, rows) within two pixels of the polygon's outline, inside the frame. Some stand in the list twice."""
    columns, rows = [], []
    corners = polygon.tolist()
    for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True):
        if abs(bx - ax) >= abs(by - ay):
            x, y = _line_pixels(ax, ay, bx, by)
        else:
            y, x = _line_pixels(ay, ax, by, bx)
        columns.append(x)
        rows.append(y)
    x, y = np.concatenate(columns), np.concatenate(rows)
    within = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    return x[within], y[within]


def blend_edges(region: Image, rows: Integers, columns: Integers, behind: Image, front: Image, share: Floats) -> None:
    """region[rows, columns] = front by `share`, the rest from behind; in place."""
    weight = share[:, None] if region.ndim == 3 else share
    mixed = behind + (front.astype(np.float64) - behind) * weight
    region[rows, columns] = np.rint(mixed).astype(np.uint8)


def _line_pixels(a0: float, a1: float, b0: float, b1: float) -> tuple[Integers, Integers]:
    """Pixels along a line from a to b that runs mainly in the first coordinate."""
    along = np.arange(math.floor(min(a0, b0)) - _REACH_PX, math.ceil(max(a0, b0)) + _REACH_PX + 1)
    slope = (b1 - a1) / (b0 - a0) if b0 != a0 else 0.0
    across = np.floor(a1 + (along - a0) * slope).astype(np.intp)
    return along.repeat(len(_OFFSETS)), (across[:, None] + _OFFSETS).ravel()
