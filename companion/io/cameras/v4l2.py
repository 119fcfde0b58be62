"""v4l2:///dev/video0?width=1280&height=720&fps=30&fourcc=MJPG&exposure=50 - a USB or built-in camera.

The driver stamps its buffers on the monotonic clock; where it does not, the arrival has to do. `exposure` (driver's units)
switches automatic exposure off: a long exposure in poor light blurs the pad and moves the capture time.
"""

from __future__ import annotations

from collections.abc import AsyncIterator, Iterator
from pathlib import Path

import cv2

from companion.io.cameras.address import numbers, refuse_unknown, split
from companion.io.cameras.capture_thread import threaded_frames
from companion.io.cameras.frame import CameraError, CameraFrame
from companion.io.cameras.video_capture import live_frames

OPTIONS = ("width", "height", "fps", "fourcc", "exposure")
MANUAL_EXPOSURE = 1
"""V4L2_EXPOSURE_MANUAL."""


def v4l2_frames(url: str) -> AsyncIterator[CameraFrame]:
    """CameraError where there is no such device, or it is taken, or an option is unknown."""
    return threaded_frames(lambda: _open(url))


def _open(url: str) -> Iterator[CameraFrame]:
    device, options = split(url)
    refuse_unknown(url, options, OPTIONS)
    if not Path(device).exists():
        raise CameraError(f"{url}: there is no {device}; `ls /dev/video*` shows the cameras")
    capture = cv2.VideoCapture(device, cv2.CAP_V4L2)
    if not capture.isOpened():
        raise CameraError(f"{url}: {device} cannot be opened: in use, not permitted (group video), or not a camera")
    _set(capture, url, options)
    return live_frames(capture, url, has_driver_stamps=True)


def _set(capture: cv2.VideoCapture, url: str, options: dict[str, str]) -> None:
    capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
    if "fourcc" in options:
        if len(options["fourcc"]) != 4:
            raise CameraError(f"{url}: fourcc {options['fourcc']!r} must be four letters, such as MJPG or YUYV")
        capture.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*options["fourcc"]))
    values = numbers(url, {key: text for key, text in options.items() if key != "fourcc"})
    properties = {"width": cv2.CAP_PROP_FRAME_WIDTH, "height": cv2.CAP_PROP_FRAME_HEIGHT, "fps": cv2.CAP_PROP_FPS}
    for key, number in values.items():
        if key == "exposure":
            capture.set(cv2.CAP_PROP_AUTO_EXPOSURE, MANUAL_EXPOSURE)
            capture.set(cv2.CAP_PROP_EXPOSURE, number)
        else:
            capture.set(properties[key], number)
