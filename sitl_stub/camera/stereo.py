"""Two cameras side by side in one frame: the left picture, then the right one, as stereo cameras on USB deliver them.

Both are exposed at the same instant through equal, parallel lenses; noise and what the world shows each of them are their own.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sitl_stub.camera.camera import Camera
from sitl_stub.camera.image import Image
from sitl_stub.camera.scene import CameraView, Scene
from sitl_stub.camera.spec import CameraSpec, stereo_pair


class StereoCamera:
    """`spec` is that of the whole frame: its width is twice that of one picture, its lens and place are the left camera's."""

    def __init__(self, spec: CameraSpec, scene: Scene) -> None:
        if spec.width_px % 2:
            raise ValueError(f"camera {spec.name}: a frame of two pictures has an even width, not {spec.width_px} px")
        self.spec = spec
        one = replace(spec, width_px=spec.width_px // 2)
        self._eyes = [Camera(eye, scene) for eye in stereo_pair(one, spec.stereo_baseline_m)]

    def render(self, view: CameraView, rng: np.random.Generator) -> Image:
        """(height, width) grey or (height, width, 3) BGR, uint8, newly allocated."""
        return np.asarray(np.hstack([eye.render(view, rng) for eye in self._eyes]), np.uint8)
