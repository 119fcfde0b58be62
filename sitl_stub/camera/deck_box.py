"""What belongs to the carrier besides its textured faces: the deck's sides, the shadow it throws, the back of the board, and
patches that lie on the deck."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from sitl_stub.camera.image import Floats, Image
from sitl_stub.camera.light import Light, Patch
from sitl_stub.camera.mount import Pose
from sitl_stub.camera.outline import RECTANGLE, bounds, fill, image_polygon
from sitl_stub.camera.projection import Projection
from sitl_stub.camera.scene import Scene, Surface
from sitl_stub.pad_layout import PadLayout

_SIDE_GREY = 48.0
_SUNLIT_GREY = 60.0
_BOARD_BACK_GREY = 120.0
_SHADE_REMAINING = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Side:
    """One side of the deck's box in P: corners (4, 3), the way out from the middle, and that as a unit vector."""

    face_P: Floats
    outward_P: Floats
    normal_P: Floats


def deck_corners(pad: PadLayout, down_m: float) -> Floats:
    """(4, 3) corners in P of a horizontal section of the deck's box: front left, front right, back right, back left. Shared, and
    so not to be written to."""
    return _corners(pad.length_m, pad.width_m, pad.deck_center_m, down_m)


@lru_cache(maxsize=64)
def _corners(length_m: float, width_m: float, middle_m: tuple[float, float], down_m: float) -> Floats:
    flat = RECTANGLE * (length_m / 2.0, width_m / 2.0) + middle_m
    corners = np.column_stack([flat, np.full(4, down_m)])
    corners.flags.writeable = False
    return corners


@lru_cache(maxsize=64)
def _sides(length_m: float, width_m: float, middle_m: tuple[float, float], height_m: float) -> tuple[Side, ...]:
    """The four sides of the deck's box, clockwise from the front."""
    top, bottom = (_corners(length_m, width_m, middle_m, down_m) for down_m in (0.0, height_m))
    middle = top.mean(axis=0)
    sides = []
    for i in range(4):
        j = (i + 1) % 4
        outward = (top[i] + top[j]) / 2.0 - middle
        face = np.array([top[i], top[j], bottom[j], bottom[i]])
        sides.append(Side(face, outward, outward / np.linalg.norm(outward)))
    return tuple(sides)


def paint_deck_sides(
    canvas: Image, projection: Projection, X_CW: Pose, X_WP: Pose, pad: PadLayout, light: Light
) -> None:
    """The sides that face the camera, in one shade each."""
    if pad.deck_height_m <= 0.0:
        return
    X_CP = X_CW @ X_WP
    camera_P = -(X_CP.R.T @ X_CP.p)
    for side in _sides(pad.length_m, pad.width_m, pad.deck_center_m, pad.deck_height_m):
        if (camera_P - side.face_P[0]) @ side.outward_P <= 0.0:
            continue
        face_C = side.face_P @ X_CP.R.T + X_CP.p
        polygon = image_polygon(face_C, projection, canvas.shape[1], canvas.shape[0])
        if len(polygon) < 3:
            continue
        normal_W = X_WP.R @ side.normal_P
        grey = _SIDE_GREY + _SUNLIT_GREY * max(0.0, float(normal_W @ np.array(light.sun_direction_ned)))
        fill(canvas, polygon, grey)


def paint_deck_shadow(
    canvas: Image, projection: Projection, X_CW: Pose, X_WP: Pose, scene: Scene, light: Light
) -> None:
    """Darken the ground where the deck's top hides the sun: its corners, slid down along the light."""
    sun = np.array(light.sun_direction_ned)
    if sun[2] > -0.05 or scene.pad.deck_height_m <= 0.0:
        return
    top = deck_corners(scene.pad, 0.0) @ X_WP.R.T + X_WP.p
    drop = (scene.ground_down_m - top[:, 2:3]) / -sun[2]
    thrown = top - sun * drop
    foot = top + (0.0, 0.0, 1.0) * (scene.ground_down_m - top[:, 2:3])
    hull = cv2.convexHull(np.concatenate([thrown, foot])[:, :2].astype(np.float32)).reshape(-1, 2)
    outline = np.column_stack([hull.astype(np.float64), np.full(len(hull), scene.ground_down_m)])
    darken(canvas, image_polygon(outline @ X_CW.R.T + X_CW.p, projection, *canvas.shape[1::-1]), _SHADE_REMAINING)


def paint_board_back(canvas: Image, projection: Projection, X_CS: Pose, board: Surface) -> None:
    """The side of the board without a marker, where that is the one in view."""
    if (X_CS.R.T @ X_CS.p)[2] > 0.0:
        return
    half = np.array([board.length_m / 2.0, board.width_m / 2.0, 0.0])
    corners = np.array([[1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0]]) * half
    fill(canvas, image_polygon(corners @ X_CS.R.T + X_CS.p, projection, *canvas.shape[1::-1]), _BOARD_BACK_GREY)


def paint_covers(canvas: Image, projection: Projection, X_CP: Pose, covers: Sequence[Patch]) -> None:
    """Rectangles on the deck's plane, each in its own grey."""
    for patch in covers:
        c, s = math.cos(patch.yaw_rad), math.sin(patch.yaw_rad)
        along, across = np.array([c, s, 0.0]) * patch.size_m[0] / 2.0, np.array([-s, c, 0.0]) * patch.size_m[1] / 2.0
        middle = np.array([*patch.centre_m, 0.0])
        corners = np.array([along - across, along + across, across - along, -along - across]) + middle
        polygon = image_polygon(corners @ X_CP.R.T + X_CP.p, projection, *canvas.shape[1::-1])
        fill(canvas, polygon, patch.brightness)


def darken(canvas: Image, polygon_px: Floats, remaining: float) -> None:
    """Multiply what lies inside the polygon, with soft edges, in place."""
    box = bounds(polygon_px, canvas.shape[1], canvas.shape[0])
    if box is None:
        return
    x0, y0, x1, y1 = box
    region = canvas[y0:y1, x0:x1]
    gain = np.full(region.shape, 255, np.uint8)
    fill(gain, polygon_px - (x0, y0), round(255.0 * remaining))
    cv2.multiply(region, gain, dst=region, scale=1.0 / 255.0)
