"""Telemetry logs as MAVProxy, QGroundControl and pymavlink write and read them.

A .tlog is a row of (8 bytes big-endian Unix microseconds, MAVLink frame), nothing else: no header, no index. The writer
keeps both directions; the frames themselves say who sent them. The iterator reads anything: what is no frame is skipped
and a cut end is no error. tlog_columns reads the same files as numpy columns, much faster.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from companion.io.tlog_scan import scan
from companion.mavlink import codec
from companion.mavlink.framing import FrameSplitter, frame_length

STAMP_BYTES = 8
FLUSH_EVERY_US = 200_000
"""What a killed process may lose."""


class TlogWriter:
    """Appends what passed over the link. Readable at any moment, whatever kills the process."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("wb")
        self._splitter = FrameSplitter(codec.frame_is_valid, stream=False)
        self._flushed_us = 0
        self.frames = 0

    @property
    def bytes_skipped(self) -> int:
        """Bytes that were no frame and were left out: other tools stumble over them."""
        return self._splitter.bytes_skipped

    def write(self, t_us: int, data: bytes) -> None:
        """Append the frames of one datagram, all with its time (Unix microseconds)."""
        stamp = t_us.to_bytes(STAMP_BYTES, "big")
        for frame in self._splitter.split(data):
            self._file.write(stamp + frame)
            self.frames += 1
        if not 0 <= t_us - self._flushed_us < FLUSH_EVERY_US:
            self._file.flush()
            self._flushed_us = t_us

    def close(self) -> None:
        self._file.close()


def read_frames(path: Path) -> Iterator[tuple[int, bytes]]:
    """(Unix microseconds, frame) in the order of the file. Damaged places are skipped."""
    data = path.read_bytes()
    for start in scan(data).starts.tolist():
        length = frame_length(data, start)
        assert length is not None  # the scan has seen the whole frame
        yield int.from_bytes(data[start - STAMP_BYTES : start], "big"), data[start : start + length]
