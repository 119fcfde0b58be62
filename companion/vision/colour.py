"""A red target by its colour, as in `kim`: the direction to the middle of the largest red patch.

A pixel is red where R >= K (G + B) + C and not G > 0.6 R (which is orange and yellow). The paper prints neither K nor C; K
0.75 and C 20 keep a red of a shaded 90 to 35 and refuse skin, brick and sand. The result is a bearing: the estimator turns it
into a place with the height above the pad.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from companion import config
from companion.messages import CameraImage, Image, PadBearing, PadNotSeen
from companion.vision import region
from companion.vision.camera_model import Array, CameraModel
from companion.vision.detector import Detection, DetectionHint

NAME = "colour"
RED_GAIN = 0.75
RED_OFFSET = 20.0
MAX_GREEN = 0.6
"""K, C and the mask of the text above."""
_MIN_AREA_PX = 12
"""Smaller patches are noise of the sensor."""
_CENTROID_SIGMA = 0.03
"""The middle of a patch is off by this fraction of its radius where shadow or glare eats at one side."""


@dataclass(frozen=True, slots=True)
class Patch:
    """A red patch: its centroid, radius of a disc of the same area, bounding box, all in pixels of the whole image."""

    u: float
    v: float
    radius_px: float
    box: region.Region


class ColourDetector:
    """See the module's text. Needs a colour camera."""

    def __init__(self, vision: config.Vision, pad: config.Pad, camera: CameraModel) -> None:
        half_x, half_y = pad.length_m / 2.0, pad.width_m / 2.0
        self._extent_P = np.array([(x, y, 0.0) for x in (-half_x, half_x) for y in (-half_y, half_y)])
        self._camera = camera
        self._track = vision.track
        self._pixel_sigma_px = vision.pixel_sigma_px

    def detect(self, frame: CameraImage, hint: DetectionHint | None) -> Detection:
        """`PadBearing`, or `PadNotSeen` with the reason."""
        if frame.image.ndim != 3:
            return PadNotSeen(frame.t_ns, frame.camera, NAME, "the frame has no colour")
        patch = self._near_prediction(frame.image, hint) or largest_red_patch(frame.image, 0, 0)
        if patch is None:
            return PadNotSeen(frame.t_ns, frame.camera, NAME, "nothing red")
        return self._bearing(frame, patch)

    def _near_prediction(self, image: Image, hint: DetectionHint | None) -> Patch | None:
        where = region.predicted_region(self._extent_P, self._camera, hint) if self._track and hint else None
        if where is None:
            return None
        return largest_red_patch(image[where.top : where.bottom, where.left : where.right], where.left, where.top)

    def _bearing(self, frame: CameraImage, patch: Patch) -> PadBearing:
        ray: Array = self._camera.ray(np.array([(patch.u, patch.v)]))[0]
        error_px = math.hypot(self._pixel_sigma_px, _CENTROID_SIGMA * patch.radius_px)
        if self._is_cut(patch.box):
            error_px = math.hypot(error_px, 0.5 * patch.radius_px)
        box = patch.box
        return PadBearing(
            t_ns=frame.t_ns,
            camera=frame.camera,
            detector=NAME,
            bearing_camera=(float(ray[0]), float(ray[1]), float(ray[2])),
            sigma_rad=error_px / self._camera.focal_px,
            corners_px=tuple((float(u), float(v)) for u, v in _corners(box)),
        )

    def _is_cut(self, box: region.Region) -> bool:
        """A patch that touches the border goes on beyond it: its middle is not where it seems."""
        return (
            box.left <= 0 or box.top <= 0 or box.right >= self._camera.width_px or box.bottom >= self._camera.height_px
        )


def red_mask(image: Image) -> Image:
    """255 where a pixel of a BGR image is red, else 0."""
    # One matrix product, rounded to whole levels and cut at zero: what is left above zero is red.
    filters = np.array([[-RED_GAIN, -RED_GAIN, 1.0, -RED_OFFSET + 1.0], [0.0, -1.0, MAX_GREEN, 1.0]])
    above = cv2.transform(image, filters)
    mask = cv2.threshold(np.min(above, axis=2), 0, 255, cv2.THRESH_BINARY)[1]
    return np.asarray(mask, dtype=np.uint8)


def largest_red_patch(image: Image, left: int, top: int) -> Patch | None:
    """The largest connected red patch of a part of the image whose corner is at (left, top); None where nothing is red."""
    count, _, stats, centroids = cv2.connectedComponentsWithStats(red_mask(image), connectivity=8)
    if count < 2:
        return None
    areas: npt.NDArray[np.int32] = np.asarray(stats[1:, cv2.CC_STAT_AREA], dtype=np.int32)
    largest = 1 + int(areas.argmax())
    x, y, width, height, area = (int(value) for value in stats[largest])
    if area < _MIN_AREA_PX:
        return None
    return Patch(
        u=float(centroids[largest, 0]) + left,
        v=float(centroids[largest, 1]) + top,
        radius_px=math.sqrt(area / math.pi),
        box=region.Region(left + x, top + y, left + x + width, top + y + height),
    )


def _corners(box: region.Region) -> tuple[tuple[int, int], ...]:
    return ((box.left, box.top), (box.right, box.top), (box.right, box.bottom), (box.left, box.bottom))
