"""Find MAVLink frames in bytes.

Knows lengths and magic numbers only; whether a frame's checksum holds is the codec's business, passed in as `is_valid`
so that a false magic byte inside garbage costs one byte and not a whole message. A frame whose message nobody knows cannot
be checked: it counts only if the data end with it or another frame seems to follow. Datagrams start with a frame; what is
left of one at its end is garbage. A stream (serial, TCP) keeps the beginning of a frame for the next read. Nothing here
grows: the rest kept is shorter than one frame.
"""

from __future__ import annotations

from collections.abc import Callable

MAGIC_V1 = 0xFE
MAGIC_V2 = 0xFD
HEADER_V1 = 6
HEADER_V2 = 10
CHECKSUM = 2
SIGNATURE = 13
FLAG_SIGNED = 0x01
LONGEST_FRAME = HEADER_V2 + 255 + CHECKSUM + SIGNATURE


def frame_length(data: bytes, start: int = 0) -> int | None:
    """Length in bytes of the frame that begins at `start`, None where too little is there to tell.

    `data[start]` must be a magic byte.
    """
    if len(data) - start < 3:
        return None
    if data[start] == MAGIC_V1:
        return HEADER_V1 + data[start + 1] + CHECKSUM
    signature = SIGNATURE if data[start + 2] & FLAG_SIGNED else 0
    return HEADER_V2 + data[start + 1] + CHECKSUM + signature


class FrameSplitter:
    """Bytes in, frames out. `bytes_skipped` counts what belonged to no frame."""

    def __init__(self, is_valid: Callable[[bytes], bool | None], *, stream: bool) -> None:
        self._is_valid = is_valid
        self._stream = stream
        self._rest = b""
        self.bytes_skipped = 0

    def split(self, data: bytes) -> list[bytes]:
        """Frames that are complete and valid, in order. Never raises."""
        if self._rest:
            data, self._rest = self._rest + data, b""
        frames: list[bytes] = []
        position = 0
        while position < len(data):
            start = _next_magic(data, position)
            self.bytes_skipped += start - position
            length = frame_length(data, start) if start < len(data) else None
            if length is None or start + length > len(data):
                position = self._incomplete(data, start)
                continue
            frame = data[start : start + length]
            valid = self._is_valid(frame)
            if valid or (valid is None and _may_end_here(data, start + length)):
                frames.append(frame)
                position = start + length
            else:
                self.bytes_skipped += 1
                position = start + 1
        return frames

    def _incomplete(self, data: bytes, start: int) -> int:
        """A stream waits for the rest; in a datagram this magic byte was none, look behind it."""
        if self._stream:
            self._rest = data[start:]
            return len(data)
        self.bytes_skipped += min(1, len(data) - start)
        return start + 1


def _may_end_here(data: bytes, end: int) -> bool:
    return end == len(data) or data[end] in (MAGIC_V1, MAGIC_V2)


def _next_magic(data: bytes, position: int) -> int:
    """Index of the next magic byte of either version, len(data) where there is none."""
    first = data[position]
    if first in (MAGIC_V2, MAGIC_V1):
        return position
    found = [i for i in (data.find(MAGIC_V2, position), data.find(MAGIC_V1, position)) if i >= 0]
    return min(found) if found else len(data)
