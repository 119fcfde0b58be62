"""Edges of a face against what is behind it: which pixels an edge touches, and how two greys mix there."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from sitl_stub.camera.image import Floats, Image

Integers = npt.NDArray[np.intp]

_REACH_PX = 2


def edge_pixels(polygon: Floats, width: int, height: int) -> tuple[Integers, Integers]:
    """(columns, rows) within two pixels of the polygon's outline, inside the frame. Some stand in the list twice."""
    columns, rows = [], []
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        x, y = _line_pixels(a, b) if abs(b[0] - a[0]) >= abs(b[1] - a[1]) else _line_pixels(a[::-1], b[::-1])[::-1]
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


def _line_pixels(a: Floats, b: Floats) -> tuple[Integers, Integers]:
    """Pixels along a line that runs mainly in the first coordinate."""
    first, last = sorted((float(a[0]), float(b[0])))
    along = np.arange(int(np.floor(first)) - _REACH_PX, int(np.ceil(last)) + _REACH_PX + 1)
    slope = (b[1] - a[1]) / (b[0] - a[0]) if b[0] != a[0] else 0.0
    across = np.floor(a[1] + (along - a[0]) * slope).astype(np.intp)
    offsets = np.arange(-_REACH_PX + 1, _REACH_PX + 1)
    return np.repeat(along, len(offsets)), (across[:, None] + offsets).ravel()
