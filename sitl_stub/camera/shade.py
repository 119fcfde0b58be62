"""A shadow's straight edge over deck and ground, and the sun's glare on the deck, painted into the scene."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np

from sitl_stub.camera.deck_box import darken, deck_corners
from sitl_stub.camera.image import Floats, Image
from sitl_stub.camera.light import Glare, Shadow
from sitl_stub.camera.mount import Pose
from sitl_stub.camera.outline import bounds, clip_half_plane, image_polygon
from sitl_stub.camera.projection import Projection
from sitl_stub.pad_layout import PadLayout

_GROUND_REACH_M = 40.0
_SPOT_PX = 128
_SPOT_SIGMAS = 3.0


def paint_shadow_edge(
    canvas: Image, projection: Projection, X_CP: Pose, pad: PadLayout | None, shadow: Shadow | None
) -> None:
    """Darken the plane z = 0 of P beyond the edge: the deck's top, or with `pad` None the ground around."""
    if shadow is None:
        return
    reach = _GROUND_REACH_M * np.array([[1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0]])
    outline = reach if pad is None else deck_corners(pad, 0.0)
    direction = np.array([np.cos(shadow.direction_rad), np.sin(shadow.direction_rad), 0.0])
    shaded = clip_half_plane(outline, outline @ direction - shadow.offset_m)
    if len(shaded) >= 3:
        corners_C = shaded @ X_CP.R.T + X_CP.p
        darken(canvas, image_polygon(corners_C, projection, *canvas.shape[1::-1]), shadow.remaining)


def paint_glare(canvas: Image, projection: Projection, X_CP: Pose, glare: Glare | None) -> None:
    """Add a Gaussian spot on the deck's plane, clipped at full scale; nothing where it is out of view."""
    if glare is None:
        return
    x, y = glare.position_m
    reach = _SPOT_SIGMAS * glare.radius_m
    ends = np.array([[x, y, 0.0], [x, y + reach, 0.0], [x - reach, y, 0.0]])
    points = projection.project(ends @ X_CP.R.T + X_CP.p)
    box = bounds(_parallelogram(points), canvas.shape[1], canvas.shape[0]) if np.isfinite(points).all() else None
    if box is None:
        return
    x0, y0, x1, y1 = box
    half = (_SPOT_PX - 1) / 2.0
    source = np.array([[half, half], [2.0 * half, half], [half, 2.0 * half]], np.float32)
    affine = cv2.getAffineTransform(source, (points - (x0, y0)).astype(np.float32))
    spot = cv2.warpAffine(_spot(round(255.0 * min(1.0, glare.strength))), affine, (x1 - x0, y1 - y0))
    region = canvas[y0:y1, x0:x1]
    cv2.add(region, cv2.merge([spot] * 3) if canvas.ndim == 3 else spot, dst=region)


def _parallelogram(points: Floats) -> Floats:
    middle, right, down = points
    a, b = right - middle, down - middle
    return np.array([middle - a - b, middle + a - b, middle + a + b, middle - a + b])


@lru_cache(maxsize=8)
def _spot(peak: int) -> Image:
    axis = np.linspace(-_SPOT_SIGMAS, _SPOT_SIGMAS, _SPOT_PX)
    bell = np.exp(-0.5 * axis**2)
    spot: Image = np.rint(peak * np.outer(bell, bell)).astype(np.uint8)
    return spot
