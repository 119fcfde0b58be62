"""From views of a board to a lens: OpenCV's bundle adjustment, checked by views that it has not seen.

Every fourth view is held out; the lens from the others must explain it, its pose being free, through Companion's own lens
models. The last coefficient k3 of a pinhole is kept only where held-out views like it. The lens handed out is fitted to all
views.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np

from companion.calibration.board import BoardView, Points
from companion.io.camera_info import CameraInfo
from companion.vision.camera_model import CameraModel
from companion.vision.lens import CAMERA_MODELS

Model = Literal["pinhole", "kannala_brandt"]
MIN_VIEWS = 5
HOLD_OUT = 4
K3_GAIN = 0.97
"""Held-out error with k3 over that without: better by less than this is no reason for another coefficient."""
REFINEMENTS = 10
FOCAL_SHARES = (0.25, 0.35, 0.5)
"""Of the image's width: focal lengths to start a fisheye from, about 230, 160 and 115 degrees across."""


@dataclass(frozen=True, slots=True)
class Calibration:
    """A lens and how good it is, pixels RMS over both axes' distance; `tilt_deg` is each view's angle to the optical axis."""

    info: CameraInfo
    rms_px: float
    held_out_px: float
    views: int
    corners: int
    tilt_deg: tuple[float, ...]


def calibrate(views: Sequence[BoardView], size: tuple[int, int], model: Model, camera_name: str) -> Calibration:
    """ValueError where the views do not determine a lens. `size` is (width, height), px."""
    if len(views) < MIN_VIEWS:
        raise ValueError(f"{len(views)} views of the board are not enough for a lens; at least {MIN_VIEWS}, better 20")
    options = (False, True) if model == "pinhole" else (False,)
    held_out = {with_k3: _held_out_px(views, size, model, camera_name, with_k3) for with_k3 in options}
    with_k3 = len(options) == 2 and held_out[True] < K3_GAIN * held_out[False]
    info = _fitted(views, size, model, camera_name, with_k3)
    lens = lens_of(info)
    errors, tilts = [], []
    for view in views:
        R, p = board_pose(lens, view)
        errors.append(_residual(lens, view, R, p))
        tilts.append(float(np.degrees(np.arccos(min(1.0, abs(R[2, 2]))))))
    return Calibration(
        info, _rms(errors), held_out[with_k3], len(views), sum(len(view.pixels) for view in views), tuple(tilts)
    )


def lens_of(info: CameraInfo) -> CameraModel:
    """The lens of a calibration."""
    return CAMERA_MODELS[info.model](
        width_px=info.width_px,
        height_px=info.height_px,
        fx_px=info.fx_px,
        fy_px=info.fy_px,
        cx_px=info.cx_px,
        cy_px=info.cy_px,
        distortion=info.distortion,
    )


def board_pose(lens: CameraModel, view: BoardView) -> tuple[Points, Points]:
    """R_CBoard (3, 3) and the board's origin in C that explain the corners best, in pixels. ValueError where none does."""
    rays = lens.ray(view.pixels)
    ahead = rays[:, 2] > 0.1
    if np.count_nonzero(ahead) < 4:
        raise ValueError("a view of the board lies beyond what the lens can see")
    plane = rays[ahead, :2] / rays[ahead, 2:]
    ok, rotation, translation = cv2.solvePnP(view.board_points[ahead], plane, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE)
    if not ok:
        raise ValueError("a view of the board has no pose")
    R, p = np.asarray(cv2.Rodrigues(rotation)[0], np.float64), np.asarray(translation, np.float64).ravel()
    for _ in range(REFINEMENTS):
        R, p, step = _gauss_newton(lens, view, R, p)
        if step < 1e-9:
            break
    return R, p


def _gauss_newton(lens: CameraModel, view: BoardView, R: Points, p: Points) -> tuple[Points, Points, float]:
    """One step on the pixel error over a small turn and shift of the board, both in C."""
    turned = view.board_points @ R.T
    J_point = lens.jacobian(turned + p)
    x, y, z = turned.T
    zero = np.zeros_like(x)
    turning = np.stack((np.stack((zero, z, -y), 1), np.stack((-z, zero, x), 1), np.stack((y, -x, zero), 1)), 1)
    J = np.concatenate((J_point @ turning, J_point), axis=2).reshape(-1, 6)
    residual = (view.pixels - lens.project(turned + p)).ravel()
    usable = np.isfinite(residual) & np.isfinite(J).all(axis=1)
    step = np.linalg.lstsq(J[usable], residual[usable], rcond=None)[0]
    return np.asarray(cv2.Rodrigues(step[:3])[0] @ R), p + step[3:], float(np.abs(step).max())


def _residual(lens: CameraModel, view: BoardView, R: Points, p: Points) -> Points:
    return np.asarray(np.linalg.norm(lens.project(view.board_points @ R.T + p) - view.pixels, axis=1))


def _rms(errors: Sequence[Points]) -> float:
    return float(np.sqrt(np.mean(np.square(np.concatenate(list(errors))))))


def _held_out_px(
    views: Sequence[BoardView], size: tuple[int, int], model: Model, camera_name: str, with_k3: bool
) -> float:
    kept = [view for index, view in enumerate(views) if index % HOLD_OUT != HOLD_OUT - 1]
    lens = lens_of(_fitted(kept, size, model, camera_name, with_k3))
    tests = [view for index, view in enumerate(views) if index % HOLD_OUT == HOLD_OUT - 1]
    return _rms([_residual(lens, view, *board_pose(lens, view)) for view in tests])


def _fitted(
    views: Sequence[BoardView], size: tuple[int, int], model: Model, camera_name: str, with_k3: bool
) -> CameraInfo:
    try:
        K, distortion = _fit_fisheye(views, size) if model == "kannala_brandt" else _fit_pinhole(views, size, with_k3)
    except cv2.error as error:
        raise ValueError(
            f"the views do not determine a lens: tilt the board more, and to all sides ({error.err})"
        ) from error
    if not np.isfinite(K).all() or not np.isfinite(distortion).all() or K[0, 0] <= 0.0 or K[1, 1] <= 0.0:
        raise ValueError("the views do not determine a lens: tilt the board more, and to all sides")
    values = [float(value) for value in distortion]
    return CameraInfo(
        camera_name, model, *size, float(K[0, 0]), float(K[1, 1]), float(K[0, 2]), float(K[1, 2]), tuple(values)
    )


def _fit_pinhole(views: Sequence[BoardView], size: tuple[int, int], with_k3: bool) -> tuple[Points, Points]:
    board = [view.board_points.astype(np.float32).reshape(-1, 1, 3) for view in views]
    pixels = [view.pixels.astype(np.float32).reshape(-1, 1, 2) for view in views]
    flags = 0 if with_k3 else cv2.CALIB_FIX_K3
    _, K, distortion, _, _ = cv2.calibrateCamera(board, pixels, size, np.eye(3), np.zeros(5), flags=flags)
    return np.asarray(K, np.float64), np.ravel(np.asarray(distortion, np.float64))[:5]


def _fit_fisheye(views: Sequence[BoardView], size: tuple[int, int]) -> tuple[Points, Points]:
    """The best of several starts: from its own, and from one far off, OpenCV's solver stops with an assertion."""
    fits = [fit for share in FOCAL_SHARES if (fit := _fisheye_from(views, size, share * size[0])) is not None]
    if not fits:
        raise ValueError("no fisheye lens explains the views: is it one? else tilt the board more, and to all sides")
    _, K, distortion = min(fits, key=lambda fit: fit[0])
    return K, distortion


def _fisheye_from(
    views: Sequence[BoardView], size: tuple[int, int], focal_px: float
) -> tuple[float, Points, Points] | None:
    """(RMS, camera matrix, coefficients); None where the solver does not get there."""
    # This layout is the only one that its re-computation of the extrinsics takes.
    board = [view.board_points.reshape(1, -1, 3) for view in views]
    pixels = [view.pixels.reshape(1, -1, 2) for view in views]
    K0 = np.array([[focal_px, 0.0, size[0] / 2 - 0.5], [0.0, focal_px, size[1] / 2 - 0.5], [0.0, 0.0, 1.0]])
    flags = cv2.CALIB_RECOMPUTE_EXTRINSIC | cv2.CALIB_FIX_SKEW | cv2.CALIB_USE_INTRINSIC_GUESS
    until = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 100, 1e-9)
    try:
        rms, K, distortion, _, _ = cv2.fisheye.calibrate(
            board, pixels, size, K0, np.zeros((4, 1)), flags=flags, criteria=until
        )
    except cv2.error:
        return None
    matrix, coefficients = np.asarray(K, np.float64), np.ravel(np.asarray(distortion, np.float64))
    is_finite = bool(np.isfinite(rms) and np.isfinite(matrix).all() and np.isfinite(coefficients).all())
    return (float(rms), matrix, coefficients) if is_finite else None
