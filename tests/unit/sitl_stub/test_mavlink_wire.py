"""The simulator's own MAVLink against pymavlink's, and against frames of a real PX4, byte for byte."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v10 import common as mavlink1
from pymavlink.dialects.v20 import development as mavlink2

from sitl_stub.mavlink import definitions as mav
from sitl_stub.mavlink.definitions import MESSAGE_TYPES, MessageType
from sitl_stub.mavlink.frame import FrameReader, crc16, encode
from sitl_stub.mavlink.link import DISABLED, Link

FRAMES = Path(__file__).resolve().parents[2] / "data" / "px4" / "frames.csv"
KNOWN = sorted(set(MESSAGE_TYPES) & set(mavlink2.mavlink_map))
UNKNOWN_TO_PYMAVLINK = {8, 300, 380, 410, 411, 412, 413}


def sample_values(message_class: Any) -> list[Any]:
    """A different value for every field, in pymavlink's constructor order."""
    values: list[Any] = []
    for i, name in enumerate(message_class.fieldnames):
        kind = message_class.fieldtypes[i]
        length = message_class.array_lengths[message_class.ordered_fieldnames.index(name)]
        if kind == "char":
            values.append(b"abc")
        elif kind in ("float", "double"):
            values.append([0.5 + i + k for k in range(length)] if length else 0.5 + i)
        else:
            values.append([(3 * i + k + 1) % 100 for k in range(length)] if length else (3 * i + 1) % 100)
    return values


def flat(values: list[Any]) -> Iterator[Any]:
    for value in values:
        if isinstance(value, list):
            yield from value
        else:
            yield value


def our_values(message_type: MessageType, message_class: Any, values: list[Any]) -> list[Any]:
    by_name = dict(zip(message_class.fieldnames, values, strict=True))
    ordered = list(flat([by_name[name] for name in message_class.ordered_fieldnames]))
    wanted = len(message_type.struct.unpack(bytes(message_type.struct.size)))
    if "4s" in message_type.format or ("s" in message_type.format and wanted != len(ordered)):
        # Arrays of bytes and the parameters' four bytes are opaque to our layout: only the frame is compared.
        return []
    return ordered + [0] * (wanted - len(ordered))


@pytest.mark.parametrize("message_id", KNOWN, ids=lambda i: MESSAGE_TYPES[i].name)
def test_a_frame_is_byte_for_byte_what_pymavlink_makes(message_id: int) -> None:
    message_type, message_class = MESSAGE_TYPES[message_id], mavlink2.mavlink_map[message_id]
    values = sample_values(message_class)
    sender = mavlink2.MAVLink(None, srcSystem=1, srcComponent=1)
    sender.seq = 77
    theirs = message_class(*values).pack(sender)
    ordered = our_values(message_type, message_class, values)
    payload = message_type.struct.pack(*ordered) if ordered else theirs[10:-2]
    assert encode(message_type, payload, 77, 1, 1) == theirs
    assert message_type.crc_extra == message_class.crc_extra
    assert message_type.struct.size >= message_class.unpacker.size


def recorded_frames() -> list[tuple[int, bytes]]:
    with FRAMES.open(encoding="ascii") as file:
        return [(int(row["id"]), bytes.fromhex(row["frame"])) for row in csv.DictReader(file)]


@pytest.mark.parametrize(("message_id", "raw"), recorded_frames(), ids=lambda v: str(v) if isinstance(v, int) else "")
def test_a_frame_of_the_real_px4_is_read_and_made_again_the_same(message_id: int, raw: bytes) -> None:
    frames = FrameReader().read(raw)
    assert [frame.message_type.id for frame in frames] == [message_id]
    frame = frames[0]
    message_type = frame.message_type
    again = message_type.struct.pack(*frame.values())
    assert encode(message_type, again, raw[4], raw[5], raw[6]) == raw


def test_only_messages_that_pymavlink_lacks_are_checked_by_recordings_alone() -> None:
    assert set(MESSAGE_TYPES) - set(mavlink2.mavlink_map) == UNKNOWN_TO_PYMAVLINK


@given(st.binary(max_size=300))
def test_the_checksum_is_that_of_mavlink(data: bytes) -> None:
    assert crc16(data) == mavlink2.x25crc(data).crc


@given(st.binary(max_size=400), st.integers(1, 50))
def test_noise_between_frames_never_raises_and_whole_frames_come_through(noise: bytes, cut: int) -> None:
    frame = encode(mav.HEARTBEAT, mav.HEARTBEAT.struct.pack(1, 2, 12, 29, 3, 3), 0, 1, 1)
    clean = bytes(byte for byte in noise if byte not in (0xFD, 0xFE))
    reader = FrameReader()
    stream = clean + frame + clean + frame
    got = [f for at in range(0, len(stream), cut) for f in reader.read(stream[at : at + cut])]
    assert len(got) == 2


@given(st.binary(max_size=400))
def test_any_bytes_can_be_received(noise: bytes) -> None:
    FrameReader().read(noise)


def test_a_mavlink_1_frame_is_read() -> None:
    sender = mavlink1.MAVLink(None, srcSystem=255, srcComponent=190)
    raw = mavlink1.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3).pack(sender)
    assert raw[0] == 0xFE
    frames = FrameReader().read(raw)
    assert [(f.system_id, f.component_id, f.message_type.name) for f in frames] == [(255, 190, "HEARTBEAT")]


def test_a_damaged_frame_is_dropped_and_the_next_one_read() -> None:
    frame = encode(mav.HEARTBEAT, mav.HEARTBEAT.struct.pack(1, 2, 12, 29, 3, 3), 0, 1, 1)
    damaged = bytes((*frame[:-1], frame[-1] ^ 1))
    reader = FrameReader()
    assert len(reader.read(damaged + frame)) == 1
    assert reader.dropped_frames >= 1


def signed_link() -> tuple[Link, Any]:
    key = bytes(range(32))
    link = Link("onboard", 1, 1)
    link.signing.set_key(key, 1000)
    peer = mavlink2.MAVLink(None, srcSystem=1, srcComponent=191)
    peer.signing.secret_key = key
    peer.signing.link_id = 0
    peer.signing.timestamp = 2000
    peer.signing.sign_outgoing = True
    return link, peer


def test_a_signed_frame_is_accepted_by_pymavlink() -> None:
    link, peer = signed_link()
    link.send_values(mav.HEARTBEAT, 1, 2, 12, 29, 3, 3)
    message = peer.parse_char(link.out[0])
    assert message.get_type() == "HEARTBEAT"
    assert message.get_signed()


def test_a_link_with_a_key_takes_signed_frames_once_and_unsigned_ones_never() -> None:
    link, peer = signed_link()
    signed = mavlink2.MAVLink_ping_message(1, 1, 0, 0).pack(peer)
    peer.signing.sign_outgoing = False
    unsigned = mavlink2.MAVLink_ping_message(1, 2, 0, 0).pack(peer)
    frames = [link.reader.read(raw)[0] for raw in (signed, signed, unsigned)]
    assert [link.signing.accepts(frame) for frame in frames] == [True, False, False]


def test_a_stream_keeps_its_rate_when_steps_are_long() -> None:
    link = Link("onboard", 1, 1)
    link.add_stream(mav.EXTENDED_SYS_STATE, 30_000, 0)
    sent = 0
    for t_us in range(0, 3_000_000, 4_000):
        link.send_due(t_us, lambda _: b"\0\1")
        sent += len(link.out)
        link.out = []
    assert sent == 100


def test_a_stopped_stream_is_silent_and_starts_again() -> None:
    link = Link("onboard", 1, 1)
    link.add_stream(mav.EXTENDED_SYS_STATE, 10_000, 0)
    link.set_interval(mav.EXTENDED_SYS_STATE, DISABLED, 0)
    link.send_due(50_000, lambda _: b"\0\1")
    assert link.out == []
    link.set_interval(mav.EXTENDED_SYS_STATE, 10_000, 60_000)
    link.send_due(60_000, lambda _: b"\0\1")
    assert len(link.out) == 1
