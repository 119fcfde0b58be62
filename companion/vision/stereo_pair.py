"""The pad in two cameras side by side: position from one camera far away and from both near, whichever is more certain (`guo`).

One frame holds both pictures of one capture, left and right halves of equal width, as stereo cameras on USB deliver them; so
nothing has to be paired by time. The configured lens is that of the left half, the right one the same (rectified),
`[vision] stereo_baseline_m` to the right. Where the right half shows no marker in common, the left one stands alone.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from companion import config
from companion.geometry import Transform, matrix_from_quaternion
from companion.messages import CameraImage, PadObservation
from companion.vision import pad_layout
from companion.vision.aruco import ArucoDetector
from companion.vision.camera_model import Array, CameraModel
from companion.vision.detector import Detection, DetectionHint
from companion.vision.stereo import less_uncertain, pnp_range, stereo_range

NAME = "stereo"
MISALIGNMENT_PX = 0.1
"""Disparity by which a calibrated pair is still out of line: the tenth of a pixel that good calibrations report."""
RELATIVE_ERROR = 0.005
"""Of a range from one camera: printed size of the marker and focal length, half a per cent together."""


class StereoDetector:
    """See the module's text. Holds only what its construction gave it."""

    def __init__(self, vision: config.Vision, pad: config.Pad, camera: CameraModel) -> None:
        if vision.stereo_baseline_m <= 0.0:
            raise ValueError('[vision] detector "stereo" needs stereo_baseline_m, the distance between its two cameras')
        self._vision = vision
        self._layout = pad_layout.from_config(pad)
        self._width_px = camera.width_px // 2
        self._lens = _half_as_wide(camera)
        self._eye = ArucoDetector(vision, pad, self._lens)

    def detect(self, frame: CameraImage, hint: DetectionHint | None) -> Detection:
        """The pad in the left camera; its distance from both where that is expected to be better."""
        left = self._eye.detect(self._half(frame, 0), hint)
        left = dataclasses.replace(left, detector=NAME)
        if not isinstance(left, PadObservation):
            return left
        right = self._eye.detect(self._half(frame, self._width_px), self._seen_from_the_right(left, hint))
        return self._ranged(left, right) if isinstance(right, PadObservation) else left

    def _half(self, frame: CameraImage, first: int) -> CameraImage:
        half = np.ascontiguousarray(frame.image[:, first : first + self._width_px])
        return dataclasses.replace(frame, image=half)

    def _seen_from_the_right(self, left: PadObservation, hint: DetectionHint | None) -> DetectionHint:
        """The left pose, moved: good to a few sigma of the left position and to the half per cent of its range."""
        assert left.q_camera_pad is not None
        x, y, z = left.pad_position_camera_m
        moved = Transform(left.q_camera_pad, (x - self._vision.stereo_baseline_m, y, z))
        sigma_m = RELATIVE_ERROR * z + max(left.position_covariance_m2[k][k] for k in range(3)) ** 0.5
        return DetectionHint(moved, sigma_m, hint.down_camera if hint is not None else None)

    def _ranged(self, left: PadObservation, right: PadObservation) -> PadObservation:
        """The left observation with the distance of less variance; the position moves along its line of sight."""
        common = [marker_id for marker_id in left.marker_ids if marker_id in right.marker_ids]
        if not common:
            return left
        depth_m = self._depth_m(left, common)
        pnp = pnp_range((0.0, 0.0, depth_m), left.position_covariance_m2, relative_error=RELATIVE_ERROR)
        both = stereo_range(
            _corners(left, common),
            _corners(right, common),
            self._lens,
            baseline_m=self._vision.stereo_baseline_m,
            sigma_px=self._vision.pixel_sigma_px,
            misalignment_px=MISALIGNMENT_PX,
        )
        best = less_uncertain(pnp, both)
        if best is pnp:
            return left
        position = np.array(left.pad_position_camera_m) * (best.range_m / depth_m)
        return dataclasses.replace(
            left,
            pad_position_camera_m=tuple(position.tolist()),
            position_covariance_m2=_with_range_sigma(left.position_covariance_m2, position, best.sigma_m),
        )

    def _depth_m(self, left: PadObservation, marker_ids: list[int]) -> float:
        """Depth of the corners where the left pose puts them, averaged as disparities average: by its inverse."""
        assert left.q_camera_pad is not None
        points_P = np.concatenate([self._layout.corners_P[marker_id] for marker_id in marker_ids])
        ahead = np.array(matrix_from_quaternion(left.q_camera_pad))[2]
        return float(1.0 / np.mean(1.0 / (points_P @ ahead + left.pad_position_camera_m[2])))


def _half_as_wide(camera: CameraModel) -> CameraModel:
    """The lens of one half of the frame."""
    lens: Any = camera
    half: CameraModel = dataclasses.replace(lens, width_px=camera.width_px // 2)
    return half


def _corners(observation: PadObservation, marker_ids: list[int]) -> Array:
    """(4 * markers, 2) pixels in the order of the ids."""
    quads = np.array(observation.corners_px).reshape(-1, 4, 2)
    return np.concatenate([quads[observation.marker_ids.index(marker_id)] for marker_id in marker_ids])


def _with_range_sigma(covariance_m2: Any, position_m: Array, sigma_m: float) -> Any:
    """The covariance across the line of sight as it was, along it that of the range."""
    sight = position_m / np.linalg.norm(position_m)
    across = np.eye(3) - np.outer(sight, sight)
    new = across @ np.array(covariance_m2) @ across + sigma_m**2 * np.outer(sight, sight)
    return tuple(tuple(row) for row in new.tolist())
