"""Pinhole camera with Brown-Conrady distortion; `distortion` = (k1, k2, p1, p2, k3) as OpenCV orders them, or ().

x' = x (1 + k1 r2 + k2 r4 + k3 r6) + 2 p1 x y + p2 (r2 + 2 x2), likewise y'; u = fx x' + cx.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sitl_stub.camera.image import Floats
from sitl_stub.camera.projection import Intrinsics

_INVERSION_STEPS = 40


@dataclass(frozen=True, slots=True)
class Pinhole:
    intrinsics: Intrinsics
    coefficients: tuple[float, float, float, float, float]

    @property
    def is_linear(self) -> bool:
        return not any(self.coefficients)

    def project(self, points_C: Floats) -> Floats:
        z = np.where(points_C[:, 2] > 1e-9, points_C[:, 2], np.nan)
        x, y = self._distorted(points_C[:, 0] / z, points_C[:, 1] / z)
        k = self.intrinsics
        pixels = np.empty((len(points_C), 2))
        pixels[:, 0], pixels[:, 1] = k.fx_px * x + k.cx_px, k.fy_px * y + k.cy_px
        return pixels

    def rays(self, pixels: Floats) -> Floats:
        k = self.intrinsics
        x, y = self._undistorted((pixels[:, 0] - k.cx_px) / k.fx_px, (pixels[:, 1] - k.cy_px) / k.fy_px)
        directions = np.stack([x, y, np.ones_like(x)], axis=1)
        unit: Floats = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        return unit

    def _distorted(self, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        if self.is_linear:
            return x, y
        dx, dy, radial = self._terms(x, y)
        return x * radial + dx, y * radial + dy

    def _undistorted(self, xd: Floats, yd: Floats) -> tuple[Floats, Floats]:
        """Fixed-point inversion; converges for every lens whose mapping is one to one over the image."""
        x, y = xd, yd
        if self.is_linear:
            return x, y
        for _ in range(_INVERSION_STEPS):
            dx, dy, radial = self._terms(x, y)
            x, y = (xd - dx) / radial, (yd - dy) / radial
        return x, y

    def _terms(self, x: Floats, y: Floats) -> tuple[Floats, Floats, Floats]:
        k1, k2, p1, p2, k3 = self.coefficients
        r2 = x * x + y * y
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        return 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x), p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y, radial


def pinhole(intrinsics: Intrinsics) -> Pinhole:
    """ValueError unless 0, 4 or 5 coefficients are given."""
    given = intrinsics.distortion
    if len(given) not in (0, 4, 5):
        raise ValueError(f"pinhole distortion is (k1, k2, p1, p2[, k3]) or empty, not {given}")
    k1, k2, p1, p2, k3 = given + (0.0,) * (5 - len(given))
    return Pinhole(intrinsics, (k1, k2, p1, p2, k3))
