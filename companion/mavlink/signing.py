"""MAVLink 2 signing: who holds the key may speak, and nothing said before counts again.

The signature is link id (1 byte), timestamp (6 bytes, units of 10 us since 2015-01-01) and the first 6 bytes of
SHA-256(key, frame with checksum, link id, timestamp). A receiver keeps the last timestamp of each (system, component,
link) and refuses what is not newer. The wall clock comes from outside, once; the monotonic clock carries it on.
"""

from __future__ import annotations

import hashlib
import struct

from fastcrc.crc16 import mcrf4xx

from companion.mavlink.framing import FLAG_SIGNED, HEADER_V2, MAGIC_V2

KEY_BYTES = 32
TICK_NS = 10_000
EPOCH_UNIX_NS = 1_420_070_400_000_000_000
"""2015-01-01."""
NEW_STREAM_MAY_LAG_TICKS = 6_000_000
"""One minute: how far behind our own time a stream that was never heard may begin."""
_CHECKSUM = struct.Struct("<H")


class Signing:
    """Signs what we send and checks what we hear. ValueError for a key of the wrong length."""

    def __init__(self, key: bytes, *, unix_ns: int, now_ns: int, link_id: int = 0) -> None:
        if len(key) != KEY_BYTES:
            raise ValueError(f"a signing key has {KEY_BYTES} bytes, this one has {len(key)}")
        self._key = key
        self._link_id = link_id
        self._unix_minus_monotonic_ns = unix_ns - now_ns
        self._last_ticks = 0
        self._heard_ticks: dict[bytes, int] = {}

    def _ticks(self, now_ns: int) -> int:
        return (now_ns + self._unix_minus_monotonic_ns - EPOCH_UNIX_NS) // TICK_NS

    def signed(self, frame: bytes, crc_extra: int, now_ns: int) -> bytes:
        """The same MAVLink 2 frame with the flag, a new checksum and a signature. Timestamps always grow."""
        self._last_ticks = max(self._ticks(now_ns), self._last_ticks + 1)
        body = frame[:2] + bytes((frame[2] | FLAG_SIGNED,)) + frame[3:-2]
        body += _CHECKSUM.pack(mcrf4xx(body[1:] + bytes((crc_extra,))))
        stamp = bytes((self._link_id,)) + self._last_ticks.to_bytes(6, "little")
        return body + stamp + self._digest(body + stamp)

    def accepts(self, frame: bytes, now_ns: int) -> bool:
        """True for a frame signed with our key whose timestamp is newer than all before it in its stream."""
        if frame[0] != MAGIC_V2 or not frame[2] & FLAG_SIGNED:
            return False
        if self._digest(frame[:-6]) != frame[-6:]:
            return False
        signature = frame[HEADER_V2 + frame[1] + 2 :]
        stream = frame[5:7] + signature[:1]
        ticks = int.from_bytes(signature[1:7], "little")
        if ticks <= self._heard_ticks.get(stream, self._ticks(now_ns) - NEW_STREAM_MAY_LAG_TICKS):
            return False
        self._heard_ticks[stream] = ticks
        return True

    def _digest(self, data: bytes) -> bytes:
        return hashlib.sha256(self._key + data).digest()[:6]
