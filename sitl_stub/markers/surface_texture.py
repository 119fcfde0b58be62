"""Texture of one face of the pad: paper, dirt and the markers on it, by area.

A face has its own frame S, seen from in front: x up in the image, y right, origin in its middle, metres. Texel (row,
column) covers a square of `metres_per_texel`; its centre is at y = (column + 0.5) mpt - width / 2 and
x = length / 2 - (row + 0.5) mpt. Markers are drawn at twice the resolution and averaged, so that an edge between two texels
has its grey by area and lies where the file says, to a few hundredths of a texel.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from sitl_stub.camera.image import Floats, Floats32, Image
from sitl_stub.markers import COLOURED_FAMILIES, MARKER_PAINTERS
from sitl_stub.pad_layout import PadLayout, Vec2

INK_BRIGHTNESS = 26.0
TEXELS_ALONG = 2048
"""Along the longer side of a face: 0.7 mm on the default deck, one pixel of the default camera from 0.3 m away."""


@dataclass(frozen=True, slots=True)
class PlacedMarker:
    """A marker in the frame of its face: centre (x, y), yaw turns the image clockwise."""

    id: int
    size_m: float
    centre_m: Vec2
    yaw_rad: float


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceTexture:
    """`image` covers length_m (x, downward rows) by width_m (y, columns) of a face."""

    image: Image
    length_m: float
    width_m: float
    metres_per_texel: float


def deck_texture(layout: PadLayout, coloured: bool) -> SurfaceTexture:
    """The deck's top."""
    cx, cy = layout.deck_center_m
    placed = [
        PlacedMarker(marker.id, marker.size_m, (marker.position_m[0] - cx, marker.position_m[1] - cy), marker.yaw_rad)
        for marker in layout.markers
        if marker.facing == "up"
    ]
    return _face(layout, layout.length_m, layout.width_m, placed, coloured)


def board_texture(layout: PadLayout, coloured: bool) -> SurfaceTexture:
    """The face of the upright board that looks back; ValueError where the pad has none."""
    if layout.board_size_m is None:
        raise ValueError("this pad has no board")
    width, height = layout.board_size_m
    placed = [
        PlacedMarker(marker.id, marker.size_m, (marker.height_m - height / 2.0, marker.position_m[1]), marker.yaw_rad)
        for marker in layout.markers
        if marker.facing == "back"
    ]
    return _face(layout, height, width, placed, coloured)


def is_coloured(layout: PadLayout) -> bool:
    """Whether a colour camera sees more of this pad than a grey one."""
    return layout.family in COLOURED_FAMILIES


def _face(
    layout: PadLayout, length_m: float, width_m: float, markers: Sequence[PlacedMarker], coloured: bool
) -> SurfaceTexture:
    metres_per_texel = max(length_m, width_m) / TEXELS_ALONG
    rows, columns = round(length_m / metres_per_texel), round(width_m / metres_per_texel)
    shape = (rows, columns, 3) if layout.family in COLOURED_FAMILIES else (rows, columns)
    paper = np.full(shape, 255, np.uint8)
    # Large markers first, so that a nested one lies on top.
    for marker in sorted(markers, key=lambda marker: -marker.size_m):
        _paste(paper, layout.family, marker, metres_per_texel)
    paper = _with_channels(paper, 3 if coloured else 1)
    brightness = INK_BRIGHTNESS + paper * np.float32((layout.deck_brightness - INK_BRIGHTNESS) / 255.0)
    image = np.rint(np.clip(brightness + _dirt(rows, columns, paper.ndim), 0.0, 255.0)).astype(np.uint8)
    return SurfaceTexture(image, length_m, width_m, metres_per_texel)


def _with_channels(image: Image, channels: int) -> Image:
    """Grey or BGR, whatever it was."""
    if (image.ndim == 3) == (channels == 3):
        return image
    code = cv2.COLOR_GRAY2BGR if channels == 3 else cv2.COLOR_BGR2GRAY
    return np.asarray(cv2.cvtColor(image, code), np.uint8)


def _paste(paper: Image, family: str, marker: PlacedMarker, metres_per_texel: float) -> None:
    """Draw one marker onto the paper, in place."""
    if family not in MARKER_PAINTERS:
        raise ValueError(f"family {family!r} is not known; known are {', '.join(sorted(MARKER_PAINTERS))}")
    fine = metres_per_texel / 2.0
    patch = MARKER_PAINTERS[family](family, marker.id, math.ceil(marker.size_m / fine))
    r0, r1, c0, c1 = _bounds(paper, marker, metres_per_texel)
    to_fine = _patch_to_fine(paper, marker, patch.shape[0], fine, (2 * r0, 2 * c0))
    fine_size, size = (2 * (c1 - c0), 2 * (r1 - r0)), (c1 - c0, r1 - r0)
    drawn = cv2.warpAffine(patch, to_fine, fine_size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    alpha = cv2.warpAffine(np.full_like(patch, 255), to_fine, fine_size, flags=cv2.INTER_LINEAR)
    ink = cv2.resize(cv2.multiply(drawn, alpha, scale=1.0 / 255.0), size, interpolation=cv2.INTER_AREA)
    bare = cv2.subtract(np.full_like(ink, 255), cv2.resize(alpha, size, interpolation=cv2.INTER_AREA))
    paper[r0:r1, c0:c1] = cv2.add(cv2.multiply(paper[r0:r1, c0:c1], bare, scale=1.0 / 255.0), ink)


def _bounds(paper: Image, marker: PlacedMarker, metres_per_texel: float) -> tuple[int, int, int, int]:
    """Rows and columns of the paper that the marker can touch."""
    rows, columns = paper.shape[:2]
    row = rows / 2.0 - marker.centre_m[0] / metres_per_texel
    column = columns / 2.0 + marker.centre_m[1] / metres_per_texel
    turned = abs(math.cos(marker.yaw_rad)) + abs(math.sin(marker.yaw_rad))
    reach = marker.size_m * turned / metres_per_texel / 2.0 + 2.0
    return (
        max(0, math.floor(row - reach)),
        min(rows, math.ceil(row + reach)),
        max(0, math.floor(column - reach)),
        min(columns, math.ceil(column + reach)),
    )


def _patch_to_fine(paper: Image, marker: PlacedMarker, patch_px: int, fine_m: float, corner: tuple[int, int]) -> Floats:
    """2 x 3 matrix from patch pixels to fine pixels of the region whose top left is `corner` (row, column)."""
    scale = marker.size_m / patch_px / fine_m
    c, s = math.cos(marker.yaw_rad) * scale, math.sin(marker.yaw_rad) * scale
    middle = (patch_px - 1) / 2.0
    # Centres of pixels are at integers, hence the halves.
    column = paper.shape[1] + marker.centre_m[1] / fine_m - 0.5 - corner[1]
    row = paper.shape[0] - marker.centre_m[0] / fine_m - 0.5 - corner[0]
    return np.array([[c, -s, column - c * middle + s * middle], [s, c, row - s * middle - c * middle]])


def _dirt(rows: int, columns: int, ndim: int) -> Floats32:
    """A few grey levels of stains and unevenness: paper in the open is not flat white. Always the same."""
    rng = np.random.default_rng(20170)
    stains = sum(
        cv2.resize(
            rng.standard_normal((cells, cells)).astype(np.float32), (columns, rows), interpolation=cv2.INTER_CUBIC
        )
        * amplitude
        for cells, amplitude in ((5, 2.5), (23, 1.5), (128, 0.8))
    )
    field = np.asarray(stains, np.float32)
    return field if ndim == 2 else field[..., None]
