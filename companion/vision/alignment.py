"""How far a predicted marker is from its place: its own picture, slid over a small copy of the image around there.

For predictions that are off by more than a cell, where an edge fit would meet the wrong edges, and still by far less than a
search of the image. Only a shift is looked for: a prediction's scale and turn are right to a few per cent and degrees.
"""

from __future__ import annotations

import cv2
import numpy as np

from companion.messages import Image
from companion.vision.camera_model import Array

TEMPLATE_PX = 24.0
"""Longer side of the small copy of the marker: three or four pixels a cell."""
LEAST_CORRELATION = 0.5
_CELL_PX = 8
_PICKED = 4
"""Of each pixel of the small copy so many pixels across are averaged."""


def picture(dictionary: cv2.aruco.Dictionary, marker_id: int) -> Image:
    """The marker seen from straight above, in a light rim one cell wide."""
    cells = int(dictionary.markerSize) + 2
    image = cv2.aruco.generateImageMarker(dictionary, marker_id, cells * _CELL_PX)
    return np.asarray(np.pad(image, _CELL_PX, constant_values=255), dtype=np.uint8)


def shift_px(grey: Image, quad: Array, marker: Image, reach_px: float) -> Array | None:
    """(2,) from the corners (4, 2) in the image to where the marker's `picture` fits best; None where it fits nowhere."""
    low, high = quad.min(axis=0), quad.max(axis=0)
    scale = min(1.0, TEMPLATE_PX / float((high - low).max()))
    small, corner = _small_copy(grey, low - reach_px, high + reach_px + 2.0, scale)
    template = _seen(marker, (quad - low) * scale, np.ceil((high - low) * scale).astype(int) + 1)
    if template.shape[0] > small.shape[0] or template.shape[1] > small.shape[1]:
        return None
    fit = cv2.matchTemplate(small, template, cv2.TM_CCOEFF_NORMED)
    _, best, _, place = cv2.minMaxLoc(fit)
    return np.asarray(np.array(place) / scale + corner - low) if best >= LEAST_CORRELATION else None


def _small_copy(grey: Image, low: Array, high: Array, scale: float) -> tuple[Image, Array]:
    """The part of the image from `low` to `high` (2,) at `scale`, and the pixel of its top left corner (2,). Beyond the image's
    border, by as much as an eighth of the part, the border goes on: a marker that is cut there is found, too."""
    height, width = grey.shape
    beyond = (high - low) / 8.0
    left, top = np.clip(low, 0.0, (width - 1, height - 1)).astype(int)
    right, bottom = np.clip(high, (left + 1, top + 1), (width, height)).astype(int)
    columns, rows = max(1, round((right - left) * scale)), max(1, round((bottom - top) * scale))
    part: Image = grey[top:bottom, left:right]
    if max(part.shape) > _PICKED * max(columns, rows):  # most pixels of a large part tell nothing more
        picked = (_PICKED * columns, _PICKED * rows)
        part = np.asarray(cv2.resize(part, picked, interpolation=cv2.INTER_NEAREST), dtype=np.uint8)
    small = cv2.resize(part, (columns, rows), interpolation=cv2.INTER_AREA)
    before = np.rint(np.clip((left, top) - low, 0.0, beyond) * scale).astype(int)
    after = np.rint(np.clip(high - (right, bottom), 0.0, beyond) * scale).astype(int)
    padded = cv2.copyMakeBorder(
        small, int(before[1]), int(after[1]), int(before[0]), int(after[0]), cv2.BORDER_REPLICATE
    )
    return np.asarray(padded, dtype=np.uint8), (left, top) - before / scale


def _seen(marker: Image, quad: Array, size: Array) -> Image:
    """The picture as the corners put it."""
    a, b = _CELL_PX - 0.5, len(marker) - _CELL_PX - 0.5
    corners = np.array(((a, a), (b, a), (b, b), (a, b)), np.float32)
    H = cv2.getPerspectiveTransform(corners, quad.astype(np.float32))
    image = cv2.warpPerspective(
        marker, H, (int(size[0]), int(size[1])), flags=cv2.INTER_AREA, borderMode=cv2.BORDER_REPLICATE
    )
    return np.asarray(image, dtype=np.uint8)
