"""Omnidirectional camera after Scaramuzza, as in `kim`: the ray of a pixel is (u, v, f(rho)).

u and v are the pixel's offsets from the centre, rho their length, f(rho) = a0 + a1 rho + a2 rho^2 + a3 rho^3 + a4 rho^4 with
a0 = fx_px (so that near the axis it is a pinhole) and `distortion` = a1 a2 a3 a4. Optical axis forward: f is positive in
front of the camera and falls below zero beyond 90 degrees. fy_px other than fx_px stretches v. Projection solves
f(rho) = rho cot(theta) for the smallest positive rho.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from companion.vision.camera_model import Array, unit_rows

_NEWTON_STEPS = 30
_AXIS = 1e-9


@dataclass(frozen=True)
class Scaramuzza:
    """See the module's text. `distortion` is () or a1 a2 a3 a4 (px^0, 1/px, 1/px^2, 1/px^3)."""

    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    distortion: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if len(self.distortion) not in (0, 4):
            raise ValueError(f"scaramuzza distortion has 0 or 4 coefficients (a1 to a4), not {len(self.distortion)}")

    @property
    def focal_px(self) -> float:
        return self.fx_px

    @property
    def keeps_lines_straight(self) -> bool:
        return not any(self.distortion)

    def ray(self, pixels: Array) -> Array:
        uv = (pixels - (self.cx_px, self.cy_px)) * (1.0, self.fx_px / self.fy_px)
        rho = np.hypot(uv[:, 0], uv[:, 1])
        return unit_rows(np.column_stack((uv, self._f(rho))))

    def project(self, points_C: Array) -> Array:
        x, y, z = points_C.T
        across = np.hypot(x, y)
        rho = self._radius(across, z)
        factor = np.where(across > _AXIS * np.abs(z), rho / np.maximum(across, 1e-300), self.fx_px / np.abs(z))
        return np.column_stack((self.cx_px + x * factor, self.cy_px + y * factor * (self.fy_px / self.fx_px)))

    def jacobian(self, points_C: Array) -> Array:
        x, y, z = points_C.T
        across = np.hypot(x, y)
        rho = self._radius(across, z)
        on_axis = across <= _AXIS * np.abs(z)
        safe = np.where(on_axis, 1.0, across)
        factor = np.where(on_axis, self.fx_px / np.abs(z), rho / safe)
        # rho z = across f(rho): differentiate both sides for d(rho)/d(across) and d(rho)/dz.
        below = z - across * self._slope(rho)
        by_across, by_z = self._f(rho) / below, -rho / below
        pull = np.where(on_axis, 0.0, (by_across - factor) / (safe * safe))
        along = np.where(on_axis, -self.fx_px / (z * z), by_z / safe)
        J = np.empty((len(x), 2, 3))
        J[:, 0, 0] = factor + x * x * pull
        J[:, 1, 1] = factor + y * y * pull
        J[:, 0, 1] = J[:, 1, 0] = x * y * pull
        J[:, 0, 2] = x * along
        J[:, 1, 2] = y * along
        return np.asarray(J * np.array([1.0, self.fy_px / self.fx_px])[None, :, None])

    def _f(self, rho: Array) -> Array:
        a1, a2, a3, a4 = self.distortion or (0.0, 0.0, 0.0, 0.0)
        return np.asarray(self.fx_px + rho * (a1 + rho * (a2 + rho * (a3 + rho * a4))))

    def _slope(self, rho: Array) -> Array:
        a1, a2, a3, a4 = self.distortion or (0.0, 0.0, 0.0, 0.0)
        return np.asarray(a1 + rho * (2.0 * a2 + rho * (3.0 * a3 + rho * 4.0 * a4)))

    def _radius(self, across: Array, z: Array) -> Array:
        """Smallest rho > 0 with rho z = across f(rho), by Newton inside a bracket that starts at the axis."""
        low = np.zeros_like(across)
        high = np.full_like(across, 2.0 * float(np.hypot(self.width_px, self.height_px)))
        rho = np.minimum(self.fx_px * np.arctan2(across, z), high)
        for _ in range(_NEWTON_STEPS):
            error = rho * z - across * self._f(rho)
            low, high = np.where(error < 0.0, rho, low), np.where(error >= 0.0, rho, high)
            slope = z - across * self._slope(rho)
            step = rho - error / np.where(slope == 0.0, 1e-300, slope)
            moved = np.where((step > low) & (step < high), step, 0.5 * (low + high))
            done = float(np.abs(moved - rho).max(initial=0.0)) < 1e-12 * self.fx_px
            rho = moved
            if done:
                break
        return np.asarray(rho)
