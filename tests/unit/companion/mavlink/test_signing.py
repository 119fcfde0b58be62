"""Signatures against pymavlink's, and the ways in which a frame is refused."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import development as mav

from companion.config import Link
from companion.mavlink import codec, dialect
from companion.mavlink.session import Session
from companion.mavlink.signing import EPOCH_UNIX_NS, Signing

KEY = bytes(range(32))
SECOND = 1_000_000_000
NOW_NS = 77 * SECOND
UNIX_NS = 1_795_360_000 * SECOND
TICKS = (UNIX_NS - EPOCH_UNIX_NS) // 10_000
HEARTBEAT = dialect.Heartbeat(50593792, 2, 12, 29, 3, 3)


def signing() -> Signing:
    return Signing(KEY, unix_ns=UNIX_NS, now_ns=NOW_NS)


def pymavlink_signed(*, key: bytes = KEY, ticks: int = TICKS, sequence: int = 0) -> bytes:
    encoder = mav.MAVLink(None, 1, 1)
    encoder.seq = sequence
    encoder.signing.secret_key = key
    encoder.signing.sign_outgoing = True
    encoder.signing.timestamp = ticks
    return bytes(mav.MAVLink_heartbeat_message(2, 12, 29, 50593792, 3, 3).pack(encoder))


def test_a_signed_frame_is_pymavlinks_to_the_byte() -> None:
    plain = codec.encode(HEARTBEAT, 0, 1, 1)
    assert signing().signed(plain, 50, NOW_NS) == pymavlink_signed()


def test_timestamps_grow_even_within_one_tick() -> None:
    ours, plain = signing(), codec.encode(HEARTBEAT, 0, 1, 1)
    stamps = [int.from_bytes(ours.signed(plain, 50, NOW_NS)[-12:-6], "little") for _ in range(3)]
    assert stamps == [TICKS, TICKS + 1, TICKS + 2]


def test_a_frame_with_the_key_is_accepted_once() -> None:
    ours, frame = signing(), pymavlink_signed()
    assert ours.accepts(frame, NOW_NS)
    assert not ours.accepts(frame, NOW_NS)
    assert ours.accepts(pymavlink_signed(ticks=TICKS + 1), NOW_NS)


@pytest.mark.parametrize(
    "frame",
    [
        lambda: codec.encode(HEARTBEAT, 0, 1, 1),
        lambda: pymavlink_signed(key=bytes(32)),
        lambda: pymavlink_signed(ticks=TICKS - 7_000_000),
        lambda: pymavlink_signed()[:-1] + bytes((pymavlink_signed()[-1] ^ 1,)),
    ],
    ids=["unsigned", "other key", "more than a minute old", "tampered"],
)
def test_other_frames_are_refused(frame: Callable[[], bytes]) -> None:
    assert not signing().accepts(frame(), NOW_NS)


def test_a_session_with_a_key_hears_only_who_has_it() -> None:
    session = Session(Link(), NOW_NS, signing=signing())
    session.receive_datagram(codec.encode(HEARTBEAT, 0, 1, 1), NOW_NS)
    assert not session.connected
    assert session.counters.frames_refused == 1
    session.receive_datagram(pymavlink_signed(), NOW_NS)
    assert session.connected


def test_what_a_session_with_a_key_sends_pymavlink_accepts() -> None:
    session = Session(Link(), NOW_NS, signing=signing())
    session.handle_timer(NOW_NS)
    peer: Any = mav.MAVLink(None, 1, 1)
    peer.signing.secret_key = KEY
    peer.signing.timestamp = TICKS - 1
    (heartbeat,) = [peer.decode(bytearray(frame)) for frame in session.datagrams_to_send()]
    assert heartbeat.get_signed()
    assert heartbeat.get_type() == "HEARTBEAT"


def test_a_key_of_the_wrong_length_is_an_error() -> None:
    with pytest.raises(ValueError, match="32 bytes"):
        Signing(b"short", unix_ns=UNIX_NS, now_ns=NOW_NS)
