"""When a camera takes pictures, what is wrong with them, and when they are handed out. The pictures are camera/'s.

A `Capture` is a picture that is taken but not yet rendered: poses at mid-exposure. Rendering it later, or in another
thread, gives the same bytes, as long as the captures of one camera are rendered in order.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from sitl_stub.camera.camera import Camera
from sitl_stub.camera.scene import CameraView
from sitl_stub.camera.stereo import StereoCamera
from sitl_stub.rotation import Quaternion, Vec3, from_rotation_vector, multiply

Image = npt.NDArray[np.uint8]


LATENESS: dict[str, Callable[[np.random.Generator], float]] = {
    "constant": lambda rng: 0.0,
    "uniform": lambda rng: float(rng.random()),
    "exponential": lambda rng: float(rng.exponential()),
}
"""How much of its spread a camera's delay takes this time, by `delay_kind`."""


@dataclass(frozen=True, slots=True, eq=False)
class CameraFrame:
    """One picture, (height, width) grey or (height, width, 3) BGR, as it is handed out at capture time plus delay."""

    camera: str
    t_capture_us: int
    sequence: int
    image: Image


@dataclass(frozen=True, slots=True, eq=False)
class Capture:
    """A picture to be rendered: `channel.render(capture)`."""

    channel: CameraChannel
    t_capture_us: int
    due_us: int
    sequence: int
    view: CameraView
    is_frozen: bool

    def render(self) -> CameraFrame:
        return self.channel.render(self)


class CameraChannel:
    """One camera's clock, delay, drops and faults. `rng` is its own; timing and pixels draw from different ones."""

    def __init__(
        self, camera: Camera | StereoCamera, rng_timing: np.random.Generator, rng_pixels: np.random.Generator
    ) -> None:
        spec = camera.spec
        self.name = spec.name
        self.is_frozen = self.is_stopped = self.is_black = False
        self.next_us = 0
        self._camera = camera
        self._rng_timing, self._rng_pixels = rng_timing, rng_pixels
        self._period_us = 1e6 / spec.rate_hz
        self._ticks = 0
        self._sequence = 0
        self._last_due_us = 0
        self._last_image: Image | None = None
        self._late_share = LATENESS[spec.delay_kind]
        # Cameras are not in step with each other or with the simulation.
        self._phase_us = float(rng_timing.uniform(0.0, self._period_us))
        self._schedule()

    def _schedule(self) -> None:
        self.next_us = round(self._phase_us + self._ticks * self._period_us)
        self._ticks += 1

    def skip_to(self, t_us: int) -> None:
        """Leave out what should have been taken before `t_us` (a clock that was not known until now)."""
        while self.next_us < t_us:
            missing = int((t_us - self._phase_us) / self._period_us)
            self._ticks = max(self._ticks, missing)
            self._schedule()

    def capture(self, view: CameraView) -> Capture | None:
        """The picture of `next_us`; None when the camera drops it. Goes on to the next."""
        t_us = self.next_us
        self._schedule()
        spec = self._camera.spec
        late_s = spec.delay_spread_s * self._late_share(self._rng_timing)
        is_dropped = self._rng_timing.random() < spec.drop_probability
        self._sequence += 1
        if self.is_stopped or is_dropped:
            return None
        self._last_due_us = max(t_us + round((spec.delay_s + late_s) * 1e6), self._last_due_us)
        return Capture(self, t_us, self._last_due_us, self._sequence - 1, view, self.is_frozen)

    def render(self, capture: Capture) -> CameraFrame:
        """Paint it; a frozen camera hands out its last picture again."""
        if not (capture.is_frozen and self._last_image is not None):
            self._last_image = self._camera.render(capture.view, self._rng_pixels)
        return CameraFrame(self.name, capture.t_capture_us, capture.sequence, self._last_image)


def jpeg(image: Image, quality: int) -> bytes:
    """The picture as a JPEG file."""
    done, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not done:
        raise ValueError(f"cannot compress an image of shape {image.shape}")
    return data.tobytes()


def turned_back(q: Quaternion, rates_rad_s: Vec3, dt_s: float) -> Quaternion:
    """Attitude `dt_s` earlier at constant body rates; for the few milliseconds between a capture and the step after it."""
    p, r, s = rates_rad_s
    return multiply(q, from_rotation_vector(-p * dt_s, -r * dt_s, -s * dt_s))
