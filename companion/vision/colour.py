"""A red target by its colour, as in `kim`: the direction to the middle of the largest red patch.

A lens does not take the middle of a target to the middle of its image, a fisheye from near least of all. So the patch's outline
is laid on a level plane and the middle is taken there, where the target is flat and as large as it is.

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
_OPTICAL_AXIS = (0.0, 0.0, 1.0)
"""Taken for down where the attitude is not known."""
_SHALLOW = 0.1
"""Cosine to straight down: further out, pixels reach to the horizon and the plane says nothing."""
_NO_AREA = 1e-12
_CENTROID_SIGMA = 0.03
"""The middle of a patch is off by this fraction of its radius where shadow or glare eats at one side."""


@dataclass(frozen=True, slots=True)
class Patch:
    """A red patch: its outline (N, 2), radius of a disc of the same area, bounding box, all in pixels of the whole image."""

    outline: Array
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
        return self._bearing(frame, patch, hint)

    def _near_prediction(self, image: Image, hint: DetectionHint | None) -> Patch | None:
        where = region.predicted_region(self._extent_P, self._camera, hint) if self._track and hint else None
        if where is None:
            return None
        return largest_red_patch(image[where.top : where.bottom, where.left : where.right], where.left, where.top)

    def _bearing(self, frame: CameraImage, patch: Patch, hint: DetectionHint | None) -> PadBearing:
        down = hint.down_camera if hint is not None and hint.down_camera is not None else _OPTICAL_AXIS
        ray = middle(self._camera.ray(patch.outline), np.array(down))
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


def middle(rays: Array, down: Array) -> Array:
    """Unit direction to the middle of the area that an outline of unit rays (N, 3) encloses on a plane across `down` (3).

    Where a part of the outline hardly looks down, or it encloses nothing, the mean of the rays.
    """
    along = rays @ down
    mean: Array = rays.mean(axis=0)
    if float(along.min()) > _SHALLOW:
        on_plane = rays / along[:, None]
        mean = on_plane.mean(axis=0)
        a, b = on_plane - mean, np.roll(on_plane, -1, axis=0) - mean
        doubled = np.cross(a, b) @ down
        if abs(float(doubled.sum())) > _NO_AREA:
            mean = mean + doubled @ (a + b) / (3.0 * doubled.sum())
    return mean / float(np.linalg.norm(mean))


def red_mask(image: Image) -> Image:
    """255 where a pixel of a BGR image is red, else 0."""
    # One matrix product, rounded to whole levels and cut at zero: what is left above zero is red.
    filters = np.array([[-RED_GAIN, -RED_GAIN, 1.0, -RED_OFFSET + 1.0], [0.0, -1.0, MAX_GREEN, 1.0]])
    above = cv2.transform(image, filters)
    mask = cv2.threshold(np.min(above, axis=2), 0, 255, cv2.THRESH_BINARY)[1]
    return np.asarray(mask, dtype=np.uint8)


def largest_red_patch(image: Image, left: int, top: int) -> Patch | None:
    """The largest connected red patch of a part of the image whose corner is at (left, top); None where nothing is red."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats(red_mask(image), connectivity=8)
    if count < 2:
        return None
    areas: npt.NDArray[np.int32] = np.asarray(stats[1:, cv2.CC_STAT_AREA], dtype=np.int32)
    largest = 1 + int(areas.argmax())
    x, y, width, height, area = (int(value) for value in stats[largest])
    if area < _MIN_AREA_PX:
        return None
    inside = np.asarray(labels[y : y + height, x : x + width] == largest, dtype=np.uint8)
    outlines, _ = cv2.findContours(inside, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return Patch(
        outline=outlines[0].reshape(-1, 2).astype(np.float64) + (left + x, top + y),
        radius_px=math.sqrt(area / math.pi),
        box=region.Region(left + x, top + y, left + x + width, top + y + height),
    )


def _corners(box: region.Region) -> tuple[tuple[int, int], ...]:
    return ((box.left, box.top), (box.right, box.top), (box.right, box.bottom), (box.left, box.bottom))
