"""Painting planes through a lens without distortion: each plane is one homography, warped with its own mip level.

`M` everywhere is the 3 x 3 matrix from pixels to texels of level 0, scaled so that its last row is positive for what lies in
front of the camera. Only the deck's edges need blending by area; they are few pixels and are done one by one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from sitl_stub.camera.coverage import Integers, blend_edges, edge_pixels
from sitl_stub.camera.ground import MARGIN_PX, TILE_PX, Ground
from sitl_stub.camera.image import Floats, Image
from sitl_stub.camera.motion import Twist
from sitl_stub.camera.mount import Pose
from sitl_stub.camera.outline import Box, bounds, clip_half_plane, fill, image_polygon
from sitl_stub.camera.pinhole import Pinhole
from sitl_stub.camera.pyramid import Pyramid, level_from_base
from sitl_stub.camera.scene import Surface

_TILE_PX = (94, 40)
_EDGE_ON_M = 1e-3
_EVERY_SECOND: Floats = np.array([[2.0, 0.0, 0.5], [0.0, 2.0, 0.5], [0.0, 0.0, 1.0]])
"""Pixels of a picture of half the size to those of the full one, the way cv2.resize enlarges."""
_HAZE_SINE = 0.012
"""Ground seen under less than 0.7 degrees is one colour."""


@dataclass(frozen=True, slots=True, eq=False)
class LinearPainter:
    """Paints for one camera; `K` is its matrix. The image's size is that of the canvas."""

    projection: Pinhole
    K_inverse: Floats

    def paint_ground(
        self,
        canvas: Image,
        boxes: Sequence[Box],
        X_CW: Pose,
        twist: Twist,
        ground_down_m: float,
        drift_m: Floats,
        ground: Ground,
        sky: Image,
    ) -> None:
        """Fill the boxes with ground, and with `sky` (one pixel) above the horizon. `twist` is not used: no row is late."""
        height_m = ground_down_m + float((X_CW.R.T @ X_CW.p)[2])
        if height_m < _EDGE_ON_M:
            canvas[:] = sky
            return
        M = self._ground_texels(X_CW, height_m, drift_m, ground)
        for box in boxes:
            for tile, level in _ground_tiles(M, ground, box):
                _warp_ground(canvas, ground, level, M, tile)
        self._paint_sky(canvas, X_CW, ground.mean, sky)

    def paint_surface(self, canvas: Image, X_CS: Pose, twist: Twist, surface: Surface) -> Box | None:
        """Draw the face where its front is in view; returns the region it lies in. `twist` is not used."""
        camera_S = -(X_CS.R.T @ X_CS.p)
        if camera_S[2] > -_EDGE_ON_M:
            return None
        half = np.array([surface.length_m / 2.0, surface.width_m / 2.0, 0.0])
        corners = np.array([[1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0]]) * half
        polygon = image_polygon(corners @ X_CS.R.T + X_CS.p, self.projection, canvas.shape[1], canvas.shape[0])
        box = bounds(polygon, canvas.shape[1], canvas.shape[0])
        if box is None:
            return None
        M = self._surface_texels(X_CS, surface)
        warped = _warp_box(surface.pyramid, M, box, polygon)
        _compose(canvas, warped, box, polygon, M, surface.pyramid.levels[0].shape[:2])
        return box

    def _surface_texels(self, X_CS: Pose, surface: Surface) -> Floats:
        rows, columns = surface.pyramid.levels[0].shape[:2]
        per_m = 1.0 / surface.pyramid.metres_per_texel
        texels = np.array([[0.0, per_m, columns / 2.0 - 0.5], [-per_m, 0.0, rows / 2.0 - 0.5], [0.0, 0.0, 1.0]])
        return _normalized(texels @ self._plane_from_pixel(X_CS), X_CS)

    def _ground_texels(self, X_CW: Pose, height_m: float, drift_m: Floats, ground: Ground) -> Floats:
        """Rows run south, columns east; whole tiles are taken off so that texel numbers stay small."""
        camera_W = -(X_CW.R.T @ X_CW.p)
        below = Pose(X_CW.R, X_CW.R @ np.array([0.0, 0.0, height_m]))
        mpt = ground.pyramid.metres_per_texel
        tile_m = TILE_PX * mpt
        north, east = (camera_W[:2] - drift_m) % tile_m
        texels = np.array([[0.0, 1.0 / mpt, east / mpt - 0.5], [-1.0 / mpt, 0.0, -north / mpt - 0.5], [0.0, 0.0, 1.0]])
        return _normalized(texels @ self._plane_from_pixel(below), below)

    def _plane_from_pixel(self, X_CS: Pose) -> Floats:
        pixel_from_plane = X_CS.R.copy()
        pixel_from_plane[:, 2] = X_CS.p
        return np.asarray(np.linalg.inv(pixel_from_plane) @ self.K_inverse, np.float64)

    def _paint_sky(self, canvas: Image, X_CW: Pose, far: Image, sky: Image) -> None:
        """Rays that point up or nearly level: `down` is linear in the pixel."""
        down = X_CW.R[:, 2] @ self.K_inverse
        frame = _around_frame(canvas.shape[1], canvas.shape[0])
        sine = frame @ down[:2] + down[2]
        if sine.min() > _HAZE_SINE:
            return
        for limit, colour in ((_HAZE_SINE, far), (0.0, sky)):
            fill(canvas, clip_half_plane(frame, limit - sine), tuple(float(c) for c in np.atleast_1d(colour)))


@lru_cache(maxsize=16)
def _around_frame(width_px: int, height_px: int) -> Floats:
    """(4, 2) corners of a rectangle 4 px beyond the frame."""
    size = np.array([width_px, height_px])
    return np.asarray((np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) * (size + 8) + size) / 2.0)


def linear_painter(projection: Pinhole) -> LinearPainter:
    k = projection.intrinsics
    K = np.array([[k.fx_px, 0.0, k.cx_px], [0.0, k.fy_px, k.cy_px], [0.0, 0.0, 1.0]])
    return LinearPainter(projection, np.linalg.inv(K))


def _normalized(M: Floats, X_CS: Pose) -> Floats:
    """The plane's depth along a pixel's ray is n.p / n.ray; M comes out with last row n.ray / n.p, so give it n.p's sign."""
    return M * math.copysign(1.0, float(X_CS.R[:, 2] @ X_CS.p))


def _shift(x: float, y: float) -> Floats:
    return np.array([[1.0, 0.0, x], [0.0, 1.0, y], [0.0, 0.0, 1.0]])


def texels_per_px(M: Floats, x: float, y: float) -> float:
    """Texels of level 0 that a pixel spans: the geometric mean of both directions, but not much less than the longer
    one. Infinity where the pixel does not see the plane."""
    (m00, m01, m02), (m10, m11, m12), (m20, m21, m22) = M.tolist()
    depth = m20 * x + m21 * y + m22
    if not depth > 0.0:
        return math.inf
    right, down = (m00 * x + m01 * y + m02) / depth, (m10 * x + m11 * y + m12) / depth
    a, b = (m00 - right * m20) / depth, (m01 - right * m21) / depth
    c, d = (m10 - down * m20) / depth, (m11 - down * m21) / depth
    area = abs(a * d - b * c)
    square = a * a + b * b + c * c + d * d
    longest = math.sqrt((square + math.sqrt(max(0.0, square * square - 4.0 * area * area))) / 2.0)
    return max(math.sqrt(area), longest / 1.4)


def _ground_tiles(M: Floats, ground: Ground, box: Box) -> list[tuple[Box, int]]:
    """Regions of the box with the level each is drawn from: one where levels hardly differ, tiles otherwise."""
    left, top, right, bottom = box
    middle = _ground_level(M, ground, (left + right) / 2, (top + bottom) / 2)
    corners = [_ground_level(M, ground, x, y) for x in (left, right - 1) for y in (top, bottom - 1)]
    if all(abs(level - middle) <= 1 for level in corners):
        return [(box, middle)]
    tiles = []
    for y0 in range(top, bottom, _TILE_PX[1]):
        y1 = min(bottom, y0 + _TILE_PX[1])
        starts = range(left, right, _TILE_PX[0])
        levels = [_ground_level(M, ground, x0 + _TILE_PX[0] / 2, (y0 + y1) / 2) for x0 in starts]
        tiles += [((x0, y0, x1, y1), level) for x0, x1, level in _runs(starts, levels, right)]
    return tiles


def _runs(starts: Sequence[int], levels: Sequence[int], end: int) -> list[tuple[int, int, int]]:
    """Neighbours of one level joined: (start, end, level)."""
    runs: list[tuple[int, int, int]] = []
    for start, stop, level in zip(starts, (*starts[1:], end), levels, strict=True):
        if runs and runs[-1][2] == level:
            runs[-1] = (runs[-1][0], stop, level)
        else:
            runs.append((start, stop, level))
    return runs


def _ground_level(M: Floats, ground: Ground, x: float, y: float) -> int:
    density = texels_per_px(M, x, y)
    return ground.level_for(density) if math.isfinite(density) else len(ground.repeated) - 1


def _warp_ground(canvas: Image, ground: Ground, level: int, M: Floats, box: Box) -> None:
    """Where a pixel spans less than a texel there is nothing to see between two pixels: then every second one is drawn, in
    both directions, and the picture enlarged."""
    x0, y0, x1, y1 = box
    is_magnified = level == 0 and texels_per_px(M, (x0 + x1) / 2, (y0 + y1) / 2) < 1.0
    if not is_magnified:
        warp = level_from_base(level) @ M @ _shift(x0, y0)
        _ground_part(ground, level, warp, x1 - x0, y1 - y0, canvas[y0:y1, x0:x1])
        return
    width, height = (x1 - x0 + 1) // 2, (y1 - y0 + 1) // 2
    coarse = _ground_part(ground, level, M @ _shift(x0, y0) @ _EVERY_SECOND, width, height)
    enlarged = cv2.resize(coarse, (2 * width, 2 * height), interpolation=cv2.INTER_LINEAR)
    canvas[y0:y1, x0:x1] = enlarged[: y1 - y0, : x1 - x0]


def _ground_part(ground: Ground, level: int, warp: Floats, width: int, height: int, into: Image | None = None) -> Image:
    fitting = _fitting(warp, width, height, TILE_PX >> level)
    drawn = cv2.warpPerspective(
        ground.pyramid.levels[level] if fitting is None else ground.repeated[level],
        warp if fitting is None else fitting,
        (width, height),
        dst=into,
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_WRAP,
    )
    return np.asarray(drawn, np.uint8)


def _fitting(warp: Floats, width: int, height: int, tile_px: int) -> Floats | None:
    """The warp moved by whole tiles so that its view lies inside a repeated level; None where it is too large for one."""
    corners = warp @ np.array([[0.0, width - 1.0, 0.0, width - 1.0], [0.0, 0.0, height - 1.0, height - 1.0], [1.0] * 4])
    if corners[2].min() <= 0.0:
        return None
    texels = corners[:2] / corners[2]
    low = texels.min(axis=1)
    tiles = np.floor(low / tile_px)
    if (texels.max(axis=1) - tiles * tile_px >= tile_px + MARGIN_PX - 1).any():
        return None
    return _shift(-float(tiles[0]) * tile_px, -float(tiles[1]) * tile_px) @ warp


def _warp_box(pyramid: Pyramid, M: Floats, box: Box, polygon: Floats) -> Image:
    x0, y0, x1, y1 = box
    middle = np.clip(polygon, (x0, y0), (x1, y1)).mean(axis=0)
    level = pyramid.level_for(texels_per_px(M, float(middle[0]), float(middle[1])))
    warped = cv2.warpPerspective(
        pyramid.levels[level],
        level_from_base(level) @ M @ _shift(x0, y0),
        (x1 - x0, y1 - y0),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return np.asarray(warped, np.uint8)


def _compose(canvas: Image, warped: Image, box: Box, polygon: Floats, M: Floats, texels: tuple[int, int]) -> None:
    """Inside is copied, the edge is blended by the share of each pixel that the face covers."""
    x0, y0, x1, y1 = box
    region = canvas[y0:y1, x0:x1]
    columns, rows = edge_pixels(polygon - (x0, y0), x1 - x0, y1 - y0)
    share = _share(M, columns + x0, rows + y0, texels)
    before = region[rows, columns]
    inside = np.zeros(region.shape[:2], np.uint8)
    cv2.fillConvexPoly(inside, np.rint(polygon - (x0, y0)).astype(np.int32), 255.0)
    cv2.copyTo(warped, inside, region)
    blend_edges(region, rows, columns, before, warped[rows, columns], share)


def _share(M: Floats, x: Integers, y: Integers, texels: tuple[int, int]) -> Floats:
    """Covered share of the pixels (x, y), from the distance to the nearest edge in texels over the pixel's own span."""
    q = M[:, :1] * x + M[:, 1:2] * y + M[:, 2:3]
    depth = np.where(q[2] > 0.0, q[2], np.inf)
    share = np.ones_like(depth)
    for axis, size in ((0, texels[1]), (1, texels[0])):
        texel = q[axis] / depth
        span = np.maximum(np.abs(M[axis, 0] - texel * M[2, 0]), np.abs(M[axis, 1] - texel * M[2, 1])) / depth
        inside = np.minimum(texel + 0.5, size - 0.5 - texel)
        share = np.minimum(share, inside / np.maximum(span, 1e-9) + 0.5)
    return np.clip(np.where(q[2] > 0.0, share, 0.0), 0.0, 1.0)
