"""The tag of `falanga`: a black cross in a black ring on a white quadrangle, with the paper's order of fallbacks.

The ring is looked for first, then the cross alone (the ring leaves the view near the deck), then the cross's four inner
corners (nearer still its arms leave the view as well), then the corners of the white deck. The ring's outline, fitted at full resolution, gives the pose together with the cross's twelve corners; RANSAC throws
out those that do not fit. The tag looks the same after a quarter turn: yaw is the one nearest to the prediction, and without
a prediction no rotation is reported. The paper prints no dimensions: ring 0.1 of the outer diameter wide, cross spanning 0.6
with bars 0.15 wide.
"""

from __future__ import annotations

import itertools
import math

import cv2
import numpy as np

from companion import config
from companion.geometry import matrix_from_quaternion, quaternion_from_matrix
from companion.messages import CameraImage, Image, PadNotSeen, PadObservation, Quaternion
from companion.vision import edges, pose, region
from companion.vision.aruco import grey_of
from companion.vision.camera_model import Array, CameraModel
from companion.vision.detector import Detection, DetectionHint
from companion.vision.level import is_possible
from companion.vision.quads import dark_quads, dark_regions
from companion.vision.search import shrunk

NAME = "cross"
RING_INSIDE = 0.40
HALF_SPAN = 0.30
HALF_BAR = 0.075
"""Radius of the ring's inside and the cross's half lengths, in outer diameters."""
_SHRINKS = (4, 2, 1)
_REFITS = 2
"""Rounds of matching the outline to the circle."""
_DECK_CANDIDATES = 3
_INNER_SIDE_PX = 40.0
"""The inner corners alone are taken from near only: far away the whole cross is in view."""
_INNER_SHRINK = 4
_RANSAC_PX = 2.0
_RING_CONTRAST = 12.0
"""Grey levels between the ring and the white around it, on the average: far away it is not much."""
_DECK_CONTRAST = 40.0
"""Grey levels between a white deck and the ground beside it."""

_RAYS = 48
_TURN = np.arange(_RAYS) * (2.0 * math.pi / _RAYS)
_CIRCLE = np.column_stack((np.cos(_TURN), np.sin(_TURN)))

Points = tuple[Array, Array]
"""Points (N, 3) in P, metres, and where they are in the image (N, 2)."""


class CrossDetector:
    """See the module's text. The pad's first marker is the tag; its `size_m` is the ring's outer diameter."""

    def __init__(self, vision: config.Vision, pad: config.Pad, camera: CameraModel) -> None:
        self._vision = vision
        self._camera = camera
        self._tag = pad.markers[0]
        half_x, half_y, (x, y) = pad.length_m / 2.0, pad.width_m / 2.0, pad.deck_center_m
        deck = ((half_x, -half_y), (half_x, half_y), (-half_x, half_y), (-half_x, -half_y))
        self._deck_P = np.array([(x + dx, y + dy, 0.0) for dx, dy in deck])

    def detect(self, frame: CameraImage, hint: DetectionHint | None) -> Detection:
        """`PadObservation`, or `PadNotSeen` with the reason."""
        grey = grey_of(frame.image)
        where = region.predicted_region(self._deck_P, self._camera, hint) if self._vision.track and hint else None
        level = DetectionHint(down_camera=hint.down_camera) if hint is not None else None
        for part in (where, region.Region(0, 0, grey.shape[1], grey.shape[0])):
            if part is None:
                continue
            for stage in (self._from_ring, self._from_cross, self._from_inner_corners, self._from_deck):
                found = stage(grey, part, level)
                observation = self._observation(frame, found, hint) if found is not None else None
                if observation is not None:
                    return observation
        return PadNotSeen(frame.t_ns, frame.camera, NAME, "neither ring nor cross nor quadrangle")

    # ---------------------------------------------------------------------------------------------------------- stages

    def _from_ring(self, grey: Image, part: region.Region, level: DetectionHint | None) -> Points | None:
        """The ring's outline and, where they agree with it, the cross's corners."""
        for shrink in _SHRINKS:
            for ellipse in rings(_part_of(grey, part, shrink)):
                centre, axes = _unshrunk(ellipse[0], part, shrink), ellipse[1] * shrink
                heading = cross_heading(grey, centre, axes)
                if heading is not None:
                    outline = refined_outline(grey, centre, axes)
                    flat = (outline - centre) @ np.linalg.inv(axes).T
                    return self._ring_points(grey, outline, np.arctan2(flat[:, 1], flat[:, 0]) - heading, level)
        return None

    def _ring_points(self, grey: Image, outline: Array, angle: Array, level: DetectionHint | None) -> Points | None:
        """Which point of the circle each outline pixel is, by a pose from the cross's corners.

        `angle` (N,) is the first match, from the tag's +x arm. Matching by the ring's own pose hardly converges: points
        slide along a circle. Corners of a blurred cross are pulled inward, so that they match and the ring measures.
        """
        arms = self._on_pad(self._tag.size_m * _CROSS)
        points = self._on_circle(angle)
        for _ in range(_REFITS):
            rough = self._pose(points, outline, level)
            at = pose.reprojected(arms, rough, self._camera) if rough is not None else None
            cross = self._pose(arms, _subpix(grey, at), level) if at is not None and _is_within(grey, at) else None
            if cross is None:
                return None
            back = pose.on_plane(outline, cross, self._camera)[:, :2] - self._tag.position_m
            points = self._on_circle(np.arctan2(back[:, 1], back[:, 0]))
        _, kept = cv2.findHomography(points[:, :2], outline, cv2.RANSAC, _RANSAC_PX)
        fits = np.asarray(kept, dtype=np.uint8).reshape(-1) > 0
        return points[fits], outline[fits]

    def _pose(self, points_P: Array, pixels: Array, level: DetectionHint | None) -> pose.PlanarPose | None:
        return pose.planar_pose(points_P, pixels, self._camera, hint=level, sigma_px=self._vision.pixel_sigma_px)

    def _on_circle(self, angle: Array) -> Array:
        return self._on_pad(self._tag.size_m / 2.0 * np.column_stack((np.cos(angle), np.sin(angle))))

    def _from_cross(self, grey: Image, part: region.Region, level: DetectionHint | None) -> Points | None:
        """The cross alone: its twelve corners, of which the inner four say which way round it is."""
        for shrink in _SHRINKS:
            for outline in dark_regions(
                _part_of(grey, part, shrink), window_px=41, contrast=10.0, min_side_px=20.0, limit=30
            ):
                corners = cross_corners(outline)
                if corners is not None:
                    fine = _subpix(grey, _unshrunk(corners, part, shrink))
                    return self._on_pad(self._tag.size_m * _CROSS), fine
        return None

    def _from_inner_corners(self, grey: Image, part: region.Region, level: DetectionHint | None) -> Points | None:
        """The four inner corners of a cross whose arms the edge of the image cuts off; black and white fill the view there."""
        small = _part_of(grey, part, _INNER_SHRINK)
        _, dark = cv2.threshold(small, 0, 255, cv2.THRESH_BINARY_INV + cv2.THRESH_OTSU)
        outlines, _ = cv2.findContours(dark, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        for outline in sorted(outlines, key=cv2.contourArea, reverse=True)[:_DECK_CANDIDATES]:
            inner = inner_corners(outline.reshape(-1, 2).astype(np.float64), (small.shape[1], small.shape[0]))
            if inner is None or _shortest_side(inner) * _INNER_SHRINK < _INNER_SIDE_PX:
                continue
            return self._on_pad(self._tag.size_m * _CROSS[_INWARD]), _subpix(
                grey, _unshrunk(inner, part, _INNER_SHRINK)
            )
        return None

    def _from_deck(self, grey: Image, part: region.Region, level: DetectionHint | None) -> Points | None:
        """The corners of the largest white quadrangle."""
        negative = np.asarray(cv2.bitwise_not(grey), dtype=np.uint8)
        for shrink, contrast in itertools.product(_SHRINKS[:2], (10.0, 25.0, 40.0)):
            quads = dark_quads(
                _part_of(negative, part, shrink),
                window_px=41, contrast=contrast, min_side_px=12.0, max_side_px=1e4, limit=40,
            )  # fmt: skip
            side = np.linalg.norm(quads[:, 0] - quads[:, 2], axis=1)
            for quad in quads[np.argsort(-side)][:_DECK_CANDIDATES]:
                corners = self._deck_corners(negative, _unshrunk(quad[None], part, shrink), shrink)
                if corners is not None and self._is_deck(grey, corners):
                    return self._deck_P, corners
        return None

    def _is_deck(self, grey: Image, corners: Array) -> bool:
        """Whether a quadrangle is the deck: darker where the ring must be than around it or, where the tag is soiled, white
        against the ground all along its border. Grass has pale quadrangles too."""
        H = cv2.getPerspectiveTransform(self._deck_P[:, :2].astype(np.float32), corners.astype(np.float32))
        radii = self._tag.size_m * np.array([0.45, 0.53])  # middle of the ring, and the white outside it
        rings_P = radii[:, None, None] * _CIRCLE[None] + self._tag.position_m
        ring, around = _levels(grey, rings_P, H)
        if float(around.mean() - ring.mean()) > _RING_CONTRAST:
            return True
        middle = self._deck_P[:, :2].mean(axis=0)
        border = np.concatenate(
            [np.linspace(a, b, 12) for a, b in itertools.pairwise([*self._deck_P, self._deck_P[0]])]
        )
        within, beyond = _levels(grey, middle + np.array([0.93, 1.1])[:, None, None] * (border[:, :2] - middle), H)
        return float(np.mean(within - beyond > _DECK_CONTRAST)) > 0.9

    def _deck_corners(self, negative: Image, quad: Array, shrink: int) -> Array | None:
        good = np.zeros(1, dtype=bool)
        for reach_px in (3.0 * shrink, 2.0 * shrink, float(shrink), 2.5):
            quad, good = edges.refined(negative, quad, reach_px=np.array([reach_px]), camera=self._camera)
        return np.asarray(quad[0]) if good[0] else None

    # ------------------------------------------------------------------------------------------------------------ pose

    def _on_pad(self, xy: Array) -> Array:
        return np.column_stack((xy + self._tag.position_m, np.zeros(len(xy))))

    def _observation(self, frame: CameraImage, points: Points, hint: DetectionHint | None) -> PadObservation | None:
        points_P, pixels = points
        if len(pixels) < 4:
            return None
        level = DetectionHint(down_camera=hint.down_camera) if hint is not None else None
        found = self._pose(points_P, pixels, level)
        if found is None or found.reprojection_error_px > self._vision.max_reprojection_error_px:
            return None
        if not is_possible(found.q, hint):
            return None
        predicted = hint.X_CP.q if hint is not None and hint.X_CP is not None else None
        return PadObservation(
            t_ns=frame.t_ns,
            camera=frame.camera,
            detector=NAME,
            pad_position_camera_m=found.position_m,
            position_covariance_m2=found.position_covariance_m2,
            q_camera_pad=nearest_quarter_turn(found.q, predicted) if predicted is not None else None,
            rotation_covariance_rad2=found.rotation_covariance_rad2 if predicted is not None else None,
            corners_px=tuple((float(u), float(v)) for u, v in pixels),
            reprojection_error_px=found.reprojection_error_px,
        )


_b, _s = HALF_BAR, HALF_SPAN
_CROSS = np.array(
    [(_s, -_b), (_s, _b), (_b, _b), (_b, _s), (-_b, _s), (-_b, _b), (-_s, _b), (-_s, -_b), (-_b, -_b), (-_b, -_s), (_b, -_s), (_b, -_b)]
)  # fmt: skip
"""Corners (x, y) of the cross in outer diameters, clockwise seen from above, from the left end of the arm towards +x."""
_INWARD = [2, 5, 8, 11]
"""Which of them are the inner ones."""


def rings(grey: Image) -> list[tuple[Array, Array]]:
    """Ellipses (centre (2,), axes (2, 2) that map the unit circle onto it) that closed dark outlines follow, largest first."""
    found = []
    for outline in dark_regions(grey, window_px=21, contrast=10.0, min_side_px=12.0, limit=40):
        (u, v), (width, height), angle_deg = cv2.fitEllipseDirect(outline.astype(np.float32))
        if not (math.isfinite(u + v + width + height) and min(width, height) > 0.3 * max(width, height) > 3.0):
            continue
        c, s = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
        axes = np.array([[c * width / 2.0, -s * height / 2.0], [s * width / 2.0, c * height / 2.0]])
        # Turn the parameter so that the map is a pure stretch: no rotation, no mirror.
        axes = _stretch(axes)
        radius = np.linalg.norm((outline - (u, v)) @ np.linalg.inv(axes).T, axis=1)
        if float(np.mean(np.abs(radius - 1.0) * math.sqrt(width * height) / 2.0)) < 0.5 + 0.01 * width:
            found.append((np.array([u, v]), axes))
    return sorted(found, key=lambda ellipse: -abs(float(np.linalg.det(ellipse[1]))))


def cross_heading(grey: Image, centre: Array, axes: Array) -> float | None:
    """Angle (clockwise in the image, from its right) of an arm of the cross in the ellipse; None where there is none.

    Read on the unit circle that the ellipse is: dark in the ring, light inside and outside it, four dark arms half way.
    """
    radii = np.array([0.90, 1.10, 0.70, 0.42])
    at = centre + (radii[:, None, None] * _CIRCLE[None]) @ axes.T
    levels = cv2.remap(grey, at[..., 0].astype(np.float32), at[..., 1].astype(np.float32), cv2.INTER_LINEAR).astype(
        float
    )
    ring, outside, inside, arms = levels
    white, black = float(np.median(inside)), float(np.median(ring))
    middle = (white + black) / 2.0
    framed = np.mean(ring < middle) > 0.85 and np.mean(inside > middle) > 0.85 and np.mean(outside > middle) > 0.6
    if white - black < 15.0 or not framed:
        return None
    # The share of the arms' darkness that repeats four times a turn; its phase is their direction.
    darkness = white - arms
    fourth = complex(np.sum(darkness * np.exp(4j * _TURN)))
    if abs(fourth) < 0.35 * float(np.sum(np.abs(darkness))):
        return None
    return float(np.angle(fourth)) / 4.0


def refined_outline(grey: Image, centre: Array, axes: Array) -> Array:
    """(N, 2) places on the ring's outer edge, by the squared gradient across it."""
    feet = centre + _CIRCLE @ axes.T
    normal = _CIRCLE @ np.linalg.inv(axes)
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    reach = min(6.0, max(2.0, 0.06 * math.sqrt(abs(float(np.linalg.det(axes))))))
    weight = np.ones(_RAYS)
    for reach_px in (reach, 2.0, 2.0):  # from the edge itself, so that the window cuts nothing off on one side
        weights, places = edges.edge_places(grey, feet[None, None], normal[None, None], np.array([reach_px]))
        weight, feet = weights[0, 0], feet + normal * places[0, 0][:, None]
    return np.asarray(feet[weight > 0.1 * np.median(weight)])


def cross_corners(outline: Array) -> Array | None:
    """(12, 2) corners of a cross in the order of `_CROSS`, from a region's outline; None where it is something else."""
    closed = outline.astype(np.float32).reshape(-1, 1, 2)
    polygon = _clockwise(
        cv2.approxPolyDP(closed, 0.02 * cv2.arcLength(closed, True), True).reshape(-1, 2).astype(float)
    )
    if len(polygon) != 12:
        return None
    inward = np.flatnonzero(_turns(polygon) < 0.0)
    if len(inward) != 4 or set(np.diff(inward)) - {3}:
        return None
    # In _CROSS the third corner is the first inward one.
    return np.asarray(np.roll(polygon, 2 - int(inward[0]), axis=0))


def inner_corners(outline: Array, size_px: tuple[int, int]) -> Array | None:
    """(4, 2) corners at which the outline of a dark region turns inward, clockwise, where there are just four, about a square
    and none at the edge of the image of that size; else None."""
    closed = outline.astype(np.float32).reshape(-1, 1, 2)
    polygon = _clockwise(
        cv2.approxPolyDP(closed, 0.008 * cv2.arcLength(closed, True), True).reshape(-1, 2).astype(float)
    )
    if len(polygon) < 8:
        return None
    inner = polygon[_turns(polygon) < 0.0]
    if len(inner) != 4 or np.any(inner < 2.0) or np.any(inner > np.array(size_px) - 3.0):
        return None
    sides = np.linalg.norm(np.roll(inner, -1, axis=0) - inner, axis=1)
    is_square = bool(np.all(_turns(inner) > 0.0)) and float(sides.min()) > 0.6 * float(sides.max())
    return inner if is_square else None


def _clockwise(polygon: Array) -> Array:
    """The same corners, clockwise in the image."""
    return polygon[::-1] if float(_turns(polygon).sum()) < 0.0 else polygon


def _turns(polygon: Array) -> Array:
    """(N,) cross product of the edges before and after each corner: positive where a clockwise outline turns outward."""
    edge = np.roll(polygon, -1, axis=0) - polygon
    before = np.roll(edge, 1, axis=0)
    return np.asarray(before[:, 0] * edge[:, 1] - before[:, 1] * edge[:, 0])


def _shortest_side(corners: Array) -> float:
    return float(np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1).min())


def nearest_quarter_turn(q_CP: Quaternion, predicted: Quaternion) -> Quaternion:
    """Of the four rotations that look the same, the one nearest to the prediction."""
    R, target = np.array(matrix_from_quaternion(q_CP)), np.array(matrix_from_quaternion(predicted))
    turns = [np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) for c, s in ((1, 0), (0, 1), (-1, 0), (0, -1))]
    best = min((R @ turn for turn in turns), key=lambda M: pose.rotation_angle(target.T @ M))
    a, b, c = ((float(row[0]), float(row[1]), float(row[2])) for row in best)
    return quaternion_from_matrix((a, b, c))


def _levels(grey: Image, points_P: Array, H: cv2.typing.MatLike) -> Array:
    """Grey levels (A, N) at points (A, N, 2) of the pad's plane, which H maps to the image."""
    pixels = cv2.perspectiveTransform(points_P.reshape(-1, 1, 2), H).reshape(points_P.shape).astype(np.float32)
    return np.asarray(cv2.remap(grey, pixels[..., 0], pixels[..., 1], cv2.INTER_LINEAR), dtype=np.float64)


def _stretch(axes: Array) -> Array:
    """The symmetric map with the same ellipse."""
    U, S, _ = np.linalg.svd(axes)
    return np.asarray(U @ np.diag(S) @ U.T)


def _part_of(grey: Image, part: region.Region, shrink: int) -> Image:
    return shrunk(np.ascontiguousarray(grey[part.top : part.bottom, part.left : part.right]), shrink)


def _unshrunk(pixels: Array, part: region.Region, shrink: int) -> Array:
    """Pixels of `_part_of` as pixels of the whole image."""
    return np.asarray((pixels + 0.5) * shrink - 0.5 + (part.left, part.top))


def _is_within(grey: Image, pixels: Array) -> bool:
    """OpenCV refuses corners that lie outside the image."""
    return bool(np.all(pixels >= 0.0) and np.all(pixels <= np.array(grey.shape[1::-1]) - 1.0))


def _subpix(grey: Image, corners: Array) -> Array:
    half = int(np.clip(0.03 * float(np.ptp(corners, axis=0).max()), 2.0, 12.0))
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 20, 0.02)
    start = corners.astype(np.float32).reshape(-1, 1, 2)
    return np.asarray(cv2.cornerSubPix(grey, start, (half, half), (-1, -1), criteria), dtype=np.float64).reshape(-1, 2)
