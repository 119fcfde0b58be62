"""Where a camera sits on the vehicle: X_BC from the configuration. Used by estimation and by whoever predicts a view.

`mount_deg` (roll, pitch, yaw) turns the camera from the reference mount, which looks straight down with the top of its image
towards the nose: R_BC = R_zyx(yaw, pitch, roll) R_BC(down). Positive pitch lifts the optical axis from down towards the
nose; pitch 90 looks forward with the image upright.
"""

from __future__ import annotations

import math

from companion import config
from companion.geometry import (
    Q_FRD_CAMERA_DOWN,
    Transform,
    quaternion_from_euler,
    quaternion_multiply,
    quaternion_normalized,
)


def mounted(camera: config.Camera) -> Transform:
    """X_BC: takes points in the camera's optical frame to the body frame, metres."""
    roll, pitch, yaw = (math.radians(angle) for angle in camera.mount_deg)
    q = quaternion_multiply(quaternion_from_euler(roll, pitch, yaw), Q_FRD_CAMERA_DOWN)
    return Transform(q=quaternion_normalized(q), p=camera.position_frd_m)
