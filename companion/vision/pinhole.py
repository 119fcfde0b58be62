"""Pinhole with radial and tangential distortion (Brown and Conrady, the order of OpenCV and ROS).

`distortion` is () or k1 k2 p1 p2 [k3 [k4 k5 k6]]; with k4 to k6 the radial part is the rational polynomial
(1 + k1 r2 + k2 r4 + k3 r6) / (1 + k4 r2 + k5 r4 + k6 r6), r2 the squared distance from the axis on the plane z = 1.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from companion.vision.camera_model import Array, unit_rows

_NEWTON_STEPS = 12
"""Inverting the distortion converges in 4 to 6 steps for real lenses; the rest is reserve at the image corners."""


@dataclass(frozen=True)
class Pinhole:
    """See the module's text."""

    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    distortion: tuple[float, ...] = ()
    coefficients: tuple[float, ...] = field(init=False, repr=False)
    keeps_lines_straight: bool = field(init=False, repr=False)
    _focal_px: Array = field(init=False, repr=False, compare=False)
    _centre_px: Array = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if len(self.distortion) not in (0, 4, 5, 8):
            raise ValueError(f"pinhole distortion has 0, 4, 5 or 8 coefficients, not {len(self.distortion)}")
        object.__setattr__(self, "coefficients", self.distortion + (0.0,) * (8 - len(self.distortion)))
        object.__setattr__(self, "keeps_lines_straight", not any(self.distortion))
        object.__setattr__(self, "_focal_px", np.array([self.fx_px, self.fy_px]))
        object.__setattr__(self, "_centre_px", np.array([self.cx_px, self.cy_px]))

    @property
    def focal_px(self) -> float:
        return (self.fx_px + self.fy_px) / 2.0

    def project(self, points_C: Array) -> Array:
        z = np.where(points_C[:, 2] > 0.0, points_C[:, 2], np.nan)
        xy = points_C[:, :2] / z[:, None]
        if not self.keeps_lines_straight:
            xy = self._distort(xy)
        return np.asarray(xy * self._focal_px + self._centre_px)

    def ray(self, pixels: Array) -> Array:
        xy = (pixels - self._centre_px) / self._focal_px
        if not self.keeps_lines_straight:
            xy = self._undistort(xy)
        rays = np.ones((len(xy), 3))
        rays[:, :2] = xy
        return unit_rows(rays)

    def jacobian(self, points_C: Array) -> Array:
        z = np.where(points_C[:, 2] > 0.0, points_C[:, 2], np.nan)
        xy = points_C[:, :2] / z[:, None]
        plane = np.zeros((len(z), 2, 3))
        plane[:, 0, 0] = plane[:, 1, 1] = 1.0 / z
        plane[:, :, 2] = xy / -z[:, None]
        if not self.keeps_lines_straight:
            plane = self._distortion_jacobian(xy) @ plane
        return np.asarray(plane * self._focal_px[:, None])

    def _distort(self, xy: Array) -> Array:
        _, _, p1, p2, *_ = self.coefficients
        x, y = xy[:, 0], xy[:, 1]
        r2 = x * x + y * y
        radial, _ = self._radial(r2)
        return np.column_stack(
            (
                x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
                y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
            )
        )

    def _radial(self, r2: Array) -> tuple[Array, Array]:
        """The radial factor and its derivative by r2."""
        k1, k2, _, _, k3, k4, k5, k6 = self.coefficients
        above = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        below = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6))
        above_slope = k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3)
        below_slope = k4 + r2 * (2.0 * k5 + r2 * 3.0 * k6)
        return above / below, (above_slope * below - above * below_slope) / (below * below)

    def _distortion_jacobian(self, xy: Array) -> Array:
        """(N, 2, 2) derivative of `_distort`."""
        _, _, p1, p2, *_ = self.coefficients
        x, y = xy[:, 0], xy[:, 1]
        radial, slope = self._radial(x * x + y * y)
        mixed = 2.0 * x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y
        J = np.empty((len(x), 2, 2))
        J[:, 0, 0] = radial + 2.0 * x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x
        J[:, 1, 1] = radial + 2.0 * y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x
        J[:, 0, 1] = J[:, 1, 0] = mixed
        return J

    def _undistort(self, distorted: Array) -> Array:
        """Newton's method on `_distort`, from the distorted point itself."""
        xy = distorted.copy()
        for _ in range(_NEWTON_STEPS):
            error = distorted - self._distort(xy)
            if float(np.abs(error).max(initial=0.0)) < 1e-12:
                break
            xy = xy + np.linalg.solve(self._distortion_jacobian(xy), error[:, :, None])[:, :, 0]
        return xy
