"""A black cross inside a black ring on white, the kind of tag of Falanga et al. 2017 (which prints no dimensions).

All lengths are fractions of `size_m`, the outer diameter of the ring: ring 0.1 wide, cross upright with arms that span
0.6 and are 0.15 wide. The cross has four-fold symmetry: yaw is known only to a quarter turn.
"""

from __future__ import annotations

import numpy as np

from sitl_stub.camera.image import Image
from sitl_stub.markers.disc import centred_grid, coverage

RING_WIDTH = 0.1
CROSS_SPAN = 0.6
BAR_WIDTH = 0.15


def paint_circle_cross(family: str, marker_id: int, size_px: int) -> Image:
    """The tag; `family` and `marker_id` do not matter, there is one of it."""
    right, down = centred_grid(size_px)
    radius = np.hypot(right, down)
    ring = coverage(np.minimum(0.5 - radius, radius - (0.5 - RING_WIDTH)), size_px)
    upright = np.minimum(BAR_WIDTH / 2.0 - np.abs(right), CROSS_SPAN / 2.0 - np.abs(down))
    level = np.minimum(BAR_WIDTH / 2.0 - np.abs(down), CROSS_SPAN / 2.0 - np.abs(right))
    ink = np.maximum(ring, coverage(np.maximum(upright, level), size_px))
    painted: Image = np.rint(255.0 * (1.0 - ink)).astype(np.uint8)
    return painted
