"""The session fed with what a real PX4 sent: what it makes of it, and that our codec reads it as pymavlink does."""

from __future__ import annotations

import itertools
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import development as mav

from companion.config import Link
from companion.io.tlog import read_frames
from companion.mavlink import codec
from companion.mavlink.commands import Commander, request_for
from companion.mavlink.dialect import CommandAck, CurrentMode
from companion.mavlink.modes import mode_from_custom
from companion.mavlink.session import Session
from companion.messages import (
    AccelerationReport,
    AutopilotMode,
    AutopilotText,
    CommandKind,
    LandedState,
    RangeMeasurement,
    VehicleCommand,
    VehicleState,
    VehicleStatus,
)

LOGS = Path(__file__).parents[1] / "data" / "px4"
MS = 1_000_000


@cache
def replayed(name: str) -> tuple[list[Any], Session]:
    """Everything that came out of a session that saw the log, at the times of the log, with its timers running."""
    frames = list(read_frames(LOGS / name))
    session = Session(Link(), frames[0][0] * 1000)
    inputs: list[Any] = []
    for t_us, frame in frames:
        while (due_ns := session.next_timer_ns()) is not None and due_ns <= t_us * 1000:
            inputs += session.handle_timer(due_ns)
        inputs += session.receive_datagram(frame, t_us * 1000)
        session.datagrams_to_send()
    return inputs, session


def of(name: str, kind: type) -> list[Any]:
    return [m for m in replayed(name)[0] if isinstance(m, kind)]


def changes(values: list[Any]) -> list[Any]:
    """Values without repetitions in a row."""
    return [value for value, _ in itertools.groupby(values)]


@pytest.mark.parametrize("name", ["takeoff_land.tlog", "offboard_loss.tlog", "refused_modes.tlog"])
def test_every_recorded_frame_is_decoded_as_pymavlink_decodes_it(name: str) -> None:
    decoder, compared = mav.MAVLink(None), 0
    for _, frame in read_frames(LOGS / name):
        received = codec.decode(frame)
        assert codec.frame_is_valid(frame) is not False
        if received is None or codec.message_id(frame) not in mav.mavlink_map:
            continue
        theirs = decoder.decode(bytearray(frame))
        for field, value in received.message._asdict().items():
            expected = getattr(theirs, field)
            shown = value.split(b"\0")[0].decode() if isinstance(value, bytes) else value
            assert repr(list(shown) if isinstance(shown, tuple) else shown) == repr(expected), (theirs, field)
        compared += 1
    assert compared > 500


@pytest.mark.parametrize("name", ["takeoff_land.tlog", "offboard_loss.tlog", "refused_modes.tlog"])
def test_nothing_recorded_is_lost_or_foreign(name: str) -> None:
    _, session = replayed(name)
    assert session.connected
    assert session.counters.bytes_skipped == 0
    assert session.counters.frames_of_others == 0


def test_the_flight_goes_through_its_modes() -> None:
    statuses = of("takeoff_land.tlog", VehicleStatus)
    heard = [s.mode for s in statuses if s.connected]
    assert changes(heard) == [
        AutopilotMode.HOLD,
        AutopilotMode.TAKEOFF,
        AutopilotMode.HOLD,
        AutopilotMode.OFFBOARD,
        AutopilotMode.LAND,
        AutopilotMode.OFFBOARD,
    ]
    assert changes([s.armed for s in statuses]) == [False, True, False]
    assert changes([s.failsafe for s in statuses]) == [False]
    landed = changes([s.landed_state for s in statuses if s.landed_state is not LandedState.UNDEFINED])
    assert landed[0] is landed[-1] is LandedState.ON_GROUND
    assert {LandedState.TAKEOFF, LandedState.IN_AIR, LandedState.LANDING} <= set(landed)


def test_the_flights_state_is_smooth_and_ends_where_it_stands() -> None:
    states: list[VehicleState] = of("takeoff_land.tlog", VehicleState)
    assert len(states) > 450
    assert min(s.position_ned_m[2] for s in states) < -2.0
    assert all(abs(sum(c * c for c in s.q_ned_frd) - 1.0) < 1e-9 for s in states)
    assert max(abs(c) for c in states[-1].velocity_ned_m_s) < 0.3


def test_the_range_finder_has_no_distance_when_it_says_655_metres() -> None:
    ranges: list[RangeMeasurement] = of("takeoff_land.tlog", RangeMeasurement)
    assert {r.max_distance_m for r in ranges} == {100.0}
    assert any(r.distance_m is None for r in ranges)
    assert all(r.distance_m is None or 0.0 <= r.distance_m < 6.0 for r in ranges)


def test_gravity_shows_in_the_acceleration_at_rest() -> None:
    first: list[AccelerationReport] = of("takeoff_land.tlog", AccelerationReport)[:50]
    down = sum(a.specific_force_frd_m_s2[2] for a in first) / len(first)
    assert down == pytest.approx(-9.8, abs=0.2)


def test_events_are_readable() -> None:
    lines = [m.text for m in of("takeoff_land.tlog", AutopilotText)]
    assert lines == [
        "Logging",
        "No valid position estimate",
        "No valid global position estimate",
        "No valid mission available",
        "No offboard signal",
        "No manual control input",
        "No connection to the ground control station",
        "Armed",
        "Using the default takeoff altitude",
        "Takeoff detected",
        "Landing detected",
        "Disarmed",
    ]


def test_lost_setpoints_show_as_failsafe_with_offboard_still_intended() -> None:
    statuses = of("offboard_loss.tlog", VehicleStatus)
    flown = changes([(s.mode, s.intended_mode) for s in statuses if s.intended_mode is not None])
    offboard = (AutopilotMode.OFFBOARD, AutopilotMode.OFFBOARD)
    lost = (AutopilotMode.RETURN, AutopilotMode.OFFBOARD)
    assert flown == [offboard, lost, offboard, lost, offboard]
    assert all(s.failsafe for s in statuses if s.mode is AutopilotMode.RETURN)


def test_failsafe_is_known_before_the_heartbeat_says_critical() -> None:
    critical_ns = next(
        t_us * 1000
        for t_us, frame in read_frames(LOGS / "offboard_loss.tlog")
        if codec.message_id(frame) == 0 and codec.payload(frame)[7] == 5
    )
    known_ns = next(s.t_ns for s in of("offboard_loss.tlog", VehicleStatus) if s.failsafe)
    assert known_ns < critical_ns


def test_refused_modes_are_refused_although_the_first_answer_accepted() -> None:
    """Replay each recorded pair of answers to DO_SET_MODE into a commander that has just asked for Offboard."""
    answers = [
        (t_us, received.message)
        for t_us, frame in read_frames(LOGS / "refused_modes.tlog")
        if (received := codec.decode(frame)) is not None and isinstance(received.message, CommandAck)
    ]
    pairs = [
        (a, b) for (ta, a), (tb, b) in itertools.pairwise(answers) if a.command == b.command == 176 and tb - ta < 50_000
    ]
    assert all(first.result == 0 for first, _ in pairs)
    refused = [(first, second) for first, second in pairs if second.result != 0]
    assert len(refused) >= 4
    for first, second in refused:
        commander = Commander(target_system=1, target_component=1, timeout_ns=500 * MS, attempts=5)
        command = VehicleCommand(0, CommandKind.OFFBOARD, "test")
        commander.ask(command, request_for(command, None), 0)
        commander.acknowledged(first, 5 * MS)
        assert commander.drain()[1] == []
        commander.acknowledged(second, 10 * MS)
        (result,) = commander.drain()[1]
        assert (result.accepted, result.result) == (False, "temporarily_rejected")


def test_recorded_modes_follow_their_acknowledgement_within_a_tenth_of_a_second() -> None:
    """What the verdict by CURRENT_MODE costs in time, where the stream was asked for at 20 Hz or less."""
    verdicts, modes = [], []
    for t_us, frame in read_frames(LOGS / "takeoff_land.tlog"):
        received = codec.decode(frame)
        if received is None:
            continue
        if isinstance(received.message, CommandAck) and received.message.command == 176:
            verdicts.append(t_us)
        if isinstance(received.message, CurrentMode):
            modes.append((t_us, mode_from_custom(received.message.custom_mode)))
    waits = [min(t for t, _ in modes if t > verdict) - verdict for verdict in verdicts]
    assert len(waits) == 4
    assert max(waits) < 100_000
