"""Properties of the wire: any message round-trips, any bytes are survived, any channel ends in one true answer."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import development as mav

from companion.config import Link
from companion.mavlink import codec, dialect
from companion.mavlink.framing import LONGEST_FRAME, FrameSplitter
from companion.mavlink.session import Session
from companion.messages import CommandKind, CommandResult, VehicleCommand, VehicleState, VelocitySetpoint

MS = 1_000_000
SECOND = 1_000_000_000
KINDS = [row[0] for row in dialect.TABLE]


@st.composite
def messages(draw: st.DrawFn) -> dialect.WireMessage:
    """Any message with any bytes in its fields (NaN made finite, so that equality means something)."""
    definition = codec.BY_TYPE[draw(st.sampled_from(KINDS))]
    raw = draw(st.binary(min_size=definition.layout.size, max_size=definition.layout.size))
    values = [0.5 if isinstance(v, float) and v != v else v for v in definition.layout.unpack(raw)]
    message: dialect.WireMessage = codec.unpack(definition, definition.layout.pack(*values))
    return message


@given(messages(), st.integers(0, 255), st.integers(1, 255), st.integers(1, 255))
def test_any_message_comes_back(message: dialect.WireMessage, sequence: int, system: int, component: int) -> None:
    frame = codec.encode(message, sequence, system, component)
    assert codec.frame_is_valid(frame)
    assert codec.decode(frame) == codec.Received(system, component, sequence, message)


@given(messages(), st.integers(0, 255))
def test_any_message_is_pymavlinks_to_the_byte(message: dialect.WireMessage, sequence: int) -> None:
    definition = codec.BY_TYPE[type(message)]
    theirs = mav.mavlink_map.get(definition.message_id)
    if theirs is None:
        return
    values = {k: list(v) if isinstance(v, tuple) else v for k, v in message._asdict().items()}
    encoder = mav.MAVLink(None, 1, 191)
    encoder.seq = sequence
    assert codec.encode(message, sequence, 1, 191) == bytes(theirs(**values).pack(encoder))


@given(st.lists(messages(), max_size=6), st.lists(st.integers(1, 300), max_size=30))
def test_a_stream_gives_the_same_frames_however_it_is_cut(sent: list[dialect.WireMessage], cuts: list[int]) -> None:
    frames = [codec.encode(message, i, 1, 1) for i, message in enumerate(sent)]
    data, splitter, received = b"".join(frames), FrameSplitter(codec.frame_is_valid, stream=True), []
    for cut in cuts:
        received += splitter.split(data[:cut])
        data = data[cut:]
    received += splitter.split(data)
    assert received == frames
    assert splitter.bytes_skipped == 0


@given(st.lists(st.one_of(st.binary(max_size=400), messages()), max_size=12), st.booleans())
def test_any_bytes_leave_less_than_a_frame_behind(pieces: list[Any], stream: bool) -> None:
    splitter = FrameSplitter(codec.frame_is_valid, stream=stream)
    used = given_bytes = 0
    for piece in pieces:
        data = piece if isinstance(piece, bytes) else codec.encode(piece, 0, 1, 1)
        given_bytes += len(data)
        used += sum(map(len, splitter.split(data)))
    waiting = given_bytes - used - splitter.bytes_skipped
    assert 0 <= waiting < LONGEST_FRAME
    assert stream or waiting == 0


@given(st.lists(st.tuples(st.binary(max_size=300), st.integers(-SECOND, 5 * SECOND)), max_size=40))
def test_a_session_survives_any_bytes_at_any_time(pieces: list[tuple[bytes, int]]) -> None:
    session, now_ns = Session(Link(), 0), 10 * SECOND
    for data, step_ns in pieces:
        now_ns += step_ns
        session.receive_datagram(data, now_ns)
        session.handle_timer(now_ns)
        assert session.next_timer_ns() is not None
        session.datagrams_to_send()


@settings(max_examples=200)
@given(st.lists(st.tuples(messages(), st.sampled_from([(1, 1), (2, 1), (255, 190)])), max_size=30))
def test_a_session_survives_any_valid_message_from_anybody(sent: list[tuple[dialect.WireMessage, Any]]) -> None:
    """Absurd contents with a good checksum: infinite numbers, unknown enums, stamps of another world."""
    session, now_ns = Session(Link(), 0), SECOND
    session.receive_datagram(codec.encode(dialect.Heartbeat(0, 2, 12, 0, 3), 0, 1, 1), now_ns)
    for i, (message, (system, component)) in enumerate(sent):
        now_ns += 20 * MS
        inputs = session.receive_datagram(codec.encode(message, i, system, component), now_ns)
        assert all(now_ns - SECOND <= m.t_ns <= now_ns for m in inputs if isinstance(m, VehicleState))
        assert all(np.isfinite((*m.position_ned_m, *m.q_ned_frd)).all() for m in inputs if isinstance(m, VehicleState))
        session.handle_timer(now_ns)
        session.datagrams_to_send()


@given(
    st.integers(-SECOND, SECOND),
    st.lists(st.floats(width=32), min_size=7, max_size=7),
)
def test_only_finite_and_living_setpoints_leave(remaining_ns: int, numbers: list[float]) -> None:
    session = Session(Link(), 0)
    setpoint = VelocitySetpoint(
        t_ns=0,
        valid_until_ns=10 * SECOND + remaining_ns,
        velocity_ned_m_s=(numbers[0], numbers[1], numbers[2]),
        yaw_rate_rad_s=numbers[3],
        acceleration_ned_m_s2=(numbers[4], numbers[5], numbers[6]),
    )
    may_leave = remaining_ns > 0 and bool(np.isfinite(numbers).all())
    assert session.send_setpoint(setpoint, 10 * SECOND) is may_leave
    assert len(session.datagrams_to_send()) == may_leave


# --------------------------------------------------------------------------------------------------- a bad channel


class TwoAnswerAutopilot:
    """Answers as PX4 does: DO_SET_MODE twice, the rest once; CURRENT_MODE at 10 Hz; refuses Offboard if told to."""

    def __init__(self, *, refuses_offboard: bool) -> None:
        self.refuses_offboard = refuses_offboard
        self.mode, self.armed, self.armings = 4 << 16 | 3 << 24, False, 0
        self.sequence = 0
        self.splitter = FrameSplitter(codec.frame_is_valid, stream=False)

    def packed(self, message: dialect.WireMessage) -> bytes:
        self.sequence += 1
        return codec.encode(message, self.sequence & 0xFF, 1, 1)

    def telemetry(self) -> list[bytes]:
        beat = dialect.Heartbeat(self.mode, 2, 12, 0x80 if self.armed else 0, 4)
        return [self.packed(beat), self.packed(dialect.CurrentMode(self.mode, self.mode, 0))]

    def receive(self, data: bytes) -> list[bytes]:
        heard = [codec.decode(frame) for frame in self.splitter.split(data)]
        commands = [r.message for r in heard if r is not None and isinstance(r.message, dialect.CommandLong)]
        return [
            self.packed(dialect.CommandAck(command.command, result, 0, 0, 1, 191))
            for command in commands
            for result in self.act(command)
        ]

    def act(self, command: dialect.CommandLong) -> list[int]:
        if command.command == 400:
            self.armed, self.armings = bool(command.param1), self.armings + 1
            return [0]
        if command.command == 176:
            wanted = int(command.param2) << 16 | int(command.param3) << 24
            refused = self.refuses_offboard and int(command.param2) == 6
            self.mode = self.mode if refused else wanted
            return [0, 1 if refused else 0]
        return [0]


class BadChannel:
    """Loses, doubles, delays and damages datagrams, from a seed."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self.under_way: list[tuple[int, int, bytes]] = []
        self.count = 0

    def put(self, data: bytes, now_ns: int) -> None:
        for _ in range(int(self.rng.choice([0, 1, 1, 1, 1, 2]))):
            damaged = bytearray(data)
            if self.rng.random() < 0.1:
                damaged[int(self.rng.integers(len(damaged)))] ^= 1 << int(self.rng.integers(8))
            if self.rng.random() < 0.05:
                del damaged[int(self.rng.integers(len(damaged))) :]
            self.count += 1
            self.under_way.append((now_ns + int(self.rng.exponential(30 * MS)), self.count, bytes(damaged)))

    def take(self, now_ns: int) -> list[bytes]:
        due = sorted(item for item in self.under_way if item[0] <= now_ns)
        self.under_way = [item for item in self.under_way if item[0] > now_ns]
        return [data for _, _, data in due]


def outcome(seed: int, kinds: list[CommandKind], *, refuses_offboard: bool) -> tuple[list[Any], TwoAnswerAutopilot]:
    """Ask for each kind, two seconds apart or once answered, over a bad channel."""
    there, back = (BadChannel(rng) for rng in map(np.random.default_rng, np.random.SeedSequence(seed).spawn(2)))
    autopilot, session = TwoAnswerAutopilot(refuses_offboard=refuses_offboard), Session(Link(), 0)
    results: list[Any] = []
    to_ask = list(kinds)
    for step in range(1, 2_000):
        now_ns = step * 10 * MS
        if step % 10 == 0:
            for data in autopilot.telemetry():
                back.put(data, now_ns)
        inputs = session.handle_timer(now_ns)
        for data in back.take(now_ns):
            inputs += session.receive_datagram(data, now_ns)
        results += [m for m in inputs if isinstance(m, CommandResult)]
        if session.connected and to_ask and len(results) == len(kinds) - len(to_ask) and step > 50:
            session.send_command(VehicleCommand(now_ns, to_ask.pop(0), "test"), now_ns)
        for data in session.datagrams_to_send():
            there.put(data, now_ns)
        for data in there.take(now_ns):
            for answer in autopilot.receive(data):
                back.put(answer, now_ns)
    return results, autopilot


@pytest.mark.parametrize("seed", range(12))
def test_over_a_bad_channel_each_command_has_one_answer_and_it_is_true(seed: int) -> None:
    kinds = [CommandKind.ARM, CommandKind.OFFBOARD, CommandKind.HOLD, CommandKind.LAND]
    results, autopilot = outcome(seed, kinds, refuses_offboard=False)
    assert [r.kind for r in results] == kinds
    assert all(r.accepted for r in results)
    assert autopilot.armed
    assert autopilot.mode == 4 << 16 | 6 << 24


@pytest.mark.parametrize("seed", range(12))
def test_over_a_bad_channel_a_refused_mode_is_never_called_accepted(seed: int) -> None:
    results, autopilot = outcome(seed, [CommandKind.OFFBOARD, CommandKind.RETURN], refuses_offboard=True)
    assert [(r.kind, r.accepted) for r in results] == [(CommandKind.OFFBOARD, False), (CommandKind.RETURN, True)]
    assert autopilot.mode == 4 << 16 | 5 << 24


def test_packed_floats_are_32_bit() -> None:
    ack = codec.decode(codec.encode(dialect.LocalPositionNed(0, 0.1, 0, 0, 0, 0, 0), 0, 1, 1))
    assert ack is not None
    assert isinstance(ack.message, dialect.LocalPositionNed)
    assert ack.message.x == struct.unpack("<f", struct.pack("<f", 0.1))[0]
