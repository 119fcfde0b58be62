"""Could something be in the picture at all? A cone around the optical axis that holds every pixel, and a sphere."""

from __future__ import annotations

import math

import numpy as np

from companion.geometry import norm
from companion.messages import Vec3
from companion.vision.camera_model import CameraModel


def half_field_rad(camera: CameraModel) -> float:
    """Angle between the optical axis and the furthest corner of the picture."""
    right, bottom = camera.width_px - 1.0, camera.height_px - 1.0
    rays = camera.ray(np.array([(0.0, 0.0), (right, 0.0), (right, bottom), (0.0, bottom)]))
    lengths = np.linalg.norm(rays, axis=1)
    return float(np.arccos(np.clip(rays[:, 2] / lengths, -1.0, 1.0)).max())


def may_be_in_view(p_CP: Vec3, spread_m: float, half_field_rad: float) -> bool:
    """Whether a sphere of radius `spread_m` around p_CP (in C, m) touches the cone of the picture."""
    distance = norm(p_CP)
    if distance <= spread_m:
        return True
    off_axis = math.acos(max(-1.0, min(1.0, p_CP[2] / distance)))
    return off_axis - math.asin(spread_m / distance) <= half_field_rad
