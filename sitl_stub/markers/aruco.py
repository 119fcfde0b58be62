"""ArUco and AprilTag markers, from OpenCV's dictionaries: one black border cell around the code.

`size_m` of such a marker is the side of the black square. AprilTags come from the DICT_APRILTAG_* dictionaries, whose ids
are those of the AprilTag library.
"""

from __future__ import annotations

import cv2
import numpy as np

from sitl_stub.camera.image import Image

ARUCO_DICTIONARIES: dict[str, int] = {
    name: int(getattr(cv2.aruco, name)) for name in dir(cv2.aruco) if name.startswith("DICT_")
}


def paint_aruco(family: str, marker_id: int, size_px: int) -> Image:
    """The marker with whole cells, at least `size_px` wide. ValueError for an id outside the dictionary."""
    dictionary = cv2.aruco.getPredefinedDictionary(ARUCO_DICTIONARIES[family])
    count = len(dictionary.bytesList)
    if not 0 <= marker_id < count:
        raise ValueError(f"{family} has ids 0 to {count - 1}, not {marker_id}")
    cells = dictionary.markerSize + 2
    bits = cv2.aruco.generateImageMarker(dictionary, marker_id, cells)
    cell_px = -(-size_px // cells)
    return np.ascontiguousarray(np.kron(bits, np.ones((cell_px, cell_px), np.uint8)))
