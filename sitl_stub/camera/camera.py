"""A simulated camera: poses in, picture out. Sans-IO; the same view and generator state give the same bytes.

Order of work: ground and sky, shadows, the deck's sides, its top, covers, board; then lens (softness, vignetting), light (tone
curve), sensor (noise) and compression. The world calls `render` at each capture and hands the frame out after its delay.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np

from sitl_stub.camera import PROJECTIONS
from sitl_stub.camera.curved import curved_painter
from sitl_stub.camera.deck_box import paint_board_back, paint_covers, paint_deck_shadow, paint_deck_sides
from sitl_stub.camera.ground import Ground, ground_of
from sitl_stub.camera.hidden import hidden_by_deck
from sitl_stub.camera.image import Floats, Image
from sitl_stub.camera.light import tone_curve
from sitl_stub.camera.linear import linear_painter
from sitl_stub.camera.motion import Twist, blur_plane, skew, twist_of
from sitl_stub.camera.mount import Pose, mount_rotation, pose
from sitl_stub.camera.noise import add_noise
from sitl_stub.camera.outline import Box
from sitl_stub.camera.pinhole import Pinhole
from sitl_stub.camera.projection import Projection
from sitl_stub.camera.scene import CameraView, Scene, Surface, surfaces_of
from sitl_stub.camera.shade import paint_glare, paint_shadow_edge
from sitl_stub.camera.spec import CameraSpec

_SKY_BGR = (235, 215, 200)
_SKY_GREY = 212


class Painter(Protocol):
    """Draws planes for one camera; linear.py or curved.py."""

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
    ) -> None: ...
    def paint_surface(self, canvas: Image, X_CS: Pose, twist: Twist, surface: Surface) -> Box | None: ...


@dataclass(frozen=True, slots=True, eq=False)
class Geometry:
    """One frame's poses and motions: W and P in C, and how both move against C."""

    X_CW: Pose
    X_WP: Pose
    X_CP: Pose
    twist_CW: Twist
    twist_CP: Twist


class Camera:
    """Built once for a scene; keeps nothing from frame to frame."""

    def __init__(self, spec: CameraSpec, scene: Scene) -> None:
        self.spec = spec
        self.scene = scene
        self.projection = PROJECTIONS[spec.model](spec.intrinsics)
        self._X_BC = Pose(mount_rotation(spec.mount_deg), np.array(spec.position_frd_m))
        self._painter = _painter(spec, self.projection)
        self._ground = ground_of(scene.ground, spec.colour)
        self._surfaces = surfaces_of(scene.pad, spec.colour)
        self._vignette = _vignette(spec)
        self._around_deck = hidden_by_deck(self.projection, spec.width_px, spec.height_px, scene.pad)
        self._focal_px = _focal_px(self.projection)
        self._sky = np.array(_SKY_BGR if spec.colour else _SKY_GREY, np.uint8)

    def render(self, view: CameraView, rng: np.random.Generator) -> Image:
        """(height, width) grey or (height, width, 3) BGR, uint8, newly allocated."""
        size = (self.spec.height_px, self.spec.width_px)
        canvas: Image = np.zeros(size + ((3,) if self.spec.colour else ()), np.uint8)
        if not view.is_black:
            self._paint(canvas, view)
            canvas = self._through_lens(canvas, view)
        effects, gain = self.spec.effects, view.light.noise_gain
        add_noise(canvas, effects.noise_sigma * gain, effects.shot_noise_sigma * gain, rng)
        return _compressed(canvas, effects.jpeg_quality) if effects.jpeg_quality else canvas

    def _paint(self, canvas: Image, view: CameraView) -> None:
        geometry = self._geometry(view)
        pad, light, projection = self.scene.pad, view.light, self.projection
        boxes = self._around_deck.boxes(geometry.X_CP)
        if boxes:
            self._paint_ground(canvas, boxes, view, geometry)
            paint_deck_sides(canvas, projection, geometry.X_CW, geometry.X_WP, pad, light)
        for i, surface in enumerate(self._surfaces):
            if i > 0:
                paint_board_back(canvas, projection, geometry.X_CP @ surface.X_PS, surface)
            box = self._painter.paint_surface(canvas, *_of_surface(geometry, surface), surface)
            if i == 0 and box is not None:
                paint_covers(canvas, projection, geometry.X_CP, view.covers)
                paint_shadow_edge(canvas, projection, geometry.X_CP, pad, light.shadow)
                paint_glare(canvas, projection, geometry.X_CP, light.glare)
            self._blur(canvas, box, *_of_surface(geometry, surface))

    def _paint_ground(self, canvas: Image, boxes: Sequence[Box], view: CameraView, geometry: Geometry) -> None:
        down_m, light = self.scene.ground_down_m, view.light
        drift_m = np.array(self._ground.drift_m_s) * (view.t_us * 1e-6)
        self._painter.paint_ground(
            canvas, boxes, geometry.X_CW, geometry.twist_CW, down_m, drift_m, self._ground, self._sky
        )
        paint_deck_shadow(canvas, self.projection, geometry.X_CW, geometry.X_WP, self.scene, light)
        below = Pose(np.eye(3), np.array([0.0, 0.0, down_m - geometry.X_WP.p[2]]))
        paint_shadow_edge(canvas, self.projection, geometry.X_CP @ below, None, light.shadow)
        offset_C = geometry.X_CW.R @ np.array([0.0, 0.0, down_m])
        ground = Pose(geometry.X_CW.R, geometry.X_CW.p + offset_C)
        for box in boxes:
            self._blur(canvas, box, ground, geometry.twist_CW.about(offset_C))

    def _blur(self, canvas: Image, box: Box | None, X_CS: Pose, twist: Twist) -> None:
        if box is not None and self.spec.effects.motion_blur and not twist.is_still:
            blur_plane(canvas, box, self.projection, X_CS, twist, self.spec.exposure_s, self._focal_px)

    def _through_lens(self, canvas: Image, view: CameraView) -> Image:
        softness = self.spec.effects.softness_px
        if softness > 0.0:
            canvas = np.asarray(cv2.GaussianBlur(canvas, (0, 0), softness), np.uint8)
        if self._vignette is not None:
            cv2.multiply(canvas, self._vignette, dst=canvas, scale=1.0 / 255.0)
        curve = tone_curve(view.light)
        return canvas if curve is None else np.asarray(cv2.LUT(canvas, curve), np.uint8)

    def _geometry(self, view: CameraView) -> Geometry:
        X_WB = pose(view.vehicle_position_ned_m, view.vehicle_q_ned_frd)
        X_WP = pose(view.deck_position_ned_m, view.deck_q_ned_pad)
        X_CW = (X_WB @ self._X_BC).inverse()
        omega = X_WB.R @ np.array(view.vehicle_angular_velocity_frd_rad_s)
        velocity = np.array(view.vehicle_velocity_ned_m_s) + skew(omega) @ (X_WB.R @ self._X_BC.p)
        camera = Twist(velocity, omega)
        X_CP = X_CW @ X_WP
        deck_omega = X_WP.R @ np.array(view.deck_angular_velocity_pad_rad_s)
        return Geometry(
            X_CW,
            X_WP,
            X_CP,
            twist_of(X_CW, np.zeros(3), np.zeros(3), camera, X_CW),
            twist_of(X_CP, np.array(view.deck_velocity_ned_m_s), deck_omega, camera, X_CW),
        )


def _painter(spec: CameraSpec, projection: Projection) -> Painter:
    """One homography a plane where that is exact, maps otherwise."""
    if isinstance(projection, Pinhole) and projection.is_linear and spec.effects.readout_s == 0.0:
        return linear_painter(projection)
    return curved_painter(projection, spec.width_px, spec.height_px, spec.effects.readout_s)


def _of_surface(geometry: Geometry, surface: Surface) -> tuple[Pose, Twist]:
    return geometry.X_CP @ surface.X_PS, geometry.twist_CP.about(geometry.X_CP.R @ surface.X_PS.p)


def _focal_px(projection: Projection) -> float:
    """Pixels a radian on the optical axis."""
    middle, aside = projection.project(np.array([[0.0, 0.0, 1.0], [1e-3, 0.0, 1.0]]))
    return float(np.hypot(*(aside - middle))) * 1e3


def _vignette(spec: CameraSpec) -> Image | None:
    """Gain of each pixel in 1 / 255: full at the centre, falling with the square of the distance to the corners."""
    if spec.effects.vignetting <= 0.0:
        return None
    x, y = np.arange(spec.width_px) - spec.intrinsics.cx_px, np.arange(spec.height_px) - spec.intrinsics.cy_px
    square = x[None, :] ** 2 + y[:, None] ** 2
    gain: Image = np.rint(255.0 * (1.0 - spec.effects.vignetting * square / square.max())).astype(np.uint8)
    return np.repeat(gain[..., None], 3, axis=2) if spec.colour else gain


def _compressed(image: Image, quality: int) -> Image:
    done, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    assert done
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_UNCHANGED), np.uint8)
