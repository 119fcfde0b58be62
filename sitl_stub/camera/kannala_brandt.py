"""Fisheye of Kannala and Brandt (2006), OpenCV's fisheye model; `distortion` = (k1, k2, k3, k4) or ().

theta = angle from the optical axis, theta_d = theta (1 + k1 theta2 + k2 theta4 + k3 theta6 + k4 theta8); the pixel lies
theta_d focal lengths from the centre. It sees beyond 90 degrees.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sitl_stub.camera.image import Floats
from sitl_stub.camera.projection import Intrinsics

_NEWTON_STEPS = 12


@dataclass(frozen=True, slots=True)
class KannalaBrandt:
    intrinsics: Intrinsics
    coefficients: tuple[float, float, float, float]

    @property
    def is_linear(self) -> bool:
        return False

    def project(self, points_C: Floats) -> Floats:
        x, y, z = points_C[:, 0], points_C[:, 1], points_C[:, 2]
        off_axis = np.hypot(x, y)
        theta = np.arctan2(off_axis, z)
        scale = self._theta_d(theta) / np.where(off_axis > 1e-12, off_axis, 1.0)
        k = self.intrinsics
        return np.stack([k.fx_px * x * scale + k.cx_px, k.fy_px * y * scale + k.cy_px], axis=1)

    def rays(self, pixels: Floats) -> Floats:
        k = self.intrinsics
        x, y = (pixels[:, 0] - k.cx_px) / k.fx_px, (pixels[:, 1] - k.cy_px) / k.fy_px
        theta_d = np.hypot(x, y)
        theta = self._theta(theta_d)
        scale = np.sin(theta) / np.where(theta_d > 1e-12, theta_d, 1.0)
        return np.stack([x * scale, y * scale, np.cos(theta)], axis=1)

    def _theta_d(self, theta: Floats) -> Floats:
        k1, k2, k3, k4 = self.coefficients
        t2 = theta * theta
        return theta * (1.0 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))))

    def _theta(self, theta_d: Floats) -> Floats:
        """Newton's method from theta = theta_d, held within half a turn."""
        k1, k2, k3, k4 = self.coefficients
        theta = np.minimum(theta_d, np.pi)
        for _ in range(_NEWTON_STEPS):
            t2 = theta * theta
            slope = 1.0 + t2 * (3.0 * k1 + t2 * (5.0 * k2 + t2 * (7.0 * k3 + t2 * 9.0 * k4)))
            theta = np.clip(theta - (self._theta_d(theta) - theta_d) / slope, 0.0, np.pi)
        return theta


def kannala_brandt(intrinsics: Intrinsics) -> KannalaBrandt:
    """ValueError for more than four coefficients."""
    given = intrinsics.distortion
    if len(given) > 4:
        raise ValueError(f"kannala_brandt distortion is (k1, k2, k3, k4), not {given}")
    k1, k2, k3, k4 = given + (0.0,) * (4 - len(given))
    return KannalaBrandt(intrinsics, (k1, k2, k3, k4))
