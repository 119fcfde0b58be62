"""The detector in a process of its own: compressed frames in, observations out.

In a thread, the parts of a detector that are Python and not OpenCV hold the interpreter lock and delay setpoints by ten
milliseconds and more (benchmarks/setpoint_timing.py). One frame is under way at a time; which frame comes next is the caller's choice.
"""

from __future__ import annotations

import asyncio
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import cv2
import numpy as np

from companion.config import Config
from companion.messages import CameraImage, PadNotSeen
from companion.vision import DETECTORS, Detection, DetectionHint, Detector
from companion.vision.lens import from_config

_detector: Detector | None = None
_detector_name = ""


class VisionWorker:
    """Owns the process."""

    def __init__(self, config: Config) -> None:
        self._config = config
        self._pool = ProcessPoolExecutor(1, mp_context=get_context("spawn"), initializer=_start, initargs=(config,))

    async def warm_up(self) -> None:
        """Start the process and let it load its libraries, before anything depends on it."""
        camera = self._config.cameras[self._config.vision.camera]
        blank = np.full((camera.height_px, camera.width_px), 127, np.uint8)
        jpeg = cv2.imencode(".jpg", blank)[1].tobytes()
        await self.look(self._config.vision.camera, jpeg, t_ns=0, sequence=0, hint=None)

    async def look(
        self, camera: str, jpeg: bytes, *, t_ns: int, sequence: int, hint: DetectionHint | None
    ) -> Detection:
        """What the frame shows."""
        loop = asyncio.get_running_loop()
        return await loop.run_in_executor(self._pool, _look, camera, jpeg, t_ns, sequence, hint)

    def close(self) -> None:
        self._pool.shutdown(wait=False, cancel_futures=True)


def build_detector(config: Config) -> Detector:
    """The detector that the configuration names, for the camera that it names."""
    camera = config.cameras[config.vision.camera]
    return DETECTORS[config.vision.detector](config.vision, config.pad, from_config(camera))


def _start(config: Config) -> None:
    global _detector, _detector_name
    cv2.setNumThreads(1)
    _detector, _detector_name = build_detector(config), config.vision.detector


def _look(camera: str, jpeg: bytes, t_ns: int, sequence: int, hint: DetectionHint | None) -> Detection:
    assert _detector is not None
    image = cv2.imdecode(np.frombuffer(jpeg, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    if image is None:
        return PadNotSeen(t_ns, camera, _detector_name, "the frame is not a readable JPEG")
    return _detector.detect(CameraImage(t_ns, camera, np.asarray(image, np.uint8), sequence), hint)
