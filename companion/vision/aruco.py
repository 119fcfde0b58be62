"""ArUco and AprilTag pads: one marker, a board of several, or markers nested in each other, as one landing point.

With a prediction the markers' edges are looked for where they must be, and the codes are read to prove it: no search at all.
Where a prediction is off by more than a cell, a marker's own picture tells the shift first.
Where that fails, the part of the image around the prediction is searched, then the whole image: the latter not in every
frame while a good prediction says that each marker is cut too far by the image's border to be read. A marker that was found says
where the others must be. Corners come from edge fits at full resolution and all markers go into one pose.
"""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from companion import config
from companion.geometry import Transform
from companion.messages import CameraImage, Image, PadNotSeen, PadObservation
from companion.vision import alignment, edges, pad_layout, pose, region, search
from companion.vision.camera_model import Array, CameraModel
from companion.vision.codes import CodeBook
from companion.vision.detector import Detection, DetectionHint
from companion.vision.level import is_possible

NAME = "aruco"
Ids = npt.NDArray[np.int64]
Markers = dict[int, Array]
"""Corners (4, 2) in the image by marker id, clockwise from the marker's top-left corner."""

_CORNER_BEFORE = np.array([3, 0, 1, 2])
_MIN_SIDE_PX = 8.0
"""Below this a code cannot be read."""
_REGION_SIDE_PX = 240
"""A region larger than this is searched at reduced size."""
_FINE_PX = 2.5
"""Reach of the last edge fit: a blurred edge and the error of the fit before."""
_CLOSER = 0.12
"""What is left of the reach after one edge fit: its cross-sections have a sample every sixth of the reach."""
_SETTLED_PX = 1.0
_MAX_FITS = 5
"""Fits are repeated at the fine reach until the corners move less than this, but not for ever."""
_ALIGNED = 0.1
"""What is left of a prediction's error after an alignment, as a fraction of the marker's side: turn, scale, whole pixels."""
_CUT = 0.25
"""A corner may lie outside the picture by this fraction of the marker's side: its edges are still met over most of their length."""
_CUT_SEARCHED = 10
"""One frame in so many is searched as a whole where every marker must be cut too far."""
_FOUND_SIGMA_PX = 1.5
"""How far the corners of a marker that was found without prediction may be off."""


class ArucoDetector:
    """See the module's text. Holds only what its construction gave it."""

    def __init__(self, vision: config.Vision, pad: config.Pad, camera: CameraModel) -> None:
        self._vision = vision
        self._camera = camera
        self._layout = pad_layout.from_config(pad)
        ids = sorted(self._layout.corners_P)
        self._ids = np.array(list(self._layout.corners_P))
        self._last_px = (camera.width_px - 2.0, camera.height_px - 2.0)
        self._points_P = np.concatenate(list(self._layout.corners_P.values()))
        cells = {marker_id: pad_layout.readable_cells(self._layout, marker_id) for marker_id in ids}
        family = pad_layout.dictionary(pad.family)
        self._book = CodeBook(family, ids, cells)
        self._pictures = {marker_id: alignment.picture(family, marker_id) for marker_id in ids}

    def detect(self, frame: CameraImage, hint: DetectionHint | None) -> Detection:
        """`PadObservation`, or `PadNotSeen` with the reason."""
        grey = grey_of(frame.image)
        if grey.shape != (self._camera.height_px, self._camera.width_px):
            return self._not_seen(frame, f"frame is {grey.shape[1]} x {grey.shape[0]}, not as calibrated")
        if self._vision.track and hint is not None:
            seen = self._observation(frame, self._tracked(grey, hint), hint)
            if isinstance(seen, PadObservation):
                return seen
            where = region.predicted_region(self._layout.extent_P, self._camera, hint)
            if where is not None:
                seen = self._found(frame, grey, self._in_region(grey, where), hint)
                if isinstance(seen, PadObservation) or (frame.sequence % _CUT_SEARCHED and self._is_cut(hint)):
                    return seen
        return self._anywhere(frame, grey, hint)

    def _anywhere(self, frame: CameraImage, grey: Image, hint: DetectionHint | None) -> Detection:
        """The first level of the search that gives a pose: a marker whose corner is covered gives none, one within it may."""
        seen: Detection = self._not_seen(frame, "no marker")
        for found in search.coarse_to_fine(grey, self._book):
            seen = self._found(frame, grey, found, hint)
            if isinstance(seen, PadObservation):
                break
        return seen

    def _found(
        self, frame: CameraImage, grey: Image, found: list[search.Found], hint: DetectionHint | None
    ) -> Detection:
        """What a search found, the first of each id, as an observation."""
        markers: Markers = {}
        for marker in found:
            markers.setdefault(marker.marker_id, marker.corners)
        return self._observation(frame, self._completed(grey, markers, hint), hint)

    def _observation(self, frame: CameraImage, markers: Markers, hint: DetectionHint | None) -> Detection:
        found = self._pose(markers, hint) if markers else None
        if found is None:
            return self._not_seen(frame, "corners have no pose" if markers else "no marker")
        if found.reprojection_error_px > self._vision.max_reprojection_error_px:
            return self._not_seen(frame, f"reprojection error {found.reprojection_error_px:.1f} px")
        if not is_possible(found.q, hint):
            return self._not_seen(frame, "pad stands on edge or upside down")
        return _observation(frame, markers, found)

    def _tracked(self, grey: Image, hint: DetectionHint) -> Markers:
        """The markers whose edges are met near their predicted places and whose codes prove it."""
        if hint.X_CP is None:
            return {}
        reach = self._reach_px(hint)
        ids, quads, beyond_px = self._expected(hint.X_CP)
        inside, near = beyond_px < 0.0, beyond_px < reach
        return self._proven(grey, ids[inside], quads[inside], reach) or self._proven(
            grey, ids[near], *self._shifted(grey, ids[near], quads[near], beyond_px[near], reach)
        )

    def _reach_px(self, hint: DetectionHint) -> float:
        return region.reach_px(hint, self._camera, max(self._layout.size_m.values()))

    def _shifted(
        self, grey: Image, ids: Ids, quads: Array, beyond_px: Array, reach_px: float
    ) -> tuple[Array, float | Array]:
        """The quadrangles moved to where one's marker looks right, and how far off they may still be: the largest that the
        border does not cut, or else the one that it cuts least."""
        if len(ids) == 0:
            return quads, 0.0
        side = _side_px(quads)
        outside_px = beyond_px + _CUT * side
        best = int(np.where(outside_px <= 0.0, side, -outside_px).argmax())
        shift = alignment.shift_px(grey, quads[best], self._pictures[int(ids[best])], reach_px)
        if shift is None:
            return quads[:0], 0.0
        return quads + shift, _ALIGNED * side

    def _is_cut(self, hint: DetectionHint) -> bool:
        """A prediction that is good to a quarter of a marker's side puts all of them too far out of the picture to be read."""
        if hint.X_CP is None:
            return False
        ids, quads, beyond_px = self._expected(hint.X_CP)
        if len(ids) == 0 or bool((beyond_px < 0.0).any()):
            return False
        return self._reach_px(hint) <= _CUT * float(_side_px(quads).max())

    def _proven(self, grey: Image, ids: Ids, quads: Array, reach_px: float | Array) -> Markers:
        """Those of the markers (M) that lie within reach of the corners (M, 4, 2)."""
        if len(quads) == 0:
            return {}
        refined, good = self._refined(grey, quads, reach_px)
        if not good.any():
            return {}
        return {
            reading.marker_id: refined[reading.candidate]
            for reading in self._book.read(grey, refined)
            if good[reading.candidate] and reading.marker_id == ids[reading.candidate] and reading.first_corner == 0
        }

    def _expected(self, X_CP: Transform) -> tuple[Ids, Array, Array]:
        """Markers that a pose makes large enough to read, where (M, 4, 2), and by how much they are cut more than may be (M,)."""
        quads = region.projected(self._points_P, X_CP, self._camera).reshape(-1, 4, 2)
        low, high = quads.min(axis=1), quads.max(axis=1)
        beyond_px = np.maximum(1.0 - low, high - self._last_px).max(axis=1)
        seen = (high - low).min(axis=1) >= _MIN_SIDE_PX  # false where the lens cannot see a corner (NaN)
        quads = quads[seen]
        return self._ids[seen], quads, beyond_px[seen] - _CUT * _side_px(quads)

    def _refined(self, grey: Image, quads: Array, reach_px: float | Array) -> tuple[Array, npt.NDArray[np.bool_]]:
        """Corners by their edges: from as far as the prediction may be off, less than a cell, down to the edge itself."""
        if self._vision.refine != "edges":
            kept = _subpix(grey, quads) if self._vision.refine == "subpix" else quads
            return kept, np.ones(len(quads), dtype=np.bool_)
        cell = _side_px(quads) / (self._layout.cells + 2)
        reach = np.clip(reach_px, _FINE_PX, np.maximum(0.9 * cell, _FINE_PX))
        good = np.zeros(len(quads), dtype=np.bool_)
        for _ in range(_MAX_FITS):
            before = quads
            quads, good = edges.refined(grey, before, reach_px=reach, camera=self._camera)
            if not good.any():
                break
            if float(reach.max()) <= _FINE_PX and float(np.abs(quads - before).max(initial=0.0)) <= _SETTLED_PX:
                break
            reach = np.maximum(_CLOSER * reach, _FINE_PX)
        return quads, good

    def _in_region(self, grey: Image, where: region.Region) -> list[search.Found]:
        part = grey[where.top : where.bottom, where.left : where.right]
        shrink = max(1, -(-max(part.shape) // _REGION_SIDE_PX))
        offset = np.array([where.left, where.top], dtype=np.float64)
        found = search.at_level(part, self._book, search.Level(shrink, 10.0, 25))
        return [search.Found(marker.marker_id, marker.corners + offset, marker.correlation) for marker in found]

    def _completed(self, grey: Image, markers: Markers, hint: DetectionHint | None) -> Markers:
        """What a search found, refined, and with it the markers that the search missed."""
        if not markers:
            return {}
        rough = self._pose(markers, hint)
        if rough is None:
            return {}
        reach = _FOUND_SIGMA_PX * max(1.0, max(_side_px(quad[None])[0] for quad in markers.values()) / 60.0)
        ids, quads, beyond_px = self._expected(Transform(q=rough.q, p=rough.position_m))
        inside = beyond_px < 0.0
        proven = self._proven(grey, ids[inside], quads[inside], 2.0 * reach)
        if proven:
            return proven
        quads, _ = self._refined(grey, np.stack(list(markers.values())), reach)
        return dict(zip(markers, quads, strict=True))

    def _pose(self, markers: Markers, hint: DetectionHint | None) -> pose.PlanarPose | None:
        points_P = np.concatenate([self._layout.corners_P[marker_id] for marker_id in markers])
        pixels = np.concatenate(list(markers.values()))
        return pose.planar_pose(points_P, pixels, self._camera, hint=hint, sigma_px=self._vision.pixel_sigma_px)

    def _not_seen(self, frame: CameraImage, reason: str) -> PadNotSeen:
        return PadNotSeen(frame.t_ns, frame.camera, NAME, reason)


def grey_of(image: Image) -> Image:
    """The image itself when it is grey already."""
    return image if image.ndim == 2 else np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)


def _observation(frame: CameraImage, markers: Markers, found: pose.PlanarPose) -> PadObservation:
    return PadObservation(
        t_ns=frame.t_ns,
        camera=frame.camera,
        detector=NAME,
        pad_position_camera_m=found.position_m,
        position_covariance_m2=found.position_covariance_m2,
        q_camera_pad=found.q,
        rotation_covariance_rad2=found.rotation_covariance_rad2,
        q_camera_pad_alternative=found.q_alternative,
        marker_ids=tuple(markers),
        corners_px=tuple((float(u), float(v)) for quad in markers.values() for u, v in quad),
        reprojection_error_px=found.reprojection_error_px,
    )


def _side_px(quads: Array) -> Array:
    """(M,) mean side."""
    sides = quads - quads[:, _CORNER_BEFORE]
    return np.asarray(np.sqrt((sides * sides).sum(axis=2)).sum(axis=1) / 4.0)


def _subpix(grey: Image, quads: Array) -> Array:
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 30, 0.01)
    corners = quads.reshape(-1, 1, 2).astype(np.float32)
    return np.asarray(cv2.cornerSubPix(grey, corners, (3, 3), (-1, -1), criteria), dtype=np.float64).reshape(-1, 4, 2)
