"""Lens models: where a point in front of the camera appears, and which ray a pixel looks along.

Frame C is optical (right, down, forward). Pixel centres are at integer coordinates. Points and rays are rows of arrays, so
that one call serves a whole marker or a whole image. The models stand one per file, their names in `lens.py`.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


class CameraModel(Protocol):
    """One lens and sensor. All lengths in pixels, all angles in radians."""

    @property
    def width_px(self) -> int: ...

    @property
    def height_px(self) -> int: ...

    @property
    def focal_px(self) -> float:
        """Pixels per radian on the optical axis."""
        ...

    @property
    def keeps_lines_straight(self) -> bool:
        """True where the image of a straight line is straight: no distortion."""
        ...

    def project(self, points_C: Array) -> Array:
        """(N, 3) points in C to (N, 2) pixels; NaN where the lens cannot see the direction."""
        ...

    def ray(self, pixels: Array) -> Array:
        """(N, 2) pixels to (N, 3) unit vectors in C."""
        ...

    def jacobian(self, points_C: Array) -> Array:
        """(N, 2, 3) derivative of `project` by the point, px/m."""
        ...


def unit_rows(vectors: Array) -> Array:
    """Each row scaled to length one."""
    lengths: Array = np.sqrt(np.einsum("ij,ij->i", vectors, vectors))
    return np.asarray(vectors / lengths[:, None])


def looking_at(direction_C: Array) -> Array:
    """R_VC (3, 3) of a frame V whose z axis is `direction_C`, turned the short way."""
    x, y, z = direction_C.tolist()
    length = math.sqrt(x * x + y * y + z * z)
    x, y, z = x / length, y / length, z / length
    if z <= -0.999999:
        return np.diag([1.0, -1.0, -1.0])
    k = 1.0 / (1.0 + z)
    return np.array([[1.0 - k * x * x, -k * x * y, -x], [-k * x * y, 1.0 - k * y * y, -y], [x, y, z]])
