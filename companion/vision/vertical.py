"""The upright marker at the end of a deck, as in `guo`: a detector for it and the yaw error the paper steers by.

The marker faces back, towards a vehicle that comes from behind, and the camera looks forward; the pose is that of the
landing point, which lies in front of the marker. All markers are found as `aruco` finds them (it knows where each stands).
"""

from __future__ import annotations

import math

from companion import config
from companion.geometry import Transform, rotate
from companion.messages import Vec3
from companion.vision.aruco import ArucoDetector
from companion.vision.camera_model import CameraModel


def vertical_detector(vision: config.Vision, pad: config.Pad, camera: CameraModel) -> ArucoDetector:
    """ValueError where no marker of the pad stands upright: the configuration names the wrong detector or the wrong pad."""
    if not any(marker.facing == "back" for marker in pad.markers):
        raise ValueError('[vision] detector "vertical" needs a pad with a marker that faces "back"')
    return ArucoDetector(vision, pad, camera)


def yaw_error_rad(X_CP: Transform) -> float:
    """How far the camera must turn to the right (clockwise from above) to look along the pad's x axis, rad.

    The paper's atan2(R13, R33) of the marker's rotation: the marker's normal is P x, and its first and third components
    in C are how far it points to the right and ahead.
    """
    x_C: Vec3 = rotate(X_CP.q, (1.0, 0.0, 0.0))
    return math.atan2(x_C[0], x_C[2])
