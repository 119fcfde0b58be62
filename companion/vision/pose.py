"""Corners of the pad in an image to its pose X_CP, with covariance and the second pose that would explain them.

A planar target seen from afar has two poses with almost the same image (the tilt mirrored about the line of sight). IPPE
gives both; each is polished by Gauss-Newton on pixels with the real lens, and what is known beforehand decides: a pad is
nearly level, and it was predicted somewhere. The covariance is (J^T J)^-1 sigma^2 of the reprojection Jacobian.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from companion.geometry import dot, matrix_from_quaternion, quaternion_from_matrix
from companion.messages import Mat3, Quaternion, Vec3
from companion.vision.camera_model import Array, CameraModel, looking_at
from companion.vision.detector import DetectionHint

LEVEL_SIGMA_RAD = math.radians(8.0)
"""How level a pad is: a rover on a slope or a boat in waves, plus the error of the attitude at capture time."""
TRACK_SIGMA_RAD = math.radians(15.0)
"""How far the pad's predicted rotation may be off."""
AMBIGUOUS_CHI2 = 13.8
"""The second pose is kept while it is no less likely than this against the first (chi-square of two tilts at 99.9 %)."""
CLEARLY_WORSE_PX = 1.5
"""Root mean square reprojection error above the better pose's at which the other needs no polishing."""
_GAUSS_NEWTON_STEPS = 12
_BENT = 0.25
"""A Jacobian serves until a step moves a pixel otherwise than it said by more than this fraction of the step. Seen from
straight above, a small target's pixels hardly depend on its tilt to first order: steps along an old Jacobian go many degrees
too far there."""
_SETTLED_PX = 0.1
"""A step that a Jacobian foretold leaves little: after one that moves no corner by more than this there is nothing to gain."""


@dataclass(frozen=True, slots=True)
class PlanarPose:
    """p_CP in metres, q_CP, their covariances (rotation about the axes of C), and what the fit left over."""

    position_m: Vec3
    q: Quaternion
    position_covariance_m2: Mat3
    rotation_covariance_rad2: Mat3
    q_alternative: Quaternion | None
    reprojection_error_px: float


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
    R: Array
    p: Array
    squared_error_px2: float
    information_px2: Array


def planar_pose(
    points_P: Array, pixels: Array, camera: CameraModel, *, hint: DetectionHint | None, sigma_px: float
) -> PlanarPose | None:
    """Pose from four or more points (N, 3) and their pixels (N, 2); None where the geometry has no solution.

    The points lie in one plane, or the first four of them do (the first marker of several that do not).
    """
    flat = slice(None) if _are_coplanar(points_P) else slice(4)
    fits = _polished(points_P, pixels, camera, _both_guesses(points_P[flat], pixels[flat], camera))
    if not fits:
        return None
    # Corners that fit worse than sigma promises carry more error than sigma: the covariance follows what was seen.
    degrees_of_freedom = max(1, 2 * len(pixels) - 6)
    variance = max(sigma_px**2, min(fit.squared_error_px2 for fit in fits) / degrees_of_freedom)
    ranked = sorted(((_surprise(fit, hint, variance), k) for k, fit in enumerate(fits)))
    best = fits[ranked[0][1]]
    covariance = _inverse(best.information_px2)
    if covariance is None:
        return None
    rival = fits[ranked[1][1]] if len(ranked) > 1 and ranked[1][0] - ranked[0][0] < AMBIGUOUS_CHI2 else None
    return PlanarPose(
        position_m=(float(best.p[0]), float(best.p[1]), float(best.p[2])),
        q=_quaternion(best.R),
        position_covariance_m2=_mat3(covariance[:3, :3] * variance),
        rotation_covariance_rad2=_mat3(covariance[3:, 3:] * variance),
        q_alternative=_quaternion(rival.R) if rival is not None else None,
        reprojection_error_px=math.sqrt(best.squared_error_px2 / len(pixels)),
    )


def reprojected(points_P: Array, pose: PlanarPose, camera: CameraModel) -> Array:
    """(N, 2) pixels where the pose puts the points."""
    R = np.array(matrix_from_quaternion(pose.q))
    return camera.project(points_P @ R.T + np.array(pose.position_m))


def on_plane(pixels: Array, pose: PlanarPose, camera: CameraModel) -> Array:
    """(N, 3) points of the plane z = 0 of P that the pixels look at."""
    R = np.array(matrix_from_quaternion(pose.q))
    rays_P, eye_P = camera.ray(pixels) @ R, -np.array(pose.position_m) @ R
    return np.asarray(eye_P - rays_P * (eye_P[2] / rays_P[:, 2])[:, None])


def _are_coplanar(points_P: Array) -> bool:
    return len(points_P) <= 4 or bool((points_P == points_P[0]).all(axis=0).any())


def _both_guesses(points_P: Array, pixels: Array, camera: CameraModel) -> list[tuple[Array, Array]]:
    """IPPE in a virtual pinhole that looks at the target, so that any lens and any direction will do."""
    rays = camera.ray(pixels)
    R_VC = looking_at(rays.mean(axis=0))
    rays_V = rays @ R_VC.T
    if not np.isfinite(rays_V).all() or float(rays_V[:, 2].min()) < 0.05:
        return []
    plane = rays_V[:, :2] / rays_V[:, 2:]
    try:
        count, rotations, translations, errors = cv2.solvePnPGeneric(
            points_P, plane[:, None, :], np.eye(3), None, flags=cv2.SOLVEPNP_IPPE
        )
    except cv2.error:  # collinear or coincident corners
        return []
    guesses = []
    for k in range(int(count)):
        R = cv2.Rodrigues(rotations[k])[0]
        p = translations[k].reshape(3)
        # IPPE reports the better one first; one that is off by whole pixels more is no rival.
        excess_px = float(errors[k, 0] - errors[0, 0]) * camera.focal_px
        if math.isfinite(float(R.sum() + p.sum())) and excess_px <= CLEARLY_WORSE_PX:
            guesses.append((R_VC.T @ R, R_VC.T @ p))
    return guesses


def _polished(points_P: Array, pixels: Array, camera: CameraModel, guesses: list[tuple[Array, Array]]) -> list[_Fit]:
    """Gauss-Newton on the reprojection error, all guesses in one go; without those where a point falls behind the lens.

    A Jacobian serves while it foretells what a step does; the information is that of the last one.
    """
    if not guesses:
        return []
    R, p = np.array([guess[0] for guess in guesses]), np.array([guess[1] for guess in guesses])
    J: Array = np.empty(0)
    information: Array = J
    gain: Array = J
    moved, foretold = J, None
    for _ in range(_GAUSS_NEWTON_STEPS):
        turned = points_P @ R.transpose(0, 2, 1)
        left = _residual(turned + p[:, None], pixels, camera)
        in_front = np.isfinite(left).all(axis=1)
        if not in_front.all():
            return _polished(points_P, pixels, camera, [guesses[k] for k in np.flatnonzero(in_front)])
        move_px = math.inf if foretold is None else float(np.abs(moved).max())
        if foretold is None or float(np.abs(left - foretold).max()) > _BENT * max(move_px, _SETTLED_PX / 5.0):
            J = _jacobian(turned, turned + p[:, None], camera)
            J_T = J.transpose(0, 2, 1)
            information = np.asarray(J_T @ J, dtype=np.float64)
            try:
                gain = np.asarray(np.linalg.solve(information, J_T), dtype=np.float64)
            except np.linalg.LinAlgError:
                return []
        elif move_px < _SETTLED_PX:
            break
        step = (gain @ left[:, :, None])[:, :, 0]
        p = p + step[:, :3]
        turns = np.empty_like(R)
        for k, turn in enumerate(step[:, 3:]):
            turns[k] = cv2.Rodrigues(turn)[0]
        R = turns @ R
        moved = (J @ step[:, :, None])[:, :, 0]
        foretold = left - moved
    else:
        left = _residual(points_P @ R.transpose(0, 2, 1) + p[:, None], pixels, camera)
    return [
        _Fit(R[k], p[k], squared, information[k])
        for k, squared in enumerate((left * left).sum(axis=1).tolist())
        if math.isfinite(squared)
    ]


def _residual(points_C: Array, pixels: Array, camera: CameraModel) -> Array:
    """(G, 2N) of points (G, N, 3)."""
    return np.asarray(
        (pixels - camera.project(points_C.reshape(-1, 3)).reshape(-1, *pixels.shape)).reshape(len(points_C), -1)
    )


def _jacobian(turned: Array, points_C: Array, camera: CameraModel) -> Array:
    """(G, 2N, 6) derivative of the pixels by position and by a small rotation about the axes of C."""
    by_point = camera.jacobian(points_C.reshape(-1, 3))
    arms = turned.reshape(-1, 3)
    x, y, z = arms[:, 0, None], arms[:, 1, None], arms[:, 2, None]
    u, v, w = by_point[:, :, 0], by_point[:, :, 1], by_point[:, :, 2]
    J = np.empty((len(arms), 2, 6))
    J[:, :, :3] = by_point
    # d(theta x a) = theta x a: row . (theta x a) = theta . (a x row)
    J[:, :, 3], J[:, :, 4], J[:, :, 5] = y * w - z * v, z * u - x * w, x * v - y * u
    return J.reshape(len(points_C), -1, 6)


def _surprise(fit: _Fit, hint: DetectionHint | None, variance: float) -> float:
    """Minus twice the log likelihood, up to a constant: pixels, level pad, predicted rotation."""
    total = fit.squared_error_px2 / variance
    if hint is None:
        return total
    if hint.down_camera is not None:
        normal_C = (float(fit.R[0, 2]), float(fit.R[1, 2]), float(fit.R[2, 2]))
        total += (_angle(dot(normal_C, hint.down_camera)) / LEVEL_SIGMA_RAD) ** 2
    if hint.X_CP is not None:
        predicted = np.array(matrix_from_quaternion(hint.X_CP.q))
        total += (_angle((float((predicted * fit.R).sum()) - 1.0) / 2.0) / TRACK_SIGMA_RAD) ** 2
    return total


def rotation_angle(R: Array) -> float:
    """Angle of a rotation matrix, rad."""
    return _angle((float(np.trace(R)) - 1.0) / 2.0)


def _angle(cosine: float) -> float:
    return math.acos(max(-1.0, min(1.0, cosine)))


def _inverse(information: Array) -> Array | None:
    try:
        inverse = np.linalg.inv(information)
    except np.linalg.LinAlgError:
        return None
    usable = math.isfinite(float(inverse.sum())) and min(inverse.diagonal().tolist()) > 0.0
    return np.asarray(inverse, dtype=np.float64) if usable else None


def _quaternion(R: Array) -> Quaternion:
    return quaternion_from_matrix(_mat3(R))


def _mat3(M: Array) -> Mat3:
    a, b, c = M.tolist()
    return (tuple(a), tuple(b), tuple(c))
