"""Marker textures, one family a file. `MARKER_PAINTERS` maps the family of a pad file to its painter.

A painter draws one marker as a square image, top edge of the image = top edge of the marker: grey 0 (ink) to 255 (paper),
or BGR where the marker is coloured. `size_px` is a lower bound; a painter may return more to keep its cells whole.
"""

from __future__ import annotations

from typing import Protocol

from sitl_stub.camera.image import Image
from sitl_stub.markers.aruco import ARUCO_DICTIONARIES, paint_aruco
from sitl_stub.markers.circle_cross import paint_circle_cross
from sitl_stub.markers.red_disc import paint_red_disc


class MarkerPainter(Protocol):
    def __call__(self, family: str, marker_id: int, size_px: int) -> Image: ...


MARKER_PAINTERS: dict[str, MarkerPainter] = {
    **dict.fromkeys(ARUCO_DICTIONARIES, paint_aruco),
    "CIRCLE_CROSS": paint_circle_cross,
    "RED_DISC": paint_red_disc,
}

COLOURED_FAMILIES = frozenset({"RED_DISC"})
"""Families whose pads need colour cameras to be seen as meant."""
