"""Omnidirectional polynomial camera of Scaramuzza et al. (2006), as Kim et al. (2014) use it.

A pixel at (u, v) from the centre, rho = hypot(u, v) in pixels, looks along (u, v, f(rho)) in C with
f(rho) = a0 + a1 rho + a2 rho2 + a3 rho3 + a4 rho4; `distortion` = (a0, a1, a2, a3, a4), a0 > 0 the focal length in pixels.
Here C is optical (right, down, forward), so a lens that sees more than a pinhole has a2 < 0. fx_px and fy_px are not used.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sitl_stub.camera.image import Floats
from sitl_stub.camera.projection import Intrinsics

_NEWTON_STEPS = 6
_TABLE_PX = 4096


@dataclass(frozen=True, slots=True, eq=False)
class Scaramuzza:
    """`table_rho_px` over `table_angle_rad`: angle from the axis grows with rho up to the lens's end."""

    intrinsics: Intrinsics
    coefficients: tuple[float, ...]
    table_rho_px: Floats
    table_angle_rad: Floats

    @property
    def is_linear(self) -> bool:
        return False

    def project(self, points_C: Floats) -> Floats:
        x, y, z = points_C[:, 0], points_C[:, 1], points_C[:, 2]
        off_axis = np.hypot(x, y)
        angle = np.arctan2(off_axis, z)
        rho = self._rho(angle, off_axis, z)
        scale = np.where(angle <= self.table_angle_rad[-1], rho, np.nan) / np.where(off_axis > 1e-12, off_axis, 1.0)
        k = self.intrinsics
        return np.stack([x * scale + k.cx_px, y * scale + k.cy_px], axis=1)

    def rays(self, pixels: Floats) -> Floats:
        k = self.intrinsics
        u, v = pixels[:, 0] - k.cx_px, pixels[:, 1] - k.cy_px
        directions = np.stack([u, v, np.polynomial.polynomial.polyval(np.hypot(u, v), self.coefficients)], axis=1)
        unit: Floats = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        return unit

    def _rho(self, angle: Floats, off_axis: Floats, z: Floats) -> Floats:
        """Root of rho z = f(rho) off_axis: table, then Newton."""
        rho = np.interp(angle, self.table_angle_rad, self.table_rho_px)
        slope_of_f = np.polynomial.polynomial.polyder(np.array(self.coefficients))
        for _ in range(_NEWTON_STEPS):
            value = rho * z - np.polynomial.polynomial.polyval(rho, self.coefficients) * off_axis
            slope = z - np.polynomial.polynomial.polyval(rho, slope_of_f) * off_axis
            rho = rho - value / np.where(np.abs(slope) > 1e-12, slope, np.inf)
        return rho


def scaramuzza(intrinsics: Intrinsics) -> Scaramuzza:
    """ValueError unless a0 > 0 is given and at most a4."""
    given = intrinsics.distortion
    if not 1 <= len(given) <= 5 or not given[0] > 0.0:
        raise ValueError(f"scaramuzza distortion is (a0, a1, a2, a3, a4) with a0 > 0, not {given}")
    rho = np.linspace(0.0, _TABLE_PX, _TABLE_PX + 1)
    angle = np.arctan2(rho, np.polynomial.polynomial.polyval(rho, given))
    turning = np.flatnonzero(np.diff(angle) <= 0.0)
    end = int(turning[0]) + 1 if turning.size else rho.size
    return Scaramuzza(intrinsics, given, rho[:end], angle[:end])
