"""The pad's markers as points in P, from the configuration.

P lies in the pad's surface: x along travel, y right, z down; its origin is the landing point. Each marker contributes its
four corners, clockwise from the top-left corner of its image as seen from above, the order in which OpenCV reports them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from companion import config
from companion.vision.camera_model import Array

FAMILIES: dict[str, int] = {name: getattr(cv2.aruco, name) for name in dir(cv2.aruco) if name.startswith("DICT_")}
"""Every predefined ArUco and AprilTag family by OpenCV's name."""


@dataclass(frozen=True, eq=False)
class PadLayout:
    """`corners_P[id]` is (4, 3), metres. `family` is OpenCV's name; `cells` counts bits across, border excluded."""

    family: str
    cells: int
    corners_P: dict[int, Array]
    size_m: dict[int, float]

    @property
    def extent_P(self) -> Array:
        """(8, 3) corners of the box along the axes of P that holds all markers."""
        points = np.concatenate(list(self.corners_P.values()))
        low, high = points.min(axis=0), points.max(axis=0)
        return np.array([(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])


def from_config(pad: config.Pad) -> PadLayout:
    """ValueError where the family is unknown, an id is not in it, or an id appears twice."""
    family = dictionary(pad.family)
    count = len(family.bytesList)
    ids = [marker.id for marker in pad.markers]
    for marker_id in ids:
        if marker_id >= count:
            raise ValueError(f"[pad] marker id {marker_id} is not in {pad.family}, which has ids 0 to {count - 1}")
    if len(set(ids)) < len(ids):
        raise ValueError(f"[pad] markers: an id appears twice in {ids}; one id is one place")
    if not ids:
        raise ValueError("[pad] markers: at least one marker is needed")
    return PadLayout(
        family=pad.family,
        cells=int(family.markerSize),
        corners_P={marker.id: marker_corners(marker) for marker in pad.markers},
        size_m={marker.id: marker.size_m for marker in pad.markers},
    )


def readable_cells(layout: PadLayout, marker_id: int) -> npt.NDArray[np.bool_]:
    """(cells, cells): False where the middle of a cell of this marker lies under a smaller marker or its quiet zone."""
    n = layout.cells + 2
    origin, right, _, down = layout.corners_P[marker_id]
    middle = (np.arange(1, n - 1) + 0.5) / n
    cells = origin + middle[None, :, None] * (right - origin) + middle[:, None, None] * (down - origin)
    free = np.ones((layout.cells, layout.cells), dtype=bool)
    for other, corners in layout.corners_P.items():
        if other != marker_id and layout.size_m[other] < layout.size_m[marker_id]:
            quiet = 1.0 + 2.0 / n
            axis_x, axis_y = (corners[1] - corners[0]) / 2.0, (corners[3] - corners[0]) / 2.0
            offset = cells - corners.mean(axis=0)
            across = np.abs(offset @ axis_x) / (axis_x @ axis_x)
            along = np.abs(offset @ axis_y) / (axis_y @ axis_y)
            free &= np.maximum(across, along) > quiet
    return free


def dictionary(family: str) -> cv2.aruco.Dictionary:
    """OpenCV's table of codes of a family by name; ValueError names the known ones."""
    if family not in FAMILIES:
        raise ValueError(f"[pad] family {family!r} is unknown; known: {', '.join(sorted(FAMILIES))}")
    return cv2.aruco.getPredefinedDictionary(FAMILIES[family])


def marker_corners(marker: config.Marker) -> Array:
    """(4, 3) corners in P, clockwise from the top-left of the marker's image as its viewer sees it.

    At yaw 0 the top edge of a marker that faces up points along +x; of one that faces back it points up (-z).
    """
    half = marker.size_m / 2.0
    c, s = math.cos(math.radians(marker.yaw_deg)), math.sin(math.radians(marker.yaw_deg))
    # (towards the top of the marker's surface, towards its right)
    upright = ((half, -half), (half, half), (-half, half), (-half, -half))
    turned = [(c * up - s * right, s * up + c * right) for up, right in upright]
    x0, y0 = marker.position_m
    if marker.facing == "up":
        return np.array([(x0 + up, y0 + right, 0.0) for up, right in turned])
    return np.array([(x0, y0 + right, -marker.height_m - up) for up, right in turned])
