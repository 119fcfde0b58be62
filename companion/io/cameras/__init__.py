"""Cameras by URL: each source is an async iterator of `CameraFrame`. One line in CAMERAS for each scheme.

v4l2:///dev/video0?width=1280&height=720     USB, CSI through V4L2
gstreamer:... ! appsink                      where OpenCV has it
rtsp://host/path                             network camera
http://host:8554/down                        multipart JPEG, with capture times where the camera sends them
file://clip.mp4                              video file
folder://DIR                                 images with times
"""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable

from companion.io.cameras.frame import CameraError, CameraFrame, CaptureClock
from companion.io.cameras.gstreamer import gstreamer_frames
from companion.io.cameras.image_folder import image_folder_frames
from companion.io.cameras.mjpeg import mjpeg_frames
from companion.io.cameras.rtsp import rtsp_frames
from companion.io.cameras.v4l2 import v4l2_frames
from companion.io.cameras.video_file import video_file_frames

CAMERAS: dict[str, Callable[[str], AsyncIterator[CameraFrame]]] = {
    "v4l2": v4l2_frames,
    "gstreamer": gstreamer_frames,
    "rtsp": rtsp_frames,
    "http": mjpeg_frames,
    "file": video_file_frames,
    "folder": image_folder_frames,
}


def frames(url: str) -> AsyncIterator[CameraFrame]:
    """Frames of the camera until it ends; CameraError says which camera and why."""
    scheme, colon, _ = url.partition(":")
    if not colon or scheme not in CAMERAS:
        raise CameraError(f"{url!r}: a camera's URL begins with one of {', '.join(f'{name}:' for name in CAMERAS)}")
    return CAMERAS[scheme](url)


__all__ = ["CAMERAS", "CameraError", "CameraFrame", "CaptureClock", "frames"]
