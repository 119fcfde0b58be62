"""ArUco and AprilTag pads: one marker, a board of several, or markers nested in each other, as one landing point.

With a prediction only the part of the image where the pad must be is searched, scaled down where the pad fills the frame;
where that finds nothing the whole frame is. Corners are refined at full resolution and all markers go into one pose.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from companion import config
from companion.geometry import matrix_from_quaternion
from companion.messages import CameraImage, Image, PadNotSeen, PadObservation
from companion.vision import edges, pad_layout, pose
from companion.vision.camera_model import Array, CameraModel
from companion.vision.detector import Detection, DetectionHint

NAME = "aruco"


@dataclass(frozen=True, slots=True)
class Region:
    """A part of the image, in whole pixels: left and top inside, right and bottom outside."""

    left: int
    top: int
    right: int
    bottom: int


class ArucoDetector:
    """See the module's text. Holds only what its construction gave it."""

    def __init__(self, vision: config.Vision, pad: config.Pad, camera: CameraModel) -> None:
        self._vision = vision
        self._camera = camera
        self._layout = pad_layout.from_config(pad)
        self._ids = sorted(self._layout.corners_P)
        family = pad_layout.dictionary(pad.family)
        own = cv2.aruco.Dictionary(family.bytesList[self._ids], family.markerSize, family.maxCorrectionBits)
        self._fast = cv2.aruco.ArucoDetector(own, _parameters(window_px=(13, 13, 10)))
        self._thorough = cv2.aruco.ArucoDetector(own, _parameters(window_px=(3, 23, 10)))

    def detect(self, frame: CameraImage, hint: DetectionHint | None) -> Detection:
        """`PadObservation`, or `PadNotSeen` with the reason."""
        grey = grey_of(frame.image)
        markers = self._markers(grey, hint)
        if not markers:
            return PadNotSeen(frame.t_ns, frame.camera, NAME, "no marker")
        return self._observation(frame, self._refined(grey, markers), hint)

    def _markers(self, grey: Image, hint: DetectionHint | None) -> dict[int, Array]:
        """Corners (4, 2) by id, unrefined."""
        if self._vision.track and hint is not None:
            region = predicted_region(self._layout.extent_P, self._camera, hint)
            if region is not None:
                found = self._in_region(grey, region)
                if found:
                    return found
        return self._found(self._fast, grey) or self._found(self._thorough, grey)

    def _in_region(self, grey: Image, region: Region) -> dict[int, Array]:
        part = grey[region.top : region.bottom, region.left : region.right]
        scale = min(1.0, _SEARCH_SIDE_PX / max(part.shape))
        if scale < 1.0:
            part = np.asarray(cv2.resize(part, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), dtype=np.uint8)
        offset = np.array([region.left, region.top], dtype=np.float64)
        return {
            marker_id: (corners + 0.5) / scale - 0.5 + offset
            for marker_id, corners in self._found(self._fast, part).items()
        }

    def _found(self, detector: cv2.aruco.ArucoDetector, grey: Image) -> dict[int, Array]:
        corners, indices, _ = detector.detectMarkers(grey)
        if indices is None:
            return {}
        return {
            self._ids[int(index)]: quad.reshape(4, 2).astype(np.float64)
            for quad, index in zip(corners, indices.reshape(-1), strict=True)
        }

    def _refined(self, grey: Image, markers: dict[int, Array]) -> dict[int, Array]:
        if self._vision.refine == "none":
            return markers
        quads = np.stack(list(markers.values()))
        if self._vision.refine == "subpix":
            return dict(zip(markers, _subpix(grey, quads), strict=True))
        side = np.linalg.norm(quads - np.roll(quads, 1, axis=1), axis=2).mean(axis=1)
        cell = side / (self._layout.cells + 2)
        for reach in (np.clip(0.5 * cell, 1.5, 6.0), np.clip(0.5 * cell, 1.5, 2.5)):
            quads, _ = edges.refined(grey, quads, reach_px=reach)
        return dict(zip(markers, quads, strict=True))

    def _observation(self, frame: CameraImage, markers: dict[int, Array], hint: DetectionHint | None) -> Detection:
        points_P = np.concatenate([self._layout.corners_P[marker_id] for marker_id in markers])
        pixels = np.concatenate(list(markers.values()))
        found = pose.planar_pose(points_P, pixels, self._camera, hint=hint, sigma_px=self._vision.pixel_sigma_px)
        if found is None:
            return PadNotSeen(frame.t_ns, frame.camera, NAME, "corners have no pose")
        if found.reprojection_error_px > self._vision.max_reprojection_error_px:
            return PadNotSeen(frame.t_ns, frame.camera, NAME, f"reprojection {found.reprojection_error_px:.1f} px")
        return PadObservation(
            t_ns=frame.t_ns,
            camera=frame.camera,
            detector=NAME,
            pad_position_camera_m=found.position_m,
            position_covariance_m2=found.position_covariance_m2,
            q_camera_pad=found.q,
            rotation_covariance_rad2=found.rotation_covariance_rad2,
            q_camera_pad_alternative=found.q_alternative,
            marker_ids=tuple(markers),
            corners_px=tuple((float(u), float(v)) for u, v in pixels),
            reprojection_error_px=found.reprojection_error_px,
        )


_SEARCH_SIDE_PX = 240.0
"""A region larger than this is searched at reduced size: enough pixels for every cell of the outer marker."""
_MARGIN = 0.25
"""The region searched is this fraction of the pad's image larger on each side, besides three sigma of the prediction."""


def grey_of(image: Image) -> Image:
    """The image itself when it is grey already."""
    return image if image.ndim == 2 else np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)


def predicted_region(extent_P: Array, camera: CameraModel, hint: DetectionHint) -> Region | None:
    """Where the pad must be in the image; None where the prediction cannot say."""
    if hint.X_CP is None:
        return None
    R = np.array(matrix_from_quaternion(hint.X_CP.q))
    points_C = extent_P @ R.T + np.array(hint.X_CP.p)
    distance = float(np.linalg.norm(hint.X_CP.p))
    if float(points_C[:, 2].min()) <= 0.0 or distance <= 3.0 * hint.position_sigma_m:
        return None
    pixels = camera.project(points_C)
    if not np.isfinite(pixels).all():
        return None
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    margin = _MARGIN * float((high - low).max()) + 3.0 * hint.position_sigma_m * camera.focal_px / distance + 4.0
    left, top = np.maximum(np.floor(low - margin), 0).astype(int)
    right, bottom = np.minimum(np.ceil(high + margin), (camera.width_px, camera.height_px)).astype(int)
    return Region(int(left), int(top), int(right), int(bottom)) if right - left >= 8 and bottom - top >= 8 else None


def _parameters(window_px: tuple[int, int, int]) -> cv2.aruco.DetectorParameters:
    parameters = cv2.aruco.DetectorParameters()
    parameters.adaptiveThreshWinSizeMin, parameters.adaptiveThreshWinSizeMax, parameters.adaptiveThreshWinSizeStep = (
        window_px
    )
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_NONE
    return parameters


def _subpix(grey: Image, quads: Array) -> Array:
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 30, 0.01)
    corners = quads.reshape(-1, 1, 2).astype(np.float32)
    return np.asarray(cv2.cornerSubPix(grey, corners, (3, 3), (-1, -1), criteria), dtype=np.float64).reshape(-1, 4, 2)
