"""Messages of many steady steps at once, where kernels are compiled: burst_kernel.py's tables, and the links' timetables in it.

While the kernel keeps the timetables, the links know only when something is due next; they take them back when they need them (an
interval changes, a step sends something that the kernel does not know). Called by steady_flight.py.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from sitl_stub.autopilot.cascade import PositionSetpointEcho
from sitl_stub.autopilot.vehicle_estimate import VehicleEstimate
from sitl_stub.burst_kernel import (
    DUE,
    END,
    FIRST,
    FRAME_SIZE,
    KIND_OF,
    LAST_SENT,
    LINK_SIZE,
    LONGEST_FRAME,
    MOST_FIELDS,
    MOVING_FIELDS,
    NEXT_DUE,
    ORDER,
    RANGE,
    RESULT_SIZE,
    SEQUENCE,
    SLOW_SIZE,
    TIMETABLE_SIZE,
    layouts,
    send_burst,
)
from sitl_stub.datagram_faults import Datagram
from sitl_stub.mavlink.definitions import MessageType
from sitl_stub.mavlink.link import Link, Stream
from sitl_stub.mavlink_endpoint import MavlinkEndpoint
from sitl_stub.multirotor import VehicleTruth
from sitl_stub.stream_contents import CONTENTS
from sitl_stub.stream_values import IMU_NUMBERS
from sitl_stub.telemetry import Telemetry

_ZERO = (0.0, 0.0, 0.0)
_named = tuple.__new__


class MessageBurst:
    """Both links of one vehicle; `most_steps` is the size of the rows given."""

    def __init__(self, telemetry: Telemetry, endpoint: MavlinkEndpoint, rows: Any, most_steps: int) -> None:
        self._telemetry, self._endpoint, self._rows, self._most_steps = telemetry, endpoint, rows, most_steps
        tables = layouts(_templates(telemetry))
        self._tables = (tables.kinds, tables.fields, tables.templates)
        self._slow = np.zeros(SLOW_SIZE)
        self._asked = np.zeros(4, np.int64)
        self._result = np.zeros(RESULT_SIZE, np.int64)
        self._links: list[Link] = []
        self._names: list[str] = []
        self._counters: list[tuple[int, int, int]] = []
        self._streams: list[Stream] = []
        self._room = _room_for(1)
        self._timetable = np.zeros((TIMETABLE_SIZE, 0), np.int64)
        self._state = np.zeros((0, LINK_SIZE), np.int64)
        if not send_burst.signatures:  # type: ignore[attr-defined]
            self._call(telemetry.imu_noise.numbers)  # loaded or compiled before the first flight, not in it

    def set_slow(self, values: list[float]) -> None:
        """Everything that changes with a decision at most; see burst_kernel.py for the places."""
        self._slow[:RANGE] = values

    def send(
        self, from_us: int, first: int, last: int, range_m: float
    ) -> tuple[int, int, list[Datagram], list[Datagram]]:
        """Send what is due in the steps `first` to `last` of the rows, whose step 0 was at from_us, as far as it can be made here. `range_m` NaN is
        no valid range.

        Gives the first step it has not looked at, the last one with a message (-1: none), and the datagrams: those of the
        steps before `last`, and those of `last`.
        """
        if not self._links or self._links[0].keeper is None:
            self._borrow()
        tape = self._telemetry.imu_noise
        tape.reserve(IMU_NUMBERS * (last + 1 - first))
        counters = [(link.sequence, link.messages_sent, link.bytes_sent) for link in self._links]
        if counters != self._counters:
            self._state[:, SEQUENCE:NEXT_DUE] = counters
        self._slow[RANGE] = range_m
        asked = self._asked
        asked[0], asked[1], asked[2], asked[3] = first, last, from_us, tape.at
        self._call(tape.numbers)
        stopped_at, count, tape.at, last_step, count_before = self._result.tolist()
        self._counters = []
        for (_, _, *numbers), link in zip(self._state.tolist(), self._links, strict=True):
            link.sequence, link.messages_sent, link.bytes_sent, link.kept_due_us = numbers
            self._counters.append((numbers[0], numbers[1], numbers[2]))
        self._endpoint.look_ahead()
        sent = self._datagrams(count) if count else []
        return stopped_at, last_step, sent[:count_before], sent[count_before:]

    def _call(self, numbers: Any) -> None:
        send_burst(
            self._timetable,
            self._state,
            self._tables,
            self._rows,
            self._slow,
            numbers,
            self._room,
            self._asked,
            self._result,
        )

    def _datagrams(self, count: int) -> list[Datagram]:
        """In the order in which they are drained: by step, and within a step by link."""
        frames = self._room[1][:count].tolist()
        data = self._room[0][: frames[-1][1]].tobytes()
        names = self._names
        return [_named(Datagram, (names[link], data[begin:end])) for begin, end, link in frames]

    def _borrow(self) -> None:
        """Take the timetables over from the links."""
        self._links = self._endpoint.active_links
        self._names = [link.name for link in self._links]
        self._counters = []
        streams = [link.timetable() for link in self._links]
        rows = [
            (due_us, order, stream.interval_us, KIND_OF.get(stream.message_type.id, 0), stream.last_sent_us)
            for of_link in streams
            for due_us, order, stream in of_link
        ]
        self._timetable = np.array(rows, np.int64).reshape(-1, TIMETABLE_SIZE).T.copy()
        self._streams = [stream for of_link in streams for _, _, stream in of_link]
        ends = np.cumsum([len(of_link) for of_link in streams])
        self._state = np.zeros((len(self._links), LINK_SIZE), np.int64)
        self._state[:, FIRST], self._state[:, END] = ends - [len(of_link) for of_link in streams], ends
        most = self._most_steps * max(len(rows), 1)
        if len(self._room[1]) < most:
            self._room = _room_for(most)
        for link in self._links:
            link.keeper = self._give_back

    def _give_back(self) -> None:
        columns = list(zip(self._timetable.T.tolist(), self._streams, strict=True))
        for link, (first, end, *_) in zip(self._links, self._state.tolist(), strict=True):
            link.keeper = None
            link.set_timetable([(column[DUE], column[ORDER], stream) for column, stream in columns[first:end]])
        for column, stream in columns:
            stream.last_sent_us = column[LAST_SENT]


def _room_for(frames: int) -> Any:
    """Buffer, frames, the numbers of a message, and a float of four bytes with the same bytes beside it."""
    single = np.zeros(1, np.float32)
    return (
        np.zeros(frames * LONGEST_FRAME, np.uint8),
        np.zeros((frames, FRAME_SIZE), np.int64),
        np.zeros(MOST_FIELDS),
        single,
        single.view(np.uint8),
    )


def _templates(telemetry: Telemetry) -> dict[MessageType, bytes]:
    """Each message as the plain way makes it of a vehicle of which everything is known."""
    everything = replace(
        telemetry,
        estimate=VehicleEstimate(),
        truth=VehicleTruth(_ZERO, _ZERO, (1.0, 0.0, 0.0, 0.0), _ZERO, _ZERO, _ZERO, False),
        position_setpoint=PositionSetpointEcho(_ZERO, _ZERO, _ZERO),
        imu_noise_scale=0.0,
        has_range_sensor=True,
        has_target=True,
        pending=None,
    )
    made = {message_type: CONTENTS.get(message_type.id, _no_content)(everything) for message_type in MOVING_FIELDS}
    return {message_type: payload or bytes(message_type.struct.size) for message_type, payload in made.items()}


def _no_content(telemetry: Telemetry) -> bytes | None:
    """TIMESYNC belongs to the link; it and what cannot be said yet has no constants."""
    return None
