"""Our codec against pymavlink: definitions, bytes out, values in."""

from __future__ import annotations

import math
import struct
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import development as mav

from companion.mavlink import codec, dialect
from companion.mavlink.dialect import WireMessage

PYMAVLINK = {kind.id: kind for kind in mav.mavlink_map.values()}
KNOWN_TO_PYMAVLINK = [row for row in dialect.TABLE if row[1] in PYMAVLINK]


def samples(kind: type[WireMessage], rng: np.random.Generator) -> WireMessage:
    """Random values for every field of a message, floats exact in 32 bit."""
    layout = codec.BY_TYPE[kind].layout
    values = list(layout.unpack(rng.bytes(layout.size)))
    finite = [float(np.float32(rng.normal())) if isinstance(v, float) else v for v in values]
    message: WireMessage = codec.unpack(codec.BY_TYPE[kind], layout.pack(*finite))
    return message


def by_name(message: WireMessage) -> dict[str, Any]:
    return {
        name: bytes(value) if isinstance(value, bytes) else list(value) if isinstance(value, tuple) else value
        for name, value in message._asdict().items()
    }


def pymavlink_frame(message: WireMessage, sequence: int, system: int, component: int) -> bytes:
    kind = PYMAVLINK[codec.BY_TYPE[type(message)].message_id]
    encoder = mav.MAVLink(None, system, component)
    encoder.seq = sequence
    return bytes(kind(**by_name(message)).pack(encoder))


@pytest.mark.parametrize("row", KNOWN_TO_PYMAVLINK, ids=lambda row: row[0].__name__)
def test_each_definition_is_the_one_pymavlink_generated(row: Any) -> None:
    kind, message_id, layout_format, crc_extra = row
    theirs = PYMAVLINK[message_id]
    definition = codec.DEFINITIONS[message_id]
    assert definition.name == theirs.msgname
    assert list(kind._fields) == theirs.ordered_fieldnames
    assert layout_format == theirs.unpacker.format
    assert crc_extra == theirs.crc_extra


def test_only_event_is_defined_without_pymavlink() -> None:
    assert [row[0] for row in dialect.TABLE if row[1] not in PYMAVLINK] == [dialect.Event]


@pytest.mark.parametrize("row", KNOWN_TO_PYMAVLINK, ids=lambda row: row[0].__name__)
def test_each_message_is_packed_to_pymavlinks_bytes(row: Any) -> None:
    rng = np.random.default_rng(row[1])
    for _ in range(20):
        message = samples(row[0], rng)
        assert codec.encode(message, 200, 1, 191) == pymavlink_frame(message, 200, 1, 191)


def test_the_setpoint_that_is_sent_fifty_times_a_second_is_pymavlinks_to_the_byte() -> None:
    setpoint = dialect.SetPositionTargetLocalNed(
        123456, 0.0, 0.0, 0.0, 1.5, -0.25, 0.125, 0.0, 0.0, 0.0, 0.0, 0.5, 1479, 1, 1, 1
    )
    theirs = mav.MAVLink_set_position_target_local_ned_message(
        123456, 1, 1, 1, 1479, 0.0, 0.0, 0.0, 1.5, -0.25, 0.125, 0.0, 0.0, 0.0, 0.0, 0.5
    )
    encoder = mav.MAVLink(None, 1, 191)
    encoder.seq = 17
    assert codec.encode(setpoint, 17, 1, 191) == bytes(theirs.pack(encoder))


@pytest.mark.parametrize("row", dialect.TABLE, ids=lambda row: row[0].__name__)
def test_each_message_comes_back_as_it_was_sent(row: Any) -> None:
    message = samples(row[0], np.random.default_rng(row[1]))
    received = codec.decode(codec.encode(message, 5, 7, 9))
    assert received is not None
    assert (received.system, received.component, received.sequence) == (7, 9, 5)
    assert received.message == message


def test_zeros_left_away_at_the_end_are_filled_in() -> None:
    frame = codec.encode(dialect.Heartbeat(0, 0, 0, 0, 0, 0), 0, 1, 1)
    assert frame[1] == 1  # MAVLink 2 keeps one byte
    received = codec.decode(frame)
    assert received is not None
    assert received.message == dialect.Heartbeat(0, 0, 0, 0, 0, 0)


def test_a_payload_longer_than_we_know_loses_its_newer_fields_only() -> None:
    definition = codec.BY_TYPE[dialect.Timesync]
    longer = definition.layout.pack(1, 2) + b"\x01\x01"
    frame = codec.frame_payload(definition, longer, 0, 1, 1)
    assert codec.frame_is_valid(frame)
    received = codec.decode(frame)
    assert received is not None
    assert received.message == dialect.Timesync(1, 2)


def test_mavlink_1_frames_are_read() -> None:
    encoder = mav.MAVLink(None, 1, 1)
    heartbeat = mav.MAVLink_heartbeat_message(2, 12, 29, 50593792, 3, 3)
    frame = bytes(heartbeat.pack(encoder, force_mavlink1=True))
    assert frame[0] == 0xFE
    assert codec.frame_is_valid(frame)
    received = codec.decode(frame)
    assert received is not None
    assert received.message == dialect.Heartbeat(50593792, 2, 12, 29, 3, 3)


def test_every_single_flipped_bit_is_noticed() -> None:
    frame = codec.encode(dialect.Timesync(123456789, 987654321), 3, 1, 1)
    for bit in range(8, 8 * len(frame)):  # the magic byte itself is the splitter's business
        damaged = bytearray(frame)
        damaged[bit // 8] ^= 1 << bit % 8
        if codec.message_id(bytes(damaged)) != 111 or damaged[1] != frame[1]:
            continue  # another length or message: again the splitter's business
        assert codec.frame_is_valid(bytes(damaged)) is False


def test_messages_of_other_dialects_cannot_be_judged() -> None:
    vibration = bytes(mav.MAVLink_vibration_message(0, 0.1, 0.2, 0.3, 0, 0, 0).pack(mav.MAVLink(None, 1, 1)))
    assert codec.frame_is_valid(vibration) is None
    assert codec.decode(vibration) is None


def test_the_full_dialect_holds_all_of_pymavlinks_and_px4s_messages() -> None:
    everything = codec.full_dialect()
    assert set(PYMAVLINK) <= set(everything)
    assert {8, 380, 410, 411} <= set(everything)
    assert everything[30].name == "ATTITUDE"
    assert everything[331] is codec.DEFINITIONS[331]


def test_none_and_nan_meet_in_the_codec() -> None:
    assert math.isnan(codec.wire(None))
    assert codec.wire(1.5) == 1.5
    assert codec.number(math.nan) is None
    assert codec.number(math.inf) is None
    assert codec.number(-0.5) == -0.5


def test_struct_formats_are_little_endian_without_padding() -> None:
    assert all(struct.calcsize(row[2]) == struct.calcsize("<" + row[2].lstrip("<")) for row in dialect.TABLE)
    assert all(row[2].startswith("<") for row in dialect.TABLE)
