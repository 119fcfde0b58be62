"""gstreamer:PIPELINE - whatever GStreamer can play, where this OpenCV has it; the pipeline must end in an appsink.

    gstreamer:nvarguscamerasrc ! nvvidconv ! video/x-raw,format=GRAY8 ! appsink drop=1 max-buffers=1

OpenCV's wheels from PyPI are built without GStreamer; a distribution's python3-opencv has it.
"""

from __future__ import annotations

import re
from collections.abc import AsyncIterator, Iterator

import cv2

from companion.io.cameras.capture_thread import threaded_frames
from companion.io.cameras.frame import CameraError, CameraFrame
from companion.io.cameras.video_capture import live_frames

PREFIX = "gstreamer:"


def gstreamer_frames(url: str) -> AsyncIterator[CameraFrame]:
    """CameraError where OpenCV lacks GStreamer or the pipeline does not start."""
    return threaded_frames(lambda: _open(url))


def is_built_in(build_information: str) -> bool:
    """Whether the text of `cv2.getBuildInformation()` says so."""
    return re.search(r"GStreamer:\s+YES", build_information) is not None


def _open(url: str) -> Iterator[CameraFrame]:
    pipeline = url.removeprefix(PREFIX).removeprefix("//").strip()
    if not is_built_in(cv2.getBuildInformation()):
        raise CameraError(
            f"{url}: this OpenCV ({cv2.__version__}) is built without GStreamer, as all wheels from PyPI are; use the"
            " distribution's python3-opencv, or let gst-launch write to a v4l2loopback device and read v4l2:///dev/videoN"
        )
    if "appsink" not in pipeline:
        raise CameraError(f"{url}: the pipeline must end in an appsink, such as `appsink drop=1 max-buffers=1`")
    capture = cv2.VideoCapture(pipeline, cv2.CAP_GSTREAMER)
    if not capture.isOpened():
        raise CameraError(f"{url}: the pipeline does not start; try it with gst-launch-1.0 and fakesink")
    return live_frames(capture, url, has_driver_stamps=False)
