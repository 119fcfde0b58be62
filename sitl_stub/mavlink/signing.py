"""MAVLink 2 signing of one link: 48 bits of SHA-256 over key, frame, link id and a time in 10 us since 2015.

Active once a key was given (SETUP_SIGNING, or the options); from then on unsigned commands are refused, and frames must come with
rising times per sender. The clock is the vehicle's own, derived from what it has sent and received: no wall clock.
"""

from __future__ import annotations

from hashlib import sha256

from sitl_stub.mavlink.frame import SIGNATURE_SIZE, Frame

KEY_SIZE = 32
_HASH_SIZE = 6
_TIME_SIZE = 6
_MAX_AGE = 6_000_000
"""A first frame of a sender may be a minute (in 10 us) older than the link's newest time."""


class Signing:
    """Key and time stamps of one link; without a key nothing is signed and everything passes."""

    def __init__(self, link_id: int = 0) -> None:
        self._key: bytes | None = None
        self.is_active = False
        self._link_id = link_id
        self._time = 0
        self._newest: dict[tuple[int, int, int], int] = {}

    def set_key(self, key: bytes, time: int) -> None:
        """Start signing with a 32-byte key; an all-zero key ends it."""
        self._key = key if any(key) else None
        self.is_active = self._key is not None
        self._time = max(self._time, time)
        self._newest.clear()

    def sign(self, frame: bytes) -> bytes:
        """The frame (its signed flag already set) with its signature."""
        assert self._key is not None
        self._time += 1
        tail = bytes((self._link_id,)) + self._time.to_bytes(_TIME_SIZE, "little")
        return frame + tail + sha256(self._key + frame + tail).digest()[:_HASH_SIZE]

    def accepts(self, frame: Frame) -> bool:
        """The frame is properly signed and newer than the sender's last one (always true without a key)."""
        if self._key is None:
            return True
        if not frame.signed:
            return False
        body, signature = frame.raw[:-_HASH_SIZE], frame.raw[-_HASH_SIZE:]
        if sha256(self._key + body).digest()[:_HASH_SIZE] != signature:
            return False
        tail = frame.raw[-SIGNATURE_SIZE:]
        return self._is_new(frame, tail[0], int.from_bytes(tail[1 : 1 + _TIME_SIZE], "little"))

    def _is_new(self, frame: Frame, link_id: int, time: int) -> bool:
        sender = (frame.system_id, frame.component_id, link_id)
        last = self._newest.get(sender)
        if time + _MAX_AGE < self._time if last is None else time <= last:
            return False
        self._newest[sender] = time
        self._time = max(self._time, time)
        return True
