"""Distance fields for painters: shapes with exact edges, grey by coverage."""

from __future__ import annotations

import numpy as np

from sitl_stub.camera.image import Floats32


def centred_grid(size_px: int) -> tuple[Floats32, Floats32]:
    """(right, down) of each pixel's centre from the middle of the image, in units of its side."""
    axis = ((np.arange(size_px, dtype=np.float32) + 0.5) / size_px - 0.5).astype(np.float32)
    return np.broadcast_to(axis, (size_px, size_px)), np.broadcast_to(axis[:, None], (size_px, size_px))


def coverage(inside: Floats32, size_px: int) -> Floats32:
    """Share of each pixel that lies inside a shape, from the signed distance to its edge in units of the side."""
    share: Floats32 = np.clip(inside * np.float32(size_px) + np.float32(0.5), 0.0, 1.0).astype(np.float32)
    return share
