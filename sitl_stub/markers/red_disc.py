"""A red disc on the paper of the deck: the target of Kim et al. 2014, found by its colour. `size_m` is its diameter."""

from __future__ import annotations

import numpy as np

from sitl_stub.camera.image import Image
from sitl_stub.markers.disc import centred_grid, coverage

RED_BGR = (38.0, 30.0, 205.0)


def paint_red_disc(family: str, marker_id: int, size_px: int) -> Image:
    """(size_px, size_px, 3) BGR; `family` and `marker_id` do not matter, there is one of it."""
    right, down = centred_grid(size_px)
    inside = coverage((0.5 - np.hypot(right, down)).astype(np.float32), size_px)[..., None]
    painted: Image = np.rint(255.0 + inside * (np.array(RED_BGR, np.float32) - 255.0)).astype(np.uint8)
    return painted
