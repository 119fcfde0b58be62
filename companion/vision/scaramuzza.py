"""Omnidirectional camera after Scaramuzza, as in `kim`: the ray of a pixel is (u, v, f(rho)).

u and v are the pixel's offsets from the centre, rho their length, f(rho) = a0 + a1 rho + a2 rho^2 + a3 rho^3 + a4 rho^4 and
`distortion` = a0 a1 a2 a3 a4. The optical axis points forward: a0 > 0 is the focal length, f falls below zero beyond 90
degrees, and fx_px, fy_px are not used. Projection solves f(rho) = rho cot(theta) for the smallest positive rho.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from companion.vision.camera_model import Array, unit_rows

_NEWTON_STEPS = 30
_AXIS = 1e-9


@dataclass(frozen=True)
class Scaramuzza:
    """See the module's text."""

    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    distortion: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if len(self.distortion) != 5 or self.distortion[0] <= 0.0:
            raise ValueError(f"scaramuzza distortion has 5 coefficients, a0 (> 0) to a4, not {self.distortion}")

    @property
    def focal_px(self) -> float:
        return self.distortion[0]

    @property
    def keeps_lines_straight(self) -> bool:
        return not any(self.distortion[1:])

    def ray(self, pixels: Array) -> Array:
        uv = pixels - (self.cx_px, self.cy_px)
        rho = np.hypot(uv[:, 0], uv[:, 1])
        return unit_rows(np.column_stack((uv, self._f(rho))))

    def project(self, points_C: Array) -> Array:
        x, y, z = points_C.T
        across = np.hypot(x, y)
        rho = self._radius(across, z)
        factor = np.where(
            across > _AXIS * np.abs(z), rho / np.maximum(across, 1e-300), self.focal_px / np.maximum(np.abs(z), 1e-300)
        )
        return np.column_stack((self.cx_px + x * factor, self.cy_px + y * factor))

    def jacobian(self, points_C: Array) -> Array:
        x, y, z = points_C.T
        across = np.hypot(x, y)
        rho = self._radius(across, z)
        on_axis = across <= _AXIS * np.abs(z)
        safe = np.where(on_axis, 1.0, across)
        factor = np.where(on_axis, self.focal_px / np.maximum(np.abs(z), 1e-300), rho / safe)
        # rho z = across f(rho): differentiate both sides for d(rho)/d(across) and d(rho)/dz.
        below = z - across * self._slope(rho)
        by_across, by_z = self._f(rho) / below, -rho / below
        pull = np.where(on_axis, 0.0, (by_across - factor) / (safe * safe))
        along = np.where(on_axis, -self.focal_px / (z * z), by_z / safe)
        J = np.empty((len(x), 2, 3))
        J[:, 0, 0] = factor + x * x * pull
        J[:, 1, 1] = factor + y * y * pull
        J[:, 0, 1] = J[:, 1, 0] = x * y * pull
        J[:, 0, 2] = x * along
        J[:, 1, 2] = y * along
        return J

    def _f(self, rho: Array) -> Array:
        a0, a1, a2, a3, a4 = self.distortion
        return np.asarray(a0 + rho * (a1 + rho * (a2 + rho * (a3 + rho * a4))))

    def _slope(self, rho: Array) -> Array:
        _, a1, a2, a3, a4 = self.distortion
        return np.asarray(a1 + rho * (2.0 * a2 + rho * (3.0 * a3 + rho * 4.0 * a4)))

    def _radius(self, across: Array, z: Array) -> Array:
        """Smallest rho > 0 with rho z = across f(rho), by Newton inside a bracket that starts at the axis."""
        low = np.zeros_like(across)
        high = np.full_like(across, 2.0 * float(np.hypot(self.width_px, self.height_px)))
        rho = np.minimum(self.focal_px * np.arctan2(across, z), high)
        for _ in range(_NEWTON_STEPS):
            error = rho * z - across * self._f(rho)
            low, high = np.where(error < 0.0, rho, low), np.where(error >= 0.0, rho, high)
            slope = z - across * self._slope(rho)
            step = rho - error / np.where(slope == 0.0, 1e-300, slope)
            moved = np.where((step >= low) & (step <= high), step, 0.5 * (low + high))
            done = float(np.abs(moved - rho).max(initial=0.0)) < 1e-12 * self.focal_px
            rho = moved
            if done:
                break
        return np.asarray(rho)
