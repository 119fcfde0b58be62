"""file://clip.mp4[?pace=1] - a video file, each frame with its time in the file (the middle of its exposure is unknown).

With `pace=1` frames come at the times they were taken at, as a camera would hand them out; without, as fast as they are read.
"""

from __future__ import annotations

import time
from collections.abc import AsyncIterator, Iterator
from pathlib import Path

import cv2

from companion.io.cameras.address import refuse_unknown, split
from companion.io.cameras.frame import CameraError, CameraFrame, CaptureClock, as_image
from companion.io.cameras.pacing import paced

OPTIONS = ("pace",)


async def video_file_frames(url: str) -> AsyncIterator[CameraFrame]:
    """CameraError where there is no such file or it is no video."""
    place, options = split(url)
    refuse_unknown(url, options, OPTIONS)
    async for frame in paced(_frames(place, url), keep_pace=options.get("pace", "0") != "0"):
        yield frame


def _frames(place: str, url: str) -> Iterator[CameraFrame]:
    if not Path(place).is_file():
        raise CameraError(f"{url}: there is no file {place}")
    capture = cv2.VideoCapture(place, cv2.CAP_FFMPEG)
    try:
        if not capture.isOpened():
            raise CameraError(f"{url}: {place} is no video that FFMPEG can read")
        rate_hz = float(capture.get(cv2.CAP_PROP_FPS))
        uncertainty_ns = round(0.5e9 / rate_hz) if rate_hz > 0.0 else 0
        sequence = 0
        while (read := capture.read())[0]:
            t_ns = round(capture.get(cv2.CAP_PROP_POS_MSEC) * 1e6)
            image = as_image(read[1])
            if image is not None:
                yield CameraFrame(image, t_ns, uncertainty_ns, CaptureClock.MEDIA, time.monotonic_ns(), sequence)
            sequence += 1
    finally:
        capture.release()
