"""Where in the image the pad must be, from a prediction of its pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from companion.geometry import Transform, matrix_from_quaternion, norm
from companion.vision.camera_model import Array, CameraModel
from companion.vision.detector import DetectionHint

MARGIN = 0.25
"""A region is this fraction of the pad's image larger on each side, besides three sigma of the prediction."""
ROTATION_SIGMA_RAD = 0.03
"""How far a predicted pose is turned against the true one: attitude error, and the pad's yaw."""


@dataclass(frozen=True, slots=True)
class Region:
    """A part of the image, in whole pixels: left and top inside, right and bottom outside."""

    left: int
    top: int
    right: int
    bottom: int


def projected(points_P: Array, X_CP: Transform, camera: CameraModel) -> Array:
    """(N, 2) pixels of points of the pad; NaN where the lens cannot see them."""
    R = np.array(matrix_from_quaternion(X_CP.q))
    return camera.project(points_P @ R.T + np.array(X_CP.p))


def reach_px(hint: DetectionHint, camera: CameraModel, size_m: float) -> float:
    """Three sigma of where a corner of something of that size appears around its predicted place."""
    assert hint.X_CP is not None
    sigma_m = float(np.hypot(hint.position_sigma_m, ROTATION_SIGMA_RAD * size_m))
    return 3.0 * sigma_m * camera.focal_px / max(norm(hint.X_CP.p), 1e-6)


def predicted_region(extent_P: Array, camera: CameraModel, hint: DetectionHint) -> Region | None:
    """The part of the image that holds the whole pad; None where the prediction cannot say."""
    if hint.X_CP is None or norm(hint.X_CP.p) <= 3.0 * hint.position_sigma_m:
        return None
    pixels = projected(extent_P, hint.X_CP, camera)
    if not np.isfinite(pixels).all():
        return None
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    margin = MARGIN * float((high - low).max()) + reach_px(hint, camera, 0.0) + 4.0
    left, top = np.maximum(np.floor(low - margin), 0).astype(int)
    right, bottom = np.minimum(np.ceil(high + margin), (camera.width_px, camera.height_px)).astype(int)
    return Region(int(left), int(top), int(right), int(bottom)) if right - left >= 8 and bottom - top >= 8 else None
