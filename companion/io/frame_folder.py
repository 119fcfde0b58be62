"""Recorded frames for a replay: a folder of pictures, a video, or the frames inside one of our .mcap files.

Times are seconds since the start of the log. A folder says them in `times.csv` (`file,t_s`), as `companion log export --frames`
writes it; without that, and for videos, frames are evenly spaced from the log's start.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2

from companion.io.cameras.frame import as_image, decoded
from companion.io.mcap_log import McapLog
from companion.messages import Image

TIMES = "times.csv"
PICTURES = (".jpg", ".jpeg", ".png")
DEFAULT_RATE_HZ = 30.0


@dataclass(frozen=True, slots=True)
class RecordedFrame:
    """A frame that is decompressed when it is wanted; `read` gives None for one that is no picture."""

    t_s: float
    sequence: int
    read: Callable[[], Image | None]


class FramesError(ValueError):
    """No frames there; the text says what was looked for."""


def recorded_frames(path: Path, rate_hz: float | None = None) -> list[RecordedFrame]:
    """All frames of a folder, a video or a .mcap, in order of time; FramesError where there are none."""
    if path.is_dir():
        found = _folder(path, rate_hz or DEFAULT_RATE_HZ)
    elif path.suffix.lower() == ".mcap":
        found = _mcap(path)
    elif path.is_file():
        found = _video(path, rate_hz)
    else:
        raise FramesError(f"{path}: no such folder or file")
    if not found:
        raise FramesError(f"{path}: no frames in it (a folder of .jpg or .png, a video, or a .mcap of ours)")
    return sorted(found, key=lambda frame: frame.t_s)


def _folder(path: Path, rate_hz: float) -> list[RecordedFrame]:
    times = path / TIMES
    if times.is_file():
        return [_file_frame(path / name, t_s, i) for i, (name, t_s) in enumerate(_times(times))]
    names = sorted(item for item in path.iterdir() if item.suffix.lower() in PICTURES)
    return [_file_frame(name, i / rate_hz, i) for i, name in enumerate(names)]


def _times(path: Path) -> list[tuple[str, float]]:
    """Rows that can be used; the others are left out."""
    found = []
    with path.open(newline="", encoding="utf-8", errors="replace") as file:
        for row in csv.reader(file):
            try:
                name, t_s = row[0], float(row[1])
            except (IndexError, ValueError):
                continue
            if math.isfinite(t_s):
                found.append((name, t_s))
    return found


def _file_frame(path: Path, t_s: float, sequence: int) -> RecordedFrame:
    return RecordedFrame(t_s, sequence, lambda: decoded(path.read_bytes()) if path.is_file() else None)


def _mcap(path: Path) -> list[RecordedFrame]:
    log = McapLog.read(path)
    start_ns = next((entry.arrived_ns for entry in log.entries()), 0) + log.log_minus_companion_ns
    return [
        RecordedFrame((t_ns - start_ns) / 1e9, i, lambda data=jpeg: decoded(data))  # type: ignore[misc]
        for i, (_, t_ns, jpeg) in enumerate(log.frames())
    ]


def _video(path: Path, rate_hz: float | None) -> list[RecordedFrame]:
    """A video is read forwards; its frames are handed out in order."""
    video = cv2.VideoCapture(str(path))
    count = int(video.get(cv2.CAP_PROP_FRAME_COUNT)) if video.isOpened() else 0
    rate = rate_hz or video.get(cv2.CAP_PROP_FPS) or DEFAULT_RATE_HZ

    def read() -> Image | None:
        good, image = video.read()
        return as_image(image) if good else None

    return [RecordedFrame(i / rate, i, read) for i in range(max(count, 0))]
