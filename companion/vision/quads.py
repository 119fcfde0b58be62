"""Dark quadrangles on light ground: the candidates for markers, found without looking at every contour.

Threshold against the local mean, label connected dark regions, keep those of plausible size, rank them by contrast, and look
outside-in along rays from each one's middle: where a closed outline is met, its four corners follow. Everything after the
labelling is vectorised over the candidates.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
import numpy.typing as npt

from companion.messages import Image
from companion.vision.camera_model import Array

RAYS = 48
_STEPS = 16
_ANGLES = np.arange(RAYS) * (2.0 * math.pi / RAYS)
_DIRECTIONS = np.column_stack((np.cos(_ANGLES), np.sin(_ANGLES)))
_INWARD = np.linspace(1.0, 0.25, _STEPS)
"""Where on a ray from the edge of the bounding box (1) to its middle (0) the outline may lie."""
Labels = npt.NDArray[np.int32]
Stats = npt.NDArray[np.int32]
"""Rows as OpenCV's connectedComponentsWithStats gives them: left, top, width, height, area."""
_MIN_CLOSED = 0.9
"""Fraction of the rays that must meet the outline."""


def dark_quads(
    grey: Image, *, window_px: int, contrast: float, min_side_px: float, max_side_px: float, limit: int
) -> Array:
    """(M, 4, 2) corners clockwise as seen in the image, best contrast first, good to about a tenth of a side.

    `window_px` (odd) is the neighbourhood of the local mean, `contrast` how much darker than it a pixel must be, `limit`
    how many candidates are looked at.
    """
    labels, stats, numbers = _labelled(
        grey, window_px, contrast, min_side_px=min_side_px, max_side_px=max_side_px, limit=limit
    )
    return _outlined(labels, stats[numbers], numbers)


def dark_regions(grey: Image, *, window_px: int, contrast: float, min_side_px: float, limit: int) -> list[Array]:
    """Outer contours (N, 2) of the dark regions of best contrast, whatever their shape; N at least 12."""
    labels, stats, numbers = _labelled(
        grey, window_px, contrast, min_side_px=min_side_px, max_side_px=float(max(grey.shape)), limit=limit
    )
    contours = []
    for number in numbers:
        left, top, width, height = (int(value) for value in stats[number, :4])
        part = np.asarray(labels[top : top + height, left : left + width] == number, dtype=np.uint8)
        found, _ = cv2.findContours(part, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        contour = max(found, key=len).reshape(-1, 2)
        if len(contour) >= 12:
            contours.append(np.asarray(contour + (left, top), dtype=np.float64))
    return contours


def _labelled(
    grey: Image, window_px: int, contrast: float, *, min_side_px: float, max_side_px: float, limit: int
) -> tuple[Labels, Stats, npt.NDArray[np.int64]]:
    """Label image, statistics, and the labels of plausible size, best contrast first where there are too many."""
    mean = cv2.blur(grey, (window_px, window_px))
    darkness = np.asarray(cv2.subtract(mean, grey), dtype=np.uint8)
    _, dark = cv2.threshold(darkness, contrast, 255, cv2.THRESH_BINARY)
    # Eight neighbours and this algorithm: a third less time than OpenCV's default choice.
    _, labels_, stats_, _ = cv2.connectedComponentsWithStatsWithAlgorithm(dark, 8, cv2.CV_32S, cv2.CCL_BBDT)
    labels, stats = np.asarray(labels_, dtype=np.int32), np.asarray(stats_, dtype=np.int32)
    numbers = _plausible(stats, min_side_px, max_side_px)
    if len(numbers) > limit:
        numbers = _strongest(darkness, stats, numbers, limit)
    return labels, stats, numbers


def _plausible(stats: Stats, min_side_px: float, max_side_px: float) -> npt.NDArray[np.int64]:
    """Labels whose box and area could be the outline of a square seen at a slant."""
    width, height, area = stats[:, 2], stats[:, 3], stats[:, 4]
    shorter, longer = np.minimum(width, height), np.maximum(width, height)
    fits = (shorter >= min_side_px) & (longer <= max_side_px) & (longer <= 5 * shorter) & (area >= width + height)
    fits[0] = False  # the ground
    return np.flatnonzero(fits)


def _strongest(darkness: Image, stats: Stats, numbers: npt.NDArray[np.int64], limit: int) -> npt.NDArray[np.int64]:
    """The `limit` labels with most darkness in their box for the length of its outline."""
    total = cv2.integral(darkness)
    left, top, width, height = stats[numbers, :4].T
    inside = total[top + height, left + width] - total[top, left + width] - total[top + height, left] + total[top, left]
    score = inside / (width + height)
    return numbers[np.argsort(-score, kind="stable")[:limit]]


def _outlined(labels: Labels, stats: Stats, numbers: npt.NDArray[np.int64]) -> Array:
    """A few rays throw out what is not closed, the rest get all rays."""
    for directions in (_DIRECTIONS[:: RAYS // 8], _DIRECTIONS):
        if len(numbers) == 0:
            return np.empty((0, 4, 2))
        centre, outline, met = _outline(labels, stats, numbers, directions)
        closed = met.mean(axis=1) >= _MIN_CLOSED * (1.0 - 1.0 / len(directions))
        stats, numbers = stats[closed], numbers[closed]
    return _quads(outline[closed], met[closed], centre[closed])


def _outline(
    labels: Labels, stats: Stats, numbers: npt.NDArray[np.int64], directions: Array
) -> tuple[Array, Array, npt.NDArray[np.bool_]]:
    """Middles (M, 2), where each ray (M, rays, 2) first meets the region from outside, and whether it does."""
    left, top, width, height = stats[:, :4].T
    half = np.column_stack((width - 1, height - 1)) / 2.0
    centre = np.column_stack((left, top)) + half
    to_box = (half[:, None, :] / np.maximum(np.abs(directions), 1e-9)[None]).min(axis=2)
    radii = (to_box[:, :, None] * _INWARD).astype(np.float32)
    start = (centre + 0.5).astype(np.float32)
    column = (start[:, 0, None, None] + directions[None, :, 0, None].astype(np.float32) * radii).astype(np.int32)
    row = (start[:, 1, None, None] + directions[None, :, 1, None].astype(np.float32) * radii).astype(np.int32)
    hit = labels.reshape(-1).take(row * labels.shape[1] + column) == numbers[:, None, None].astype(np.int32)
    first = hit.argmax(axis=2)
    radius = np.take_along_axis(radii, first[..., None], axis=2)[..., 0] + 0.5  # the outer side of the pixel met
    return centre, centre[:, None, :] + directions[None] * radius[..., None].astype(np.float64), hit.any(axis=2)


def _quads(outline: Array, met: npt.NDArray[np.bool_], centre: Array) -> Array:
    """Corners of outlines (M, RAYS, 2) that are quadrangles: farthest point, its opposite, and the extremes across."""
    pick = np.arange(len(outline))
    reach = np.where(met, np.sum((outline - centre[:, None, :]) ** 2, axis=2), 0.0)
    a = outline[pick, reach.argmax(axis=1)]
    c = outline[pick, np.where(met, np.sum((outline - a[:, None, :]) ** 2, axis=2), 0.0).argmax(axis=1)]
    across = np.where(met, _cross((c - a)[:, None, :], outline - a[:, None, :]), 0.0)
    b, d = outline[pick, across.argmin(axis=1)], outline[pick, across.argmax(axis=1)]
    quads = np.stack((a, b, c, d), axis=1)
    quads = np.where((_area(quads) < 0.0)[:, None, None], quads[:, ::-1], quads)
    return quads[_is_quad(quads, outline, met)]


def _is_quad(quads: Array, outline: Array, met: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Convex, not a sliver, and the outline lies along its sides."""
    edge = np.roll(quads, -1, axis=1) - quads
    length = np.maximum(np.linalg.norm(edge, axis=2), 1e-9)
    turn = _cross(edge, np.roll(edge, -1, axis=1))
    normal = np.stack((-edge[..., 1], edge[..., 0]), axis=2) / length[..., None]
    offset = np.einsum("mki,mei->mke", outline, normal) - np.einsum("mei,mei->me", quads, normal)[:, None, :]
    distance = np.where(met, np.abs(offset).min(axis=2), 0.0)
    side = length.mean(axis=1)
    off = distance > (0.05 * side + 1.0)[:, None]
    return np.asarray(
        (turn > 0.0).all(axis=1) & (length.min(axis=1) > 0.25 * length.max(axis=1)) & (off.mean(axis=1) < 0.15)
    )


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _area(quads: Array) -> Array:
    """Twice the signed area: positive where the corners run clockwise as seen in the image."""
    return np.asarray(_cross(quads, np.roll(quads, -1, axis=1)).sum(axis=1))
