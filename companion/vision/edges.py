"""Corners by their edges: where the lines of a quadrangle meet, to about 0.02 px.

Corner finders that look at the corner itself pull it inward (1 to 5 % of the range on small markers). The straight edges
between corners hold far more pixels: sample the image across each edge, take the centroid of the squared gradient as the
edge's place on each cross-section, fit a line to these places, weighted, and intersect neighbouring lines.
All quadrangles of a frame are refined in one vectorised call. Pixel centres are at integer coordinates.
"""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from companion.messages import Image
from companion.vision.camera_model import Array, CameraModel, looking_at

Mask = npt.NDArray[np.bool_]

SAMPLES = 24
"""Cross-sections along an edge."""
_TRIM = 0.10
"""Fraction of the edge left out at each end, where the neighbouring edge disturbs the gradient."""


def refined(image: Image, quads: Array, *, reach_px: Array, camera: CameraModel | None = None) -> tuple[Array, Mask]:
    """Quadrangles (M, 4, 2) with corners moved to the intersections of their edge lines, and (M,) whether it went well.

    `reach_px` (M,) is how far from the given edges the true ones are searched. A dark quadrangle on a light ground is
    expected: only gradients that brighten outwards count. Where a fit fails the quadrangle is returned unchanged. With a
    lens that bends lines, the search follows the bent edge and the lines are fitted to rays.
    """
    if camera is not None and not camera.keeps_lines_straight:
        return _refined_bent(image, quads, reach_px, camera)
    along = np.roll(quads, -1, axis=1) - quads
    feet = quads[:, :, None, :] + along[:, :, None, :] * _FRACTIONS[None, None, :, None]
    outward = _left_of(along)[:, :, None, :]
    weight, place = edge_places(image, feet, outward, offsets_within(reach_px))
    lines, fitted = _lines(feet + outward * place[..., None], weight, 0.05, _scatter_limit(reach_px))
    return _accepted(quads, _intersections(lines), fitted, reach_px)


def _refined_bent(image: Image, quads: Array, reach_px: Array, camera: CameraModel) -> tuple[Array, Mask]:
    """The same where straight edges look bent: feet on the image of the chord, lines on a plane across the line of sight."""
    M = len(quads)
    rays = camera.ray(quads.reshape(-1, 2)).reshape(M, 4, 3)
    chord = np.roll(rays, -1, axis=1) - rays
    on_chord = rays[:, :, None, :] + chord[:, :, None, :] * _FRACTIONS[None, None, :, None]
    feet = camera.project(on_chord.reshape(-1, 3)).reshape(M, 4, SAMPLES, 2)
    outward = _left_of(np.gradient(feet, axis=2))
    weight, place = edge_places(image, feet, outward, offsets_within(reach_px))
    seen = camera.ray((feet + outward * place[..., None]).reshape(-1, 2)).reshape(M, -1, 3)
    R_VC = np.stack([looking_at(middle) for middle in rays.mean(axis=1)])
    seen_V = np.einsum("mij,mnj->mni", R_VC, seen)
    points = (seen_V[..., :2] / seen_V[..., 2:]).reshape(M, 4, SAMPLES, 2)
    lines, fitted = _lines(points, weight, 0.05 / camera.focal_px, _scatter_limit(reach_px) / camera.focal_px)
    corners_V = _intersections(lines)
    corners_C = np.einsum("mij,mnj->mni", R_VC.transpose(0, 2, 1), np.insert(corners_V, 2, 1.0, axis=2))
    corners = camera.project(corners_C.reshape(-1, 3)).reshape(M, 4, 2)
    return _accepted(quads, corners, fitted, reach_px)


def _scatter_limit(reach_px: Array) -> Array:
    """(M,) px. Places found in noise alone scatter over the whole reach, with a median near a quarter of it."""
    return np.asarray(np.maximum(0.4, 0.15 * reach_px))


def _left_of(along: Array) -> Array:
    """Unit vectors out of a quadrangle whose sides run clockwise in the image (y down): the direction turned left."""
    length = np.maximum(np.linalg.norm(along, axis=-1, keepdims=True), 1e-6)
    return np.asarray(np.stack((along[..., 1], -along[..., 0]), axis=-1) / length)


def _accepted(quads: Array, corners: Array, fitted: Mask, reach_px: Array) -> tuple[Array, Mask]:
    moved = np.linalg.norm(corners - quads, axis=2).max(axis=1)
    good = fitted.all(axis=1) & np.isfinite(moved) & (moved <= 2.0 * reach_px + 1.0)
    return np.where(good[:, None, None], corners, quads), good


_MIN_STRENGTH = 0.03
"""Squared gradient of an edge against the strongest of its quadrangle: less is noise beside a real edge. Motion blur over
ten pixels leaves a tenth."""
_STEPS: Array = np.arange(-6, 7) / 6.0
_FRACTIONS: Array = np.linspace(_TRIM, 1.0 - _TRIM, SAMPLES)


def offsets_within(reach_px: Array) -> Array:
    """(M, K) signed distances along the normal."""
    return np.asarray(reach_px[:, None] * _STEPS[None, :])


def edge_places(image: Image, feet: Array, outward: Array, offsets: Array) -> tuple[Array, Array]:
    """Weight (the sum of squared gradients) and offset (px along the normal) of the edge on each cross-section, (M, E, S).

    `feet` (M, E, S, 2) and unit `outward` (broadcast to it) span the cross-sections, `offsets` (M, K) the samples on them;
    only gradients that brighten outwards count.
    """
    M, edges, S, _ = feet.shape
    K = offsets.shape[1]
    at = feet[:, :, :, None, :] + outward[:, :, :, None, :] * offsets[:, None, None, :, None]
    flat = at.reshape(M * edges, S * K, 2).astype(np.float32)  # remap takes less than 32767 rows
    values = cv2.remap(image, flat[..., 0], flat[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    rise = np.maximum(np.diff(values.reshape(M, edges, S, K).astype(np.float64), axis=3), 0.0)
    squared = rise * rise
    middles = 0.5 * (offsets[:, 1:] + offsets[:, :-1])[:, None, None, :]
    weight = squared.sum(axis=3)
    place = (squared * middles).sum(axis=3) / np.maximum(weight, 1e-9)
    return weight, place


def _lines(points: Array, weight: Array, slack: float, limit: Array) -> tuple[Array, Mask]:
    """Weighted total least squares lines (M, 4, 3) as n . x = c, refitted once without outliers; and whether they hold.

    Points within three median distances and `slack` (in the points' unit) stay; a median distance above `limit` (M,) is no
    line.
    """
    strength = _median(weight)[..., 0]
    w = np.sqrt(weight)  # the squared gradient already favours strong edges; its root keeps one bright spot from ruling
    w = np.minimum(w, 2.0 * _median(w))
    for _ in range(2):
        lines = _fitted_lines(points, w)
        distance = np.abs(np.einsum("mesi,mei->mes", points, lines[..., :2]) - lines[..., 2:])
        spread = _median(distance)
        w = np.where(distance <= 3.0 * spread + slack, w, 0.0)
    fitted = ((w > 0.0).sum(axis=2) >= SAMPLES // 2) & (spread[..., 0] <= limit[:, None])
    return lines, fitted & (strength >= _MIN_STRENGTH * strength.max(axis=1, keepdims=True))


def _median(values: Array) -> Array:
    """(M, 4, 1) upper median over the cross-sections; numpy's own costs ten times as much on arrays this small."""
    middle = SAMPLES // 2
    return np.asarray(np.partition(values, middle, axis=2)[..., middle : middle + 1])


def _fitted_lines(points: Array, w: Array) -> Array:
    total = np.maximum(w.sum(axis=2), 1e-9)
    centre = np.einsum("mesi,mes->mei", points, w) / total[..., None]
    d = points - centre[:, :, None, :]
    xx = np.einsum("mes,mes->me", d[..., 0] * d[..., 0], w)
    yy = np.einsum("mes,mes->me", d[..., 1] * d[..., 1], w)
    xy = np.einsum("mes,mes->me", d[..., 0] * d[..., 1], w)
    angle = 0.5 * np.arctan2(2.0 * xy, xx - yy)  # direction of the line
    n = np.stack((-np.sin(angle), np.cos(angle)), axis=2)
    c = np.einsum("mei,mei->me", n, centre)
    return np.concatenate((n, c[..., None]), axis=2)


def _intersections(lines: Array) -> Array:
    """(M, 4, 2): corner k is where edge k-1 meets edge k; NaN where they are parallel."""
    before = np.roll(lines, 1, axis=1)
    determinant = before[..., 0] * lines[..., 1] - before[..., 1] * lines[..., 0]
    determinant = np.where(np.abs(determinant) < 1e-3, np.nan, determinant)
    x = (before[..., 2] * lines[..., 1] - before[..., 1] * lines[..., 2]) / determinant
    y = (before[..., 0] * lines[..., 2] - before[..., 2] * lines[..., 0]) / determinant
    return np.stack((x, y), axis=2)
