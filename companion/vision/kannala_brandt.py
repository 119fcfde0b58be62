"""Fisheye of Kannala and Brandt (OpenCV's `fisheye`, ROS's `equidistant`): the image radius is a polynomial in the angle.

theta is the angle from the optical axis, r(theta) = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8), and the
pixel lies at (cx + fx r cos(phi), cy + fy r sin(phi)). Directions beyond 90 degrees are seen too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from companion.vision.camera_model import Array

_NEWTON_STEPS = 20
_AXIS = 1e-9
"""Closer to the axis than this (radian) a point counts as on it: the direction phi is then undefined and irrelevant."""


@dataclass(frozen=True)
class KannalaBrandt:
    """See the module's text. `distortion` is () or k1 k2 k3 k4."""

    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    distortion: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if len(self.distortion) not in (0, 4):
            raise ValueError(f"kannala_brandt distortion has 0 or 4 coefficients, not {len(self.distortion)}")

    @property
    def focal_px(self) -> float:
        return (self.fx_px + self.fy_px) / 2.0

    @property
    def keeps_lines_straight(self) -> bool:
        return False

    def project(self, points_C: Array) -> Array:
        x, y, z = points_C.T
        across = np.hypot(x, y)
        theta = np.arctan2(across, z)
        factor = np.where(
            across > _AXIS * np.abs(z),
            self._radius(theta) / np.maximum(across, 1e-300),
            1.0 / np.maximum(np.abs(z), 1e-300),
        )
        return np.column_stack((self.cx_px + self.fx_px * x * factor, self.cy_px + self.fy_px * y * factor))

    def ray(self, pixels: Array) -> Array:
        m = (pixels - (self.cx_px, self.cy_px)) / (self.fx_px, self.fy_px)
        r = np.hypot(m[:, 0], m[:, 1])
        theta = self._angle(r)
        across = np.where(r > _AXIS, np.sin(theta) / np.maximum(r, 1e-300), 1.0)
        return np.column_stack((m * across[:, None], np.cos(theta)))

    def jacobian(self, points_C: Array) -> Array:
        x, y, z = points_C.T
        across2 = x * x + y * y
        across = np.sqrt(across2)
        length2 = across2 + z * z
        theta = np.arctan2(across, z)
        on_axis = across <= _AXIS * np.abs(z)
        safe = np.where(on_axis, 1.0, across)
        factor = np.where(on_axis, 1.0 / np.maximum(np.abs(z), 1e-300), self._radius(theta) / safe)
        slope = self._radius_slope(theta)
        # d(theta) = (z d(across) - across dz) / length2, and the pixel is (x, y) * r(theta) / across.
        pull = np.where(on_axis, 0.0, (slope * z / length2 - factor) / (safe * safe))
        J = np.empty((len(x), 2, 3))
        J[:, 0, 0] = factor + x * x * pull
        J[:, 1, 1] = factor + y * y * pull
        J[:, 0, 1] = J[:, 1, 0] = x * y * pull
        J[:, 0, 2] = -x * slope / length2
        J[:, 1, 2] = -y * slope / length2
        return np.asarray(J * np.array([self.fx_px, self.fy_px])[None, :, None])

    def _radius(self, theta: Array) -> Array:
        k1, k2, k3, k4 = self.distortion or (0.0, 0.0, 0.0, 0.0)
        t2 = theta * theta
        return np.asarray(theta * (1.0 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4)))))

    def _radius_slope(self, theta: Array) -> Array:
        k1, k2, k3, k4 = self.distortion or (0.0, 0.0, 0.0, 0.0)
        t2 = theta * theta
        return np.asarray(1.0 + t2 * (3.0 * k1 + t2 * (5.0 * k2 + t2 * (7.0 * k3 + t2 * 9.0 * k4))))

    def _angle(self, radius: Array) -> Array:
        """Newton's method on the monotone part of the polynomial."""
        theta = np.minimum(radius, np.pi)
        for _ in range(_NEWTON_STEPS):
            step = (radius - self._radius(theta)) / np.maximum(self._radius_slope(theta), 0.05)
            theta = np.clip(theta + step, 0.0, np.pi)
            if float(np.abs(step).max(initial=0.0)) < 1e-13:
                break
        return np.asarray(theta)
