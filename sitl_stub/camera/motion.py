"""How things move against the camera during a frame: twists, poses a little earlier or later, and blur by exposure."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from sitl_stub.camera.image import Floats, Image
from sitl_stub.camera.mount import Pose
from sitl_stub.camera.outline import Box
from sitl_stub.camera.projection import Projection

_SHARP_PX = 0.7
"""Less motion than this within an exposure cannot be seen."""

_LONGEST_BLUR_PX = 41.0
_UNIFORM_PX = 1.0
_CELL_PX = 160
_KERNEL_STEPS = 4
_WIDE_TURN = 2.0
_WIDE_DRIFT = 1.7


@dataclass(frozen=True, slots=True, eq=False)
class Twist:
    """Motion of a frame S against the camera: velocity of S's origin (m/s) and angular velocity of S (rad/s), both in C."""

    velocity_C: Floats
    angular_velocity_C: Floats

    @property
    def is_still(self) -> bool:
        return not (self.velocity_C.any() or self.angular_velocity_C.any())

    def about(self, offset_C: Floats) -> Twist:
        """The twist of another frame fixed to S, whose origin is `offset_C` from that of S."""
        return Twist(self.velocity_C + skew(self.angular_velocity_C) @ offset_C, self.angular_velocity_C)


def skew(w: Floats) -> Floats:
    """The matrix whose product with a vector is the cross product w x v (np.cross takes thirty times as long)."""
    x, y, z = w.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def twist_of(X_CS: Pose, velocity_S_W: Floats, omega_S_W: Floats, camera: Twist, X_CW: Pose) -> Twist:
    """Twist of S seen from C. `velocity_S_W`, `omega_S_W` are S's own motion in W; `camera` is the camera's own, with both
    vectors written in W."""
    turn = X_CW.R @ camera.angular_velocity_C
    drift = X_CW.R @ (velocity_S_W - camera.velocity_C)
    return Twist(drift - skew(turn) @ X_CS.p, X_CW.R @ omega_S_W - turn)


def moved(X_CS: Pose, twist: Twist, time_s: Floats) -> tuple[Floats, Floats]:
    """(R_CS (n, 3, 3), p_CS (n, 3)) at the given times: constant angular velocity about S's origin, straight motion of it."""
    speed = math.sqrt(float(twist.angular_velocity_C @ twist.angular_velocity_C))
    K = skew(twist.angular_velocity_C) / max(speed, 1e-12)
    angle = (time_s * speed)[:, None, None]
    turned = np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * (K @ K)
    return turned @ X_CS.R, X_CS.p + time_s[:, None] * twist.velocity_C


def blur_plane(
    canvas: Image, box: Box, projection: Projection, X_CS: Pose, twist: Twist, exposure_s: float, focal_px: float
) -> None:
    """Smear a region that shows the plane z = 0 of S along its motion in the image during the exposure, in place. One kernel
    where the motion hardly varies over the region, one for each cell of 160 px where it does."""
    if _longest_path(X_CS, twist, focal_px) * exposure_s < _SHARP_PX:
        return
    x0, y0, x1, y1 = box
    paths = paths_px(projection, _grid_points(x0, y0, x1 - 1, y1 - 1), X_CS, twist, exposure_s)
    longest = float(np.hypot(*paths.T).max())
    if longest < _SHARP_PX:
        return
    # What moves smears over its own edges.
    reach = math.ceil(min(longest, _LONGEST_BLUR_PX) / 2.0)
    x0, y0 = max(0, x0 - reach), max(0, y0 - reach)
    x1, y1 = min(canvas.shape[1], x1 + reach), min(canvas.shape[0], y1 + reach)
    if np.ptp(paths, axis=0).max() < _UNIFORM_PX:
        canvas[y0:y1, x0:x1] = _smeared(canvas, (x0, y0, x1, y1), paths.mean(axis=0))
        return
    sharp = canvas.copy()
    cells = [
        (x, y, min(x1, x + _CELL_PX), min(y1, y + _CELL_PX))
        for y in range(y0, y1, _CELL_PX)
        for x in range(x0, x1, _CELL_PX)
    ]
    middles = np.array([[(left + right) / 2.0, (top + bottom) / 2.0] for left, top, right, bottom in cells])
    for (left, top, right, bottom), path in zip(
        cells, paths_px(projection, middles, X_CS, twist, exposure_s), strict=True
    ):
        canvas[top:bottom, left:right] = _smeared(sharp, (left, top, right, bottom), path)


def _longest_path(X_CS: Pose, twist: Twist, focal_px: float) -> float:
    """An upper bound, px/s, of motion in the image over a wide view of the plane (rays to 60 degrees from the axis)."""
    distance = abs(float(X_CS.R[:, 2] @ X_CS.p))
    at_camera = twist.velocity_C - skew(twist.angular_velocity_C) @ X_CS.p
    turn, drift = math.hypot(*twist.angular_velocity_C.tolist()), math.hypot(*at_camera.tolist())
    return focal_px * (_WIDE_TURN * turn + _WIDE_DRIFT * drift / max(distance, 1e-3))


def paths_px(projection: Projection, pixels: Floats, X_CS: Pose, twist: Twist, exposure_s: float) -> Floats:
    """Path in the image (n, 2) during the exposure of the plane's points seen at the pixels (n, 2); zero where none is."""
    rays = projection.rays(pixels)
    normal = X_CS.R[:, 2]
    height = float(normal @ X_CS.p)
    along = rays @ normal
    reach = height / np.where(along * math.copysign(1.0, height) > 1e-3, along, np.nan)
    points = rays * reach[:, None]
    half = (twist.velocity_C + (points - X_CS.p) @ skew(twist.angular_velocity_C).T) * (exposure_s / 2.0)
    paths = projection.project(points + half) - projection.project(points - half)
    return np.where(np.isfinite(paths).all(axis=1, keepdims=True), paths, 0.0)


def _grid_points(x0: float, y0: float, x1: float, y1: float) -> Floats:
    return np.array([(x, y) for y in (y0, (y0 + y1) / 2.0, y1) for x in (x0, (x0 + x1) / 2.0, x1)], np.float64)


def _smeared(image: Image, box: Box, path_px: Floats) -> Image:
    """The region of the image, each pixel averaged along the path; its surroundings flow in."""
    x0, y0, x1, y1 = box
    length = float(np.hypot(*path_px))
    if length < _SHARP_PX:
        return image[y0:y1, x0:x1]
    x, y = (path_px * (_KERNEL_STEPS * min(1.0, _LONGEST_BLUR_PX / length))).round().astype(int).tolist()
    kernel = _kernel(x, y)
    my, mx = kernel.shape[0] // 2, kernel.shape[1] // 2
    left, top = max(0, x0 - mx), max(0, y0 - my)
    around = image[top : y1 + my, left : x1 + mx]
    smeared = cv2.filter2D(around, -1, kernel, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(smeared[y0 - top : y1 - top, x0 - left : x1 - left], np.uint8)


@lru_cache(maxsize=1024)
def _kernel(x_steps: int, y_steps: int) -> Floats:
    """Kernels are kept: paths to a quarter of a pixel are few."""
    return line_kernel(np.array([x_steps / _KERNEL_STEPS, y_steps / _KERNEL_STEPS]))


def line_kernel(path_px: Floats) -> Floats:
    """Weights of a uniform motion along the path: samples every eighth of a pixel, each split among four pixels."""
    samples = max(2, math.ceil(8.0 * float(np.hypot(*path_px))))
    along = (np.arange(samples) + 0.5) / samples - 0.5
    reach_x, reach_y = (math.ceil(abs(float(part)) / 2.0) for part in path_px)
    kernel = np.zeros((2 * reach_y + 1, 2 * reach_x + 1))
    x, y = along * path_px[0] + reach_x, along * path_px[1] + reach_y
    x0, y0 = np.floor(x).astype(np.intp), np.floor(y).astype(np.intp)
    fx, fy = x - x0, y - y0
    for dx, dy, weight in ((0, 0, (1 - fx) * (1 - fy)), (1, 0, fx * (1 - fy)), (0, 1, (1 - fx) * fy), (1, 1, fx * fy)):
        rows, columns = np.minimum(y0 + dy, 2 * reach_y), np.minimum(x0 + dx, 2 * reach_x)
        np.add.at(kernel, (rows, columns), weight)
    return kernel / samples
