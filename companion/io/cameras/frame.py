"""One frame as a source hands it out, and the error of all sources.

A frame says when it was taken, how well that is known, and on whose clock, because no source knows all three better than
its driver. It stays compressed until somebody asks for the picture: frames that are overtaken by newer ones are never
decompressed.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import cv2
import numpy as np

from companion.messages import Image


class CameraError(OSError):
    """The camera cannot be read; the text says which, why, and what to do where that is known."""


class CaptureClock(StrEnum):
    """Whose time `capture_ns` is."""

    AUTOPILOT = "autopilot"
    """The autopilot's boot clock."""
    MONOTONIC = "monotonic"
    """This computer's monotonic clock, by the driver's stamp or guessed from the arrival."""
    UNIX = "unix"
    """Nanoseconds since 1970, as in a telemetry log."""
    MEDIA = "media"
    """The recording's own clock, from wherever it begins."""


@dataclass(frozen=True, slots=True, eq=False)
class CameraFrame:
    """`content` is a picture or its JPEG. `capture_ns` is the middle of the exposure as well as the source knows it, within
    `capture_uncertainty_ns` (half width); `arrived_ns` is this computer's monotonic clock."""

    content: Image | bytes
    capture_ns: int
    capture_uncertainty_ns: int
    clock: CaptureClock
    arrived_ns: int
    sequence: int | None = None
    name: str = ""

    def image(self) -> Image | None:
        """(height, width) grey or (height, width, 3) BGR; None where the bytes are no picture."""
        return decoded(self.content) if isinstance(self.content, bytes) else self.content


def decoded(data: bytes) -> Image | None:
    """A compressed picture as pixels; None where it is none. A cut JPEG may still give its upper part."""
    if not data:
        return None
    try:
        pixels = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        return None
    return None if pixels is None else as_image(pixels)


def as_image(pixels: object) -> Image | None:
    """8-bit grey or BGR of whatever OpenCV gives: alpha dropped, 16 bits scaled; None where it is neither."""
    array = np.asarray(pixels)
    if array.dtype == np.uint16:
        array = (array >> 8).astype(np.uint8)
    if array.ndim == 3 and array.shape[2] in (1, 4):
        array = array[:, :, 0] if array.shape[2] == 1 else array[:, :, :3]
    usable = (
        array.dtype == np.uint8 and array.size > 0 and (array.ndim == 2 or (array.ndim == 3 and array.shape[2] == 3))
    )
    return np.ascontiguousarray(array, dtype=np.uint8) if usable else None
