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
_FRACTIONS: Array = np.linspace(_TRIM, 1.0 - _TRIM, SAMPLES)
_WITH_ENDS: Array = np.concatenate(([0.0], _FRACTIONS, [1.0]))
_POWERS: Array = np.column_stack((np.ones(SAMPLES), _FRACTIONS, _FRACTIONS**2))
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
        feet, outward = _straight_sections(quads)
    else:
        feet, outward = _bent_sections(quads, camera)
    weight, place = edge_places(image, feet, outward[:, :, 1:-1], offsets_within(reach_px))
    start, end, fitted = _fitted_offsets(weight, place, reach_px)
    move = _meeting(outward[:, _BEFORE, -1], end[:, _BEFORE], outward[:, :, 0], start)
    length = np.sqrt(np.einsum("mki,mki->mk", move, move)).max(axis=1)
    good = fitted & (length <= 2.0 * reach_px + 1.0)
    return np.where(good[:, None, None], quads + move, quads), good


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
    levels = values.reshape(M, edges, S, K).astype(np.float64)
    rise = np.maximum(levels[..., 1:] - levels[..., :-1], 0.0)
    squared = rise * rise
    middles = 0.5 * (offsets[:, 1:] + offsets[:, :-1])
    weight = squared.sum(axis=3)
    moment = (squared.reshape(M, edges * S, K - 1) @ middles[:, :, None]).reshape(M, edges, S)
    return weight, moment / np.maximum(weight, 1e-9)


def _straight_sections(quads: Array) -> tuple[Array, Array]:
    """Feet (M, 4, S, 2) on the edges and unit normals (M, 4, 3, 2): at the edge's start, on it, and at its end."""
    along = quads[:, _AFTER] - quads
    feet = quads[:, :, None, :] + along[:, :, None, :] * _FRACTIONS[None, None, :, None]
    return feet, np.repeat(_left_of(along)[:, :, None, :], 3, axis=2)


def _bent_sections(quads: Array, camera: CameraModel) -> tuple[Array, Array]:
    """The same on the image of the chord between the corners; a normal (M, 4, S + 2, 2) for each foot and both ends."""
    rays = camera.ray(quads.reshape(-1, 2)).reshape(-1, 4, 3)
    chord = rays[:, _AFTER] - rays
    on_chord = rays[:, :, None, :] + chord[:, :, None, :] * _WITH_ENDS[None, None, :, None]
    path = camera.project(on_chord.reshape(-1, 3)).reshape(-1, 4, SAMPLES + 2, 2)
    return path[:, :, 1:-1], _left_of(np.gradient(path, axis=2))


def _left_of(along: Array) -> Array:
    """Unit vectors out of a quadrangle whose sides run clockwise in the image (y down): the direction turned left."""
    length = np.maximum(np.sqrt(np.einsum("...i,...i->...", along, along)), 1e-6)
    return np.asarray(np.stack((along[..., 1] / length, -along[..., 0] / length), axis=-1))


def _fitted_offsets(weight: Array, place: Array, reach_px: Array) -> tuple[Array, Array, Mask]:
    """Offsets (M, 4) of each edge's line at its start and end, and (M,) whether all four edges hold.

    Weighted least squares of the offset over the fraction, once more without the places that lie far off. An edge holds
    where most places stay, they scatter less than noise would, and it is not faint beside the others.
    """
    typical = _median(weight)
    w = np.minimum(np.sqrt(weight), 2.0 * np.sqrt(typical))  # one bright spot does not rule
    distance = np.abs(place - _line_through(place, w) @ _POWERS[:, :2].T)
    spread = _median(distance)
    w = np.where(distance <= 3.0 * spread + 0.05, w, 0.0)
    line = _line_through(place, w)
    holds = (
        (np.count_nonzero(w, axis=2) >= SAMPLES // 2)
        & (
            spread[..., 0] <= np.maximum(0.4, 0.15 * reach_px)[:, None]
        )  # noise alone scatters over a quarter of the reach
        & (typical[..., 0] >= _MIN_STRENGTH * typical.max(axis=1))
    )
    return line[..., 0], line[..., 0] + line[..., 1], holds.all(axis=1)


def _line_through(place: Array, w: Array) -> Array:
    """(M, 4, 2) offset at fraction 0 and slope."""
    s, p = w @ _POWERS, (w * place) @ _POWERS
    determinant = np.maximum(s[..., 0] * s[..., 2] - s[..., 1] * s[..., 1], 1e-12)
    line = np.empty((*place.shape[:2], 2))
    line[..., 0] = (s[..., 2] * p[..., 0] - s[..., 1] * p[..., 1]) / determinant
    line[..., 1] = (s[..., 0] * p[..., 1] - s[..., 1] * p[..., 0]) / determinant
    return line


def _median(values: Array) -> Array:
    """(M, 4, 1) upper median over the cross-sections; numpy's own costs ten times as much on arrays this small."""
    middle = SAMPLES // 2
    return np.asarray(np.partition(values, middle, axis=2)[..., middle : middle + 1])


def _meeting(normal_a: Array, offset_a: Array, normal_b: Array, offset_b: Array) -> Array:
    """(M, 4, 2) move that lies `offset` along both normals; far too long where the two edges are parallel."""
    determinant = normal_a[..., 0] * normal_b[..., 1] - normal_a[..., 1] * normal_b[..., 0]
    safe = np.where(np.abs(determinant) < 1e-3, 1e-3, determinant)
    x = (offset_a * normal_b[..., 1] - offset_b * normal_a[..., 1]) / safe
    y = (offset_b * normal_a[..., 0] - offset_a * normal_b[..., 0]) / safe
    return np.stack((x, y), axis=-1)
