"""MAVLink frames: values to bytes (version 2) and bytes to frames (versions 1 and 2).

Encoding cuts trailing zeros of the payload as version 2 asks. The reader works on datagrams as well as on pieces of a byte stream,
and drops what fails its checksum. Frames of unknown ids are dropped too: without the CRC_EXTRA they can't be checked.
"""

from __future__ import annotations

from struct import Struct
from typing import NamedTuple

from fastcrc.crc16 import mcrf4xx as crc16

from sitl_stub.mavlink.definitions import MESSAGE_TYPES, MessageType

_START_V1 = 0xFE
_START_V2 = 0xFD
_INCOMPAT_SIGNED = 0x01
SIGNATURE_SIZE = 13

_MAGIC_V2 = bytes((_START_V2,))
_BODY_V2 = Struct("<BBBBBBHB")


class Frame(NamedTuple):
    """One frame as received; `raw` is what came over the wire, for forwarding."""

    message_type: MessageType
    system_id: int
    component_id: int
    payload: bytes
    raw: bytes
    signed: bool

    def values(self) -> tuple[float | int | bytes, ...]:
        """All values in wire order."""
        return self.message_type.unpack(self.payload)


def encode(
    message_type: MessageType, payload: bytes, sequence: int, system_id: int, component_id: int, incompat: int = 0
) -> bytes:
    """Version 2 frame without signature (but with the signed flag in `incompat` when one will follow)."""
    payload = payload.rstrip(b"\0") or b"\0"
    id_low, id_high = message_type.id_low, message_type.id_high
    body = _BODY_V2.pack(len(payload), incompat, 0, sequence, system_id, component_id, id_low, id_high) + payload
    return _MAGIC_V2 + body + crc16(body + message_type.extra_byte).to_bytes(2, "little")


class FrameReader:
    """Turns received bytes into frames; keeps an unfinished frame for the next call."""

    def __init__(self) -> None:
        self._rest = b""
        self.dropped_frames = 0

    def read(self, data: bytes) -> list[Frame]:
        """Frames completed by `data`, oldest first."""
        data = self._rest + data
        frames: list[Frame] = []
        at = 0
        while at < len(data):
            start = data[at]
            if start not in (_START_V1, _START_V2):
                at += 1
                continue
            size = _frame_size(data, at)
            if size is None or at + size > len(data):
                break
            frame = _check(data[at : at + size])
            if frame is None:
                self.dropped_frames += 1
                at += 1 if _is_damaged(data[at : at + size]) else size
            else:
                frames.append(frame)
                at += size
        self._rest = data[at:]
        return frames


def _frame_size(data: bytes, at: int) -> int | None:
    if len(data) - at < 3:
        return None
    length = data[at + 1]
    if data[at] == _START_V1:
        return length + 8
    return length + 12 + (SIGNATURE_SIZE if data[at + 2] & _INCOMPAT_SIGNED else 0)


def _parts(raw: bytes) -> tuple[int, int, int, int, int]:
    """Message id, system, component, start and end of the payload."""
    if raw[0] == _START_V1:
        return raw[5], raw[3], raw[4], 6, 6 + raw[1]
    return raw[7] | raw[8] << 8 | raw[9] << 16, raw[5], raw[6], 10, 10 + raw[1]


def _is_damaged(raw: bytes) -> bool:
    return _parts(raw)[0] in MESSAGE_TYPES


def _check(raw: bytes) -> Frame | None:
    message_id, system_id, component_id, begin, end = _parts(raw)
    message_type = MESSAGE_TYPES.get(message_id)
    if message_type is None:
        return None
    if crc16(raw[1:end] + message_type.extra_byte) != raw[end] | raw[end + 1] << 8:
        return None
    signed = raw[0] == _START_V2 and bool(raw[2] & _INCOMPAT_SIGNED)
    return tuple.__new__(Frame, (message_type, system_id, component_id, raw[begin:end], raw, signed))
