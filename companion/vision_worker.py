"""The detector in a process of its own: frames in, observations and the camera's health out.

In a thread, the parts of a detector that are Python and not OpenCV hold the interpreter lock and delay setpoints by ten
milliseconds and more (benchmarks/setpoint_timing.py). One frame is under way at a time; which frame comes next is the caller's choice.
"""

from __future__ import annotations

import asyncio
import signal
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context

import cv2
import numpy as np

from companion.config import Config
from companion.io.cameras.frame import decoded
from companion.messages import CameraImage, Health, Image
from companion.vision import DETECTORS, Detection, DetectionHint
from companion.vision.frame_watch import PictureWatch
from companion.vision.lens import from_config
from companion.vision.watched_detector import WatchedDetector

_detector: WatchedDetector | None = None


@dataclass(frozen=True, slots=True)
class Seen:
    """What one frame gave."""

    detection: Detection
    health: tuple[Health, ...]


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
        self,
        camera: str,
        content: Image | bytes,
        *,
        t_ns: int,
        sequence: int,
        hint: DetectionHint | None,
        capture_uncertainty_ns: int = 0,
    ) -> Seen:
        """What the frame, a picture or its JPEG, shows."""
        loop = asyncio.get_running_loop()
        stamp = (t_ns, sequence, capture_uncertainty_ns)
        return await loop.run_in_executor(self._pool, _look, camera, content, stamp, hint)

    def close(self) -> None:
        self._pool.shutdown(wait=False, cancel_futures=True)


def build_detector(config: Config) -> WatchedDetector:
    """The detector that the configuration names, for the camera that it names, with a watch on that camera."""
    camera = config.cameras[config.vision.camera]
    watch = PictureWatch(config.vision.camera, width_px=camera.width_px, height_px=camera.height_px)
    detector = DETECTORS[config.vision.detector](config.vision, config.pad, from_config(camera))
    return WatchedDetector(detector, config.vision.detector, watch)


def _start(config: Config) -> None:
    global _detector
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to handle: the last frames still count
    cv2.setNumThreads(1)
    _detector = build_detector(config)


def _look(camera: str, content: Image | bytes, stamp: tuple[int, int, int], hint: DetectionHint | None) -> Seen:
    assert _detector is not None
    t_ns, sequence, uncertainty_ns = stamp
    image = decoded(content) if isinstance(content, bytes) else content
    if image is None:
        detection = _detector.unreadable(t_ns, camera, "the frame is not a readable picture")
    else:
        detection = _detector.detect(CameraImage(t_ns, camera, image, sequence, uncertainty_ns), hint)
    return Seen(detection, _detector.take_health())
