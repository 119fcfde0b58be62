"""Corners by their edges: where the lines of a quadrangle meet, to about 0.02 px.

Corner finders that look at the corner itself pull it inward (1 to 5 % of the range on small markers). The straight edges
between corners hold far more pixels: sample the image across each edge, take the centroid of the squared gradient as the
edge's place on each cross-section, fit a line to these places, weighted, and move each corner to where its two lines meet.
All quadrangles of a frame are refined in one vectorised call. Pixel centres are at integer coordinates.
"""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from companion.messages import Image
from companion.vision.camera_model import Array, CameraModel

Mask = npt.NDArray[np.bool_]

SAMPLES = 24
"""Cross-sections along an edge."""
_TRIM = 0.10
"""Fraction of the edge left out at each end, where the neighbouring edge disturbs the gradient."""
_MIN_STRENGTH = 0.03
"""Squared gradient of an edge against the strongest of its quadrangle: less is noise beside a real edge. Motion blur over
ten pixels leaves a tenth."""
_STEPS: Array = np.arange(-6, 7) / 6.0
"""Samples of a cross-section, in reaches along the normal."""
_MIDDLES = np.arange(-11, 12, 2)
"""Middles between the samples, in twelfths of the reach: whole numbers, so that sums over grey levels are exact in float32."""
_SUMS = np.stack((np.ones(12), _MIDDLES)).astype(np.float32)
_FRACTIONS: Array = np.linspace(_TRIM, 1.0 - _TRIM, SAMPLES)
_WITH_ENDS: Array = np.concatenate(([0.0], _FRACTIONS, [1.0]))
_POWERS: Array = np.column_stack((np.ones(SAMPLES), _FRACTIONS, _FRACTIONS**2))
_ALONG: Array = _POWERS[:, :2].T
_PICKS: Array = np.array([(1.0, fraction, step) for step in _STEPS for fraction in _FRACTIONS]).T
"""Samples of a straight edge (3, K * S): shares of its start, of its length along it, and of the reach across it."""
_BEFORE = np.array([3, 0, 1, 2])
"""The edge that ends at each corner; the edge of the same number starts there."""
_AFTER = np.array([1, 2, 3, 0])


def refined(image: Image, quads: Array, *, reach_px: Array, camera: CameraModel | None = None) -> tuple[Array, Mask]:
    """Quadrangles (M, 4, 2) with corners moved to the intersections of their edge lines, and (M,) whether it went well.

    `reach_px` (M,) is how far from the given edges the true ones are searched. A dark quadrangle on a light ground is
    expected: only gradients that brighten outwards count. Where a fit fails the quadrangle is returned unchanged. With a
    lens that bends lines, `camera` makes the search follow the bent edges. The result is exact to the square of the move:
    call again where the first call moved far.
    """
    if camera is None or camera.keeps_lines_straight:
        along = quads[:, _AFTER] - quads
        at_start = at_end = _left_of(along)
        weight, place = _straight_places(image, quads, along, at_start, reach_px)
    else:
        feet, outward = _bent_sections(quads, camera)
        at_start, at_end = outward[:, :, 0], outward[:, :, -1]
        weight, place = edge_places(image, feet, outward[:, :, 1:-1], reach_px)
    start, end, fitted = _fitted_offsets(weight, place, reach_px)
    move = _meeting(at_end[:, _BEFORE], end[:, _BEFORE], at_start, start)
    squared = (move * move).sum(axis=2).max(axis=1)
    good = fitted & (squared <= (2.0 * reach_px + 1.0) ** 2)
    return np.where(good[:, None, None], quads + move, quads), good


def edge_places(image: Image, feet: Array, outward: Array, reach_px: Array) -> tuple[Array, Array]:
    """Weight (the sum of squared gradients) and offset (px along the normal) of the edge on each cross-section, (M, E, S).

    `feet` (M, E, S, 2) and unit `outward` (broadcast to it) span the cross-sections, `reach_px` (M,) is half their length;
    only gradients that brighten outwards count.
    """
    step = (reach_px[:, None] * _STEPS)[:, None, :, None]
    at = np.moveaxis(feet, 3, 0)[:, :, :, None] + np.moveaxis(outward, 3, 0)[:, :, :, None] * step
    return _places(image, at, feet.shape[:3], reach_px)


def _straight_places(image: Image, quads: Array, along: Array, normal: Array, reach_px: Array) -> tuple[Array, Array]:
    """`edge_places` on the straight sides of quadrangles."""
    frame = np.empty((2, len(quads), 4, 3))
    frame[..., 0], frame[..., 1] = quads.transpose(2, 0, 1), along.transpose(2, 0, 1)
    frame[..., 2] = (normal * reach_px[:, None, None]).transpose(2, 0, 1)
    return _places(image, frame.reshape(-1, 3) @ _PICKS, (len(quads), 4, SAMPLES), reach_px)


def _places(image: Image, at: Array, shape: tuple[int, ...], reach_px: Array) -> tuple[Array, Array]:
    """The same from the samples' columns and rows, (2, M, E, K, S) in this order; `shape` is (M, E, S)."""
    M, edges, S = shape
    columns, rows = at.astype(np.float32).reshape(2, M * edges, -1)  # remap takes less than 32767 rows
    levels = cv2.remap(image, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    rise = cv2.subtract(levels[:, S:], levels[:, :-S])  # saturates: what darkens outwards is 0
    squared = cv2.multiply(rise, rise, dtype=cv2.CV_32F).reshape(M * edges, -1, S)
    sums = (_SUMS @ squared).astype(np.float64)
    weight, moment = sums[:, 0].reshape(shape), sums[:, 1].reshape(shape)
    return weight, moment / np.maximum(weight, 1e-9) * (reach_px / 12.0)[:, None, None]


def _bent_sections(quads: Array, camera: CameraModel) -> tuple[Array, Array]:
    """The same on the image of the chord between the corners; a normal (M, 4, S + 2, 2) for each foot and both ends."""
    rays = camera.ray(quads.reshape(-1, 2)).reshape(-1, 4, 3)
    chord = rays[:, _AFTER] - rays
    on_chord = rays[:, :, None, :] + chord[:, :, None, :] * _WITH_ENDS[None, None, :, None]
    path = camera.project(on_chord.reshape(-1, 3)).reshape(-1, 4, SAMPLES + 2, 2)
    return path[:, :, 1:-1], _left_of(np.gradient(path, axis=2))


def _left_of(along: Array) -> Array:
    """Unit vectors out of a quadrangle whose sides run clockwise in the image (y down): the direction turned left."""
    x, y = along[..., 0], along[..., 1]
    length = np.maximum(np.hypot(x, y), 1e-6)
    normal = np.empty_like(along)
    normal[..., 0], normal[..., 1] = y / length, -x / length
    return normal


def _fitted_offsets(weight: Array, place: Array, reach_px: Array) -> tuple[Array, Array, Mask]:
    """Offsets (M, 4) of each edge's line at its start and end, and (M,) whether all four edges hold.

    Weighted least squares of the offset over the fraction, once more without the places that lie far off. An edge holds
    where most places stay, they scatter less than noise would, and it is not faint beside the others.
    """
    typical = _median(weight)
    w = np.minimum(np.sqrt(weight), 2.0 * np.sqrt(typical))  # one bright spot does not rule
    distance = np.abs(place - _line_through(place, w) @ _ALONG)
    spread = _median(distance)
    w *= distance <= 3.0 * spread + 0.05
    line = _line_through(place, w)
    holds = (
        ((w > 0.0).sum(axis=2) >= SAMPLES // 2)
        & (
            spread[..., 0] <= np.maximum(0.4, 0.15 * reach_px)[:, None]
        )  # noise alone scatters over a quarter of the reach
        & (typical[..., 0] >= _MIN_STRENGTH * typical.max(axis=1))
    )
    return line[..., 0], line[..., 0] + line[..., 1], holds.all(axis=1)


def _line_through(place: Array, w: Array) -> Array:
    """(M, 4, 2) offset at fraction 0 and slope."""
    weighted = np.empty((2, *place.shape))
    weighted[0] = w
    np.multiply(w, place, out=weighted[1])
    sums = (weighted.reshape(-1, SAMPLES) @ _POWERS).reshape(2, *place.shape[:2], 3)
    s0, s1, s2 = sums[0, ..., 0], sums[0, ..., 1], sums[0, ..., 2]
    p0, p1 = sums[1, ..., 0], sums[1, ..., 1]
    determinant = np.maximum(s0 * s2 - s1 * s1, 1e-12)
    line = np.empty((*place.shape[:2], 2))
    line[..., 0] = (s2 * p0 - s1 * p1) / determinant
    line[..., 1] = (s0 * p1 - s1 * p0) / determinant
    return line


def _median(values: Array) -> Array:
    """(M, 4, 1) upper median over the cross-sections; numpy's own costs ten times as much on arrays this small."""
    middle = SAMPLES // 2
    return np.asarray(np.partition(values, middle, axis=2)[..., middle : middle + 1])


def _meeting(normal_a: Array, offset_a: Array, normal_b: Array, offset_b: Array) -> Array:
    """(M, 4, 2) move that lies `offset` along both normals; far too long where the two edges are parallel."""
    determinant = normal_a[..., 0] * normal_b[..., 1] - normal_a[..., 1] * normal_b[..., 0]
    safe = np.where(np.abs(determinant) < 1e-3, 1e-3, determinant)
    move = np.empty_like(normal_a)
    move[..., 0] = (offset_a * normal_b[..., 1] - offset_b * normal_a[..., 1]) / safe
    move[..., 1] = (offset_b * normal_a[..., 0] - offset_a * normal_b[..., 0]) / safe
    return move
