"""Polygons in three dimensions to polygons in the image: clipped in front of the camera and around the frame."""

from __future__ import annotations

import math

import cv2
import numpy as np

from sitl_stub.camera.image import Floats, Image
from sitl_stub.camera.projection import Projection

Box = tuple[int, int, int, int]
"""(x0, y0, x1, y1), half open."""

RECTANGLE = np.array([[1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]])
"""Signs of the corners of a rectangle (x, y): front left, front right, back right, back left."""

NEAR_M = 0.01
_MARGIN_PX = 16.0
_PIECES = 16
_SHIFT = 4


def clip_half_plane(points: Floats, signed_distance: Floats) -> Floats:
    """Sutherland and Hodgman: the part of a convex polygon (n, d) where the signed distance (n,) is not negative."""
    if not len(points) or signed_distance.min() >= 0.0:
        return points
    kept: list[Floats] = []
    for i in range(len(points)):
        a, b = signed_distance[i - 1], signed_distance[i]
        if (a < 0.0) != (b < 0.0):
            kept.append(points[i - 1] + (points[i] - points[i - 1]) * (a / (a - b)))
        if b >= 0.0:
            kept.append(points[i])
    return np.array(kept).reshape(-1, points.shape[1])


def image_polygon(points_C: Floats, projection: Projection, width_px: int, height_px: int) -> Floats:
    """(n, 2) pixels of a convex polygon given by its corners in C (m, 3), a little beyond the frame at most; (0, 2) where it
    is not in view. Curved edges of a fisheye are drawn in 16 pieces each."""
    visible = clip_half_plane(points_C, points_C[:, 2] - NEAR_M)
    if len(visible) < 3:
        return np.empty((0, 2))
    if projection.is_linear:
        return _clip_frame(projection.project(visible), width_px, height_px)
    pixels = projection.project(outline_points(visible))
    return pixels[np.isfinite(pixels).all(axis=1)]


def fill(image: Image, polygon_px: Floats, value: float | tuple[float, ...]) -> None:
    """Fill a polygon with soft edges, in place."""
    if len(polygon_px) < 3:
        return
    fixed = np.rint(np.clip(polygon_px, -4e3, 2e4) * (1 << _SHIFT)).astype(np.int32)
    colour = value if isinstance(value, tuple) else (value,) * 3
    cv2.fillPoly(image, [fixed], colour, cv2.LINE_AA, _SHIFT)


def bounds(polygon_px: Floats, width_px: int, height_px: int) -> Box | None:
    """The pixels a polygon can touch; None where it touches none."""
    if len(polygon_px) < 3:
        return None
    columns, rows = polygon_px.T.tolist()
    x0, y0 = max(0, math.floor(min(columns)) - 1), max(0, math.floor(min(rows)) - 1)
    x1, y1 = min(width_px, math.ceil(max(columns)) + 2), min(height_px, math.ceil(max(rows)) + 2)
    return (x0, y0, x1, y1) if x0 < x1 and y0 < y1 else None


def _clip_frame(polygon: Floats, width_px: int, height_px: int) -> Floats:
    if (
        len(polygon)
        and polygon.min() >= -_MARGIN_PX
        and (polygon <= (width_px + _MARGIN_PX, height_px + _MARGIN_PX)).all()
    ):
        return polygon
    for axis, sign, limit in ((0, 1.0, 0.0), (0, -1.0, width_px), (1, 1.0, 0.0), (1, -1.0, height_px)):
        if len(polygon) < 3:
            return np.empty((0, 2))
        polygon = clip_half_plane(polygon, sign * (polygon[:, axis] - limit) + _MARGIN_PX)
    return polygon


def outline_points(points: Floats) -> Floats:
    """Corners (n, d) to points along the outline, 16 an edge."""
    share = (np.arange(_PIECES) / _PIECES)[:, None]
    following = np.roll(points, -1, axis=0)
    return np.concatenate([a + (b - a) * share for a, b in zip(points, following, strict=True)])
