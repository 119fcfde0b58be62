"""Painting planes through any lens, and with a rolling shutter: maps computed on a coarse grid of pixels, then enlarged.

A node's ray is cut with the plane in double precision; between nodes the map is bilinear (an 8 px grid for the ground, 4 px for
the pad: a few thousandths of a pixel). With a rolling shutter each row of nodes has its own camera pose.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from sitl_stub.camera.coverage import Integers, blend_edges
from sitl_stub.camera.ground import TILE_PX, Ground
from sitl_stub.camera.image import Floats, Floats32, Image
from sitl_stub.camera.motion import Twist, moved
from sitl_stub.camera.mount import Pose
from sitl_stub.camera.outline import RECTANGLE, Box, outline_points
from sitl_stub.camera.projection import Projection
from sitl_stub.camera.scene import Surface

_NO_MAP: Any = None
"""cv2.remap's second map where the first holds both coordinates; its stubs do not know that it may be absent."""

_GROUND_STEP_PX = 8
_SURFACE_STEP_PX = 4
_GROUND_TILE_PX = 160
_SMALLEST_TILE_PX = 40
_EDGE_TEXELS = 2.5
_LEVELS_APART = 2
_GRAZING_SINE = 0.012
"""Rays flatter than 0.7 degrees above the ground see haze, and no plane is followed farther than that."""


@dataclass(frozen=True, slots=True, eq=False)
class RayGrid:
    """Unit rays in C (rows, columns, 3) at nodes every `step_px`, from half a step before the frame's corner to beyond its
    end; `row_time_s` (rows,) is when each row of nodes is exposed, against mid-exposure."""

    rays_C: Floats
    row_time_s: Floats
    step_px: int

    def part(self, box: Box) -> RayGrid:
        """The nodes around a box whose corners are multiples of the step (or the frame's end)."""
        x0, y0, x1, y1 = (math.ceil(edge / self.step_px) for edge in box)
        rows, columns = slice(y0, y1 + 2), slice(x0, x1 + 2)
        return RayGrid(self.rays_C[rows, columns], self.row_time_s[rows], self.step_px)


def ray_grid(projection: Projection, width_px: int, height_px: int, readout_s: float, step_px: int) -> RayGrid:
    """Nodes lie where `enlarged` expects them: at step * (i - 1) + (step - 1) / 2."""
    columns = step_px * (np.arange(math.ceil(width_px / step_px) + 2) - 1) + (step_px - 1) / 2.0
    rows = step_px * (np.arange(math.ceil(height_px / step_px) + 2) - 1) + (step_px - 1) / 2.0
    x, y = np.meshgrid(columns, rows)
    rays = projection.rays(np.column_stack([x.ravel(), y.ravel()])).reshape(*x.shape, 3)
    middle = (height_px - 1) / 2.0
    return RayGrid(rays, (rows - middle) / (height_px - 1) * readout_s, step_px)


def enlarged(nodes: Floats, step_px: int) -> Floats32:
    """(n, m, 2) at nodes to ((n - 2) step, (m - 2) step, 2) at pixels."""
    rows, columns = nodes.shape[:2]
    full = cv2.resize(nodes.astype(np.float32), (columns * step_px, rows * step_px), interpolation=cv2.INTER_LINEAR)
    return np.asarray(full[step_px:-step_px, step_px:-step_px], np.float32)


def plane_points(grid: RayGrid, X_CS: Pose, twist: Twist) -> tuple[Floats, Floats]:
    """Where the nodes' rays meet the plane z = 0 of S: (rows, columns, 2) S x and y in metres, and the sine of the angle
    under which they do, positive where the front of the plane is in view. Rays that miss are led far off to their side."""
    if twist.is_still or not grid.row_time_s.any():
        rays_S = grid.rays_C @ X_CS.R
        camera_S = (-(X_CS.R.T @ X_CS.p))[None, None]
    else:
        R_CS, p_CS = moved(X_CS, twist, grid.row_time_s)
        rays_S = grid.rays_C @ R_CS
        camera_S = -np.einsum("rji,rj->ri", R_CS, p_CS)[:, None]
    sine = rays_S[..., 2]
    reach = -camera_S[..., 2:] / np.maximum(sine, _GRAZING_SINE / 4.0)[..., None]
    points: Floats = camera_S[..., :2] + rays_S[..., :2] * reach
    return points, sine


@dataclass(frozen=True, slots=True, eq=False)
class CurvedPainter:
    """Paints for one camera of any model."""

    projection: Projection
    coarse: RayGrid
    fine: RayGrid

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
        """Fill the boxes with ground, and with `sky` (one pixel) above the horizon."""
        camera_W = -(X_CW.R.T @ X_CW.p)
        if ground_down_m - camera_W[2] < 1e-3:
            canvas[:] = sky
            return
        tile_m = TILE_PX * ground.pyramid.metres_per_texel
        # A plane of its own below the camera, moved by whole tiles so that texel numbers stay small.
        origin = np.array([*(np.floor(camera_W[:2] / tile_m) * tile_m + drift_m), ground_down_m])
        below = Pose(X_CW.R, X_CW.p + X_CW.R @ origin)
        points, sine = plane_points(self.coarse, below, twist.about(X_CW.R @ origin))
        texels = np.stack([points[..., 1], -points[..., 0]], axis=-1) / ground.pyramid.metres_per_texel - 0.5
        density = _density(texels, self.coarse.step_px)
        for left, top, right, bottom in boxes:
            for y0 in range(top, bottom, _GROUND_TILE_PX):
                for x0 in range(left, right, _GROUND_TILE_PX):
                    box = (x0, y0, min(right, x0 + _GROUND_TILE_PX), min(bottom, y0 + _GROUND_TILE_PX))
                    self._remap_ground(canvas, ground, texels, density, box)
        self._paint_sky(canvas, sine, ground.mean, sky)

    def paint_surface(self, canvas: Image, X_CS: Pose, twist: Twist, surface: Surface) -> Box | None:
        """Draw the face where its front is in view; returns the region it lies in."""
        if -(X_CS.R.T @ X_CS.p)[2] > -1e-3:
            return None
        box = self._box(canvas, X_CS, twist, surface)
        if box is None:
            return None
        grid = self.fine.part(box)
        points, sine = plane_points(grid, X_CS, twist)
        rows, columns = surface.pyramid.levels[0].shape[:2]
        per_m = 1.0 / surface.pyramid.metres_per_texel
        texels = np.stack([points[..., 1] * per_m + columns / 2.0, -points[..., 0] * per_m + rows / 2.0], axis=-1) - 0.5
        texels[sine <= 0.0] = -1e6
        x0, y0, x1, y1 = box
        region = canvas[y0:y1, x0:x1]
        level = surface.pyramid.level_for(_density_inside(texels[::2, ::2], 2 * grid.step_px, rows, columns))
        nodes = texels * 0.5**level + (0.5 * 0.5**level - 0.5)
        full = enlarged(nodes, grid.step_px)[: y1 - y0, : x1 - x0]
        size = (columns * 0.5**level, rows * 0.5**level)
        _compose_map(region, full, surface.pyramid.levels[level], size)
        return box

    def _box(self, canvas: Image, X_CS: Pose, twist: Twist, surface: Surface) -> Box | None:
        """Pixels that can show the face, in whole steps of both grids: around its projected outline, and around the nodes
        that see it (its outline may be out of view)."""
        half = np.array([surface.length_m / 2.0, surface.width_m / 2.0])
        points, sine = plane_points(self.coarse, X_CS, twist)
        rows, columns = np.nonzero((np.abs(points) < half).all(axis=-1) & (sine > 0.0))
        step = self.coarse.step_px
        seen = np.column_stack([columns - 1.0, rows - 1.0]) * step
        outline = outline_points(np.column_stack([RECTANGLE * half, np.zeros(4)]))
        times_s = self.coarse.row_time_s[[0, len(self.coarse.row_time_s) // 2, -1]]
        R_CS, p_CS = moved(X_CS, twist, times_s)
        drawn = self.projection.project((outline @ np.swapaxes(R_CS, 1, 2) + p_CS[:, None]).reshape(-1, 3))
        pixels = np.concatenate([seen, drawn[np.isfinite(drawn).all(axis=1)]])
        if not len(pixels):
            return None
        size = np.array([canvas.shape[1], canvas.shape[0]])
        x0, y0 = np.clip(np.floor(pixels.min(axis=0) / step - 1.0) * step, 0, size).astype(int).tolist()
        x1, y1 = np.clip(np.ceil(pixels.max(axis=0) / step + 2.0) * step, 0, size).astype(int).tolist()
        return (x0, y0, x1, y1) if x0 < x1 and y0 < y1 else None

    def _remap_ground(self, canvas: Image, ground: Ground, texels: Floats, density: Floats, box: Box) -> None:
        """Draw a tile of the frame; one that looks far and near (towards the horizon) in quarters."""
        x0, y0, x1, y1 = box
        step = self.coarse.step_px
        part = (slice(y0 // step, math.ceil(y1 / step) + 2), slice(x0 // step, math.ceil(x1 / step) + 2))
        level, is_even = _level_of_tile(ground, density[part])
        scale = 0.5**level
        tile_px = TILE_PX >> level
        nodes = texels[part] * scale + (0.5 * scale - 0.5)
        nodes = nodes - np.floor(nodes.min(axis=(0, 1)) / tile_px) * tile_px
        fits = bool(nodes.max() < ground.repeated[level].shape[0] - 1)
        if not (fits and is_even) and max(x1 - x0, y1 - y0) > _SMALLEST_TILE_PX:
            for quarter in _quarters(box, step):
                self._remap_ground(canvas, ground, texels, density, quarter)
            return
        canvas[y0:y1, x0:x1] = cv2.remap(
            ground.repeated[level] if fits else ground.pyramid.levels[level],
            enlarged(np.clip(nodes, -3e4, 3e4), step)[: y1 - y0, : x1 - x0],
            _NO_MAP,
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_WRAP,
        )

    def _paint_sky(self, canvas: Image, sine: Floats, far: Image, sky: Image) -> None:
        if sine.min() > _GRAZING_SINE:
            return
        full = enlarged(sine[..., None].repeat(2, axis=-1), self.coarse.step_px)[
            : canvas.shape[0], : canvas.shape[1], 0
        ]
        canvas[full < _GRAZING_SINE] = far
        canvas[full < 0.0] = sky


def curved_painter(projection: Projection, width_px: int, height_px: int, readout_s: float) -> CurvedPainter:
    return CurvedPainter(
        projection,
        ray_grid(projection, width_px, height_px, readout_s, _GROUND_STEP_PX),
        ray_grid(projection, width_px, height_px, readout_s, _SURFACE_STEP_PX),
    )


def _quarters(box: Box, step_px: int) -> list[Box]:
    """The box cut in four (or two, where it is narrow) at multiples of the step; empty ones left out."""
    x0, y0, x1, y1 = box
    xm = x0 + math.ceil((x1 - x0) / 2 / step_px) * step_px
    ym = y0 + math.ceil((y1 - y0) / 2 / step_px) * step_px
    boxes = [(x0, y0, xm, ym), (xm, y0, x1, ym), (x0, ym, xm, y1), (xm, ym, x1, y1)]
    return [(a, b, min(c, x1), min(d, y1)) for a, b, c, d in boxes if a < min(c, x1) and b < min(d, y1)]


def _density(texels: Floats, step_px: int) -> Floats:
    """Texels a pixel at each node: geometric mean of both directions, not much less than the longer one."""
    down, right = (np.asarray(part) for part in np.gradient(texels, step_px, axis=(0, 1)))
    area = np.abs(down[..., 0] * right[..., 1] - down[..., 1] * right[..., 0])
    square = (down**2 + right**2).sum(axis=-1)
    longest = np.sqrt((square + np.sqrt(np.maximum(square**2 - 4.0 * area**2, 0.0))) / 2.0)
    density: Floats = np.maximum(np.sqrt(area), longest / 1.4)
    return density


def _level_of_tile(ground: Ground, density: Floats) -> tuple[int, bool]:
    """The middle of the levels that the corners and the centre of a tile ask for, and whether one level serves them all."""
    rows, columns = density.shape
    asked = sorted(
        ground.level_for(float(density[row, column]))
        for row, column in ((1, 1), (1, columns - 2), (rows // 2, columns // 2), (rows - 2, 1), (rows - 2, columns - 2))
    )
    return asked[2], asked[-1] - asked[0] <= _LEVELS_APART


def _density_inside(texels: Floats, step_px: int, rows: int, columns: int) -> float:
    """The middle value over the nodes that show the face, or over all where the face falls between nodes."""
    density = _density(texels, step_px)
    inside = ((texels > 0.0) & (texels < (columns, rows))).all(axis=-1)
    return float(np.median(density[inside])) if inside.any() else float(density.min())


def _compose_map(region: Image, texels: Floats32, texture: Image, size: tuple[float, float]) -> None:
    """Draw the face where its texels lie inside it (`size` is its columns and rows); edge pixels by the share they are
    covered. `texels` has about one texel a pixel."""
    warped = np.asarray(
        cv2.remap(texture, texels, _NO_MAP, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.uint8
    )
    outer = cv2.inRange(texels, (-_EDGE_TEXELS,) * 2, (size[0] + _EDGE_TEXELS, size[1] + _EDGE_TEXELS))
    inner = cv2.inRange(texels, (_EDGE_TEXELS,) * 2, (size[0] - _EDGE_TEXELS, size[1] - _EDGE_TEXELS))
    cv2.bitwise_xor(outer, inner, dst=outer)
    edges = cv2.findNonZero(outer)
    if edges is None:
        cv2.copyTo(warped, inner, region)
        return
    columns, rows = np.asarray(edges, np.intp).reshape(-1, 2).T
    share = _share(texels, rows, columns, size)
    before = region[rows, columns]
    cv2.copyTo(warped, inner, region)
    blend_edges(region, rows, columns, before, warped[rows, columns], share)


def _share(texels: Floats32, rows: Integers, columns: Integers, size: tuple[float, float]) -> Floats:
    """As in linear.py, with the map's own differences for the span of a pixel."""
    up, down = np.maximum(rows - 1, 0), np.minimum(rows + 1, texels.shape[0] - 1)
    left, right = np.maximum(columns - 1, 0), np.minimum(columns + 1, texels.shape[1] - 1)
    here = texels[rows, columns].astype(np.float64)
    by_row = np.abs(texels[down, columns] - texels[up, columns]) / (down - up)[:, None]
    by_column = np.abs(texels[rows, right] - texels[rows, left]) / (right - left)[:, None]
    inside = np.minimum(here + 0.5, np.array(size) - 0.5 - here)
    share: Floats = np.clip((inside / np.maximum(np.maximum(by_row, by_column), 1e-9)).min(axis=1) + 0.5, 0.0, 1.0)
    return share
