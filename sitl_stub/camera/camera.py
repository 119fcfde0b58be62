"""A simulated camera: poses in, picture out. Sans-IO; the same view and generator state give the same bytes.

Order of work: ground and sky, the deck's shadow, its sides, its top and board, covers, shadow edge, lens, light, sensor. The
world calls `render` at each capture and hands the frame out after its delay.
"""

from __future__ import annotations

import cv2
import numpy as np

from sitl_stub.camera import PROJECTIONS
from sitl_stub.camera.deck_box import paint_deck_shadow, paint_deck_sides
from sitl_stub.camera.ground import ground_pyramid
from sitl_stub.camera.image import Image
from sitl_stub.camera.light import tone_curve
from sitl_stub.camera.linear import linear_painter
from sitl_stub.camera.mount import Pose, mount_rotation, pose
from sitl_stub.camera.noise import add_noise
from sitl_stub.camera.scene import CameraView, Scene, surfaces_of
from sitl_stub.camera.spec import CameraSpec


class Camera:
    """Built once for a scene; `render` keeps nothing from frame to frame but its buffers."""

    def __init__(self, spec: CameraSpec, scene: Scene) -> None:
        self.spec = spec
        self.scene = scene
        self.X_BC = Pose(mount_rotation(spec.mount_deg), np.array(spec.position_frd_m))
        self.projection = PROJECTIONS[spec.model](spec.intrinsics)
        self._painter = linear_painter(self.projection)
        self._ground = ground_pyramid(scene.ground, spec.colour)
        self._surfaces = surfaces_of(scene.pad, spec.colour)

    def render(self, view: CameraView, rng: np.random.Generator) -> Image:
        """(height, width) grey or (height, width, 3) BGR, uint8, newly allocated."""
        size = (self.spec.height_px, self.spec.width_px)
        canvas: Image = np.empty(size + ((3,) if self.spec.colour else ()), np.uint8)
        self._paint(canvas, view)
        canvas = np.asarray(cv2.LUT(canvas, tone_curve(view.light)), np.uint8)
        effects = self.spec.effects
        gain = view.light.noise_gain
        return add_noise(canvas, effects.noise_sigma * gain, effects.shot_noise_sigma * gain, rng)

    def _paint(self, canvas: Image, view: CameraView) -> None:
        X_WB = pose(view.vehicle_position_ned_m, view.vehicle_q_ned_frd)
        X_CW = (X_WB @ self.X_BC).inverse()
        X_WP = pose(view.deck_position_ned_m, view.deck_q_ned_pad)
        sky = np.array([235, 215, 200] if self.spec.colour else 212, np.uint8)
        self._painter.paint_ground(canvas, X_CW, self.scene.ground_down_m, self._ground, sky)
        paint_deck_shadow(canvas, self.projection, X_CW, X_WP, self.scene, view.light)
        paint_deck_sides(canvas, self.projection, X_CW, X_WP, self.scene.pad, view.light)
        X_CP = X_CW @ X_WP
        for surface in self._surfaces:
            self._painter.paint_surface(canvas, X_CP @ surface.X_PS, surface)
