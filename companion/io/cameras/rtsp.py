"""rtsp://user:password@host[:port]/path - a network camera, by OpenCV's FFMPEG.

The stream's stamps are on the camera's own clock, so frames count from their arrival; decoders hold frames back, which makes
`delay_s` 0.1 to 0.5 s: measure it (`companion calibrate delay`).
"""

from __future__ import annotations

from collections.abc import AsyncIterator, Iterator
from urllib.parse import urlsplit

import cv2

from companion.io.cameras.capture_thread import threaded_frames
from companion.io.cameras.frame import CameraError, CameraFrame
from companion.io.cameras.video_capture import live_frames

OPEN_TIMEOUT_MS = 5000
READ_TIMEOUT_MS = 3000


def rtsp_frames(url: str) -> AsyncIterator[CameraFrame]:
    """CameraError where the camera does not answer; a stream that stops ends after READ_TIMEOUT_MS."""
    return threaded_frames(lambda: _open(url))


def _open(url: str) -> Iterator[CameraFrame]:
    capture = cv2.VideoCapture(
        url,
        cv2.CAP_FFMPEG,
        [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, OPEN_TIMEOUT_MS, cv2.CAP_PROP_READ_TIMEOUT_MSEC, READ_TIMEOUT_MS],
    )
    if not capture.isOpened():
        raise CameraError(f"{without_password(url)}: the camera does not answer, or refuses the path or the password")
    return live_frames(capture, without_password(url), has_driver_stamps=False)


def without_password(url: str) -> str:
    """For texts that people see and logs keep."""
    parts = urlsplit(url)
    if parts.password is None:
        return url
    return url.replace(f":{parts.password}@", ":***@", 1)
