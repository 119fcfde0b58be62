"""Range of an upright marker from two cameras side by side, and the choice between it and the range of one (`guo`).

Both cameras look along parallel axes, the right one `baseline_m` to the right; images are rectified, or the lenses are the
same and the corners are turned into rays. Range = f B / d with d the mean disparity of the four corners. Its error grows with
the square of the range, PnP's mostly with the range itself (marker size, focal length): stereo near, PnP far, and the one
with the smaller expected variance is taken.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from companion.messages import Mat3, Vec3
from companion.vision.camera_model import Array, CameraModel


@dataclass(frozen=True, slots=True)
class Range:
    """Distance along the optical axis, m, with its expected standard deviation, and which method gave it."""

    range_m: float
    sigma_m: float
    method: str


def stereo_range(
    left_px: Array, right_px: Array, camera: CameraModel, *, baseline_m: float, sigma_px: float, misalignment_px: float
) -> Range | None:
    """From the same corners (N, 2) in both images; None where they show no positive disparity.

    `sigma_px` is the standard deviation of one corner coordinate in one image, which averages out over the corners;
    `misalignment_px`, how far the two cameras are out of line after calibration, does not.
    """
    disparity = _sideways(camera.ray(left_px)) - _sideways(camera.ray(right_px))
    mean = float(disparity.mean())
    if not math.isfinite(mean) or mean <= 0.0:
        return None
    range_m = baseline_m / mean
    error_px = math.hypot(sigma_px * math.sqrt(2.0 / len(disparity)), misalignment_px)
    return Range(range_m, range_m**2 * error_px / (camera.focal_px * baseline_m), "stereo")


def pnp_range(position_camera_m: Vec3, covariance_m2: Mat3, *, relative_error: float) -> Range:
    """From the pose of one camera; `relative_error` is that of the marker's printed size, the focal length and the corners'
    bias, which does not average out."""
    sigma_m = math.hypot(math.sqrt(covariance_m2[2][2]), relative_error * position_camera_m[2])
    return Range(position_camera_m[2], sigma_m, "pnp")


def less_uncertain(pnp: Range, stereo: Range | None) -> Range:
    """Whichever has the smaller expected variance."""
    return stereo if stereo is not None and stereo.sigma_m < pnp.sigma_m else pnp


def _sideways(rays: Array) -> Array:
    """Sideways component on the plane one metre ahead."""
    return np.asarray(rays[:, 0] / rays[:, 2])
