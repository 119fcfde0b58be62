"""Steady flight and its messages in one call, where kernels are compiled: burst_kernel.py's tables, and the links' timetables in it.

While the kernel keeps the timetables, the links know only when something is due next; they take them back when they need them (an
interval changes, a step sends something that the kernel does not know). Called by steady_flight.py.
"""

from __future__ import annotations

from dataclasses import replace
from math import nan
from typing import Any, NamedTuple

import numpy as np

from sitl_stub.autopilot.cascade import PositionSetpointEcho
from sitl_stub.autopilot.noise import NormalTape
from sitl_stub.autopilot.vehicle_estimate import VehicleEstimate
from sitl_stub.burst_kernel import (
    COUNTERS,
    DUE,
    END,
    FIRST,
    FIRST_FRESH,
    FRAME_SIZE,
    KIND_OF,
    LANDED_STATE,
    LAST_SENT,
    LINK_SIZE,
    LONGEST_FRAME,
    MOVING_FIELDS,
    NO_STEP,
    ORDER,
    RECEIVED,
    SLOW_SIZE,
    TIMETABLE_SIZE,
    fly_and_send,
    layouts,
)
from sitl_stub.datagram_faults import Datagram
from sitl_stub.mavlink.definitions import MessageType
from sitl_stub.mavlink.link import Link, Stream
from sitl_stub.mavlink_endpoint import MavlinkEndpoint
from sitl_stub.multirotor import VehicleTruth
from sitl_stub.stream_contents import CONTENTS
from sitl_stub.stream_values import IMU_NUMBERS
from sitl_stub.telemetry import Telemetry
from sitl_stub.wind import Wind

STEP_US = 4000
_ZERO = (0.0, 0.0, 0.0)
_SIZE, _PLACE = 2, 5
_FRESH = [(kind, t.id) for t, (kind, _) in MOVING_FIELDS.items() if kind >= FIRST_FRESH and t.id in CONTENTS]
_named = tuple.__new__
Result = tuple[int, bool, int, int, int, int, int, int, int, int, int, int]
"""Of `fly_and_send`."""


class FlightArrays(NamedTuple):
    """What `fly_steadily` works on; see there."""

    body: Any
    estimate: Any
    control: Any
    rows: tuple[Any, Any, Any]
    tape: NormalTape


Sent = tuple[int, int, list[Datagram], list[Datagram]]
"""Messages made: the first step not looked at, the last one with a message (-1: none), datagrams before the last step, and of it."""


class MessageBurst:
    """Both links of one vehicle; `most_steps` is the size of the rows given."""

    def __init__(self, telemetry: Telemetry, endpoint: MavlinkEndpoint, arrays: FlightArrays, most_steps: int) -> None:
        self._telemetry, self._endpoint, self._most_steps = telemetry, endpoint, most_steps
        self._arrays = arrays
        tables = layouts(_templates(telemetry))
        self._kinds, self._fields, self._templates = tables.kinds, tables.fields, tables.templates
        self._sizes = tables.kinds[:, _SIZE].copy()
        self._slow = np.zeros(SLOW_SIZE)
        self._links: list[Link] = []
        self._names: list[str] = []
        self._streams: list[Stream] = []
        self._out, self._frames = _room_for(1)
        self._timetable = np.zeros((TIMETABLE_SIZE, 0), np.int64)
        self._state = np.zeros((0, LINK_SIZE), np.int64)
        self._next_fresh_us = 0

    def warm_up(self, constants: Any, wanted: Any, wind: Wind) -> None:
        """Have the kernel loaded or compiled before the first flight, not in it."""
        if not fly_and_send.signatures:  # type: ignore[attr-defined]
            self._arrays.tape.reserve(1)
            self._telemetry.imu_noise.reserve(1)
            self.run(constants, wanted, wanted, wind)

    def set_slow(self, values: list[float]) -> None:
        """Everything that changes with a decision at most; see burst_kernel.py for the places."""
        self._slow[:] = values

    def run(
        self,
        constants: Any,
        wanted: Any,
        wanted_next: Any,
        wind: Wind,
        steps: int = 0,
        quiet_steps: int = 0,
        is_estimated: bool = False,
        kept_from: int = 0,
        from_us: int = 0,
        range_m: float | None = None,
        first: int = NO_STEP,
        last: int = 0,
    ) -> tuple[int, bool, Sent | None]:
        """Fly up to so many steps from from_us and send what is due in them from step `first` on, as far as it can be made here.

        With no steps to fly: send what is due in the steps `first` to `last` of those flown before from from_us. `range_m` None is
        no valid range.
        """
        sends = first != NO_STEP
        if sends:
            self._get_ready(max(steps, last + 1), from_us)
        body, estimate, control, (rows_b, rows_e, rows_k), tape = self._arrays
        imu, bottom_m = self._telemetry.imu_noise, self._telemetry.estimate.height_above_bottom_m
        result = fly_and_send(
            body,
            estimate,
            control,
            rows_b,
            rows_e,
            rows_k,
            tape.numbers,
            tape.at,
            constants,
            wanted,
            wanted_next,
            wind.flat,
            wind.tape.numbers,
            wind.tape.at,
            steps,
            quiet_steps,
            is_estimated,
            kept_from,
            self._timetable,
            self._state,
            self._kinds,
            self._fields,
            self._templates,
            self._slow,
            nan if range_m is None else range_m,
            nan if bottom_m is None else bottom_m,
            imu.numbers,
            imu.at,
            self._endpoint.pings_sent,
            self._out,
            self._frames,
            from_us,
            first,
            last,
        )
        tape.at, wind.tape.at = result[2], result[3]
        return result[0], result[1], self._sent(result) if sends else None

    def _get_ready(self, steps: int, from_us: int) -> None:
        if not self._links or self._links[0].keeper is None:
            self._borrow()
        if self._next_fresh_us < from_us + steps * STEP_US:
            self._refresh()
        self._telemetry.imu_noise.reserve(IMU_NUMBERS * steps)

    def _sent(self, result: Result) -> Sent:
        """Note what the kernel has sent, and name the datagrams: in the order in which they are drained, by step, then by link."""
        _, _, _, _, stopped_at, count, imu_at, last_step, before, pings, next_us, self._next_fresh_us = result
        self._telemetry.imu_noise.at, endpoint = imu_at, self._endpoint
        endpoint.pings_sent = pings
        endpoint.next_due_us = next_us
        for link in self._links:
            link.kept_due_us = next_us
        if not count:
            return stopped_at, last_step, [], []
        frames, names = self._frames[:count].tolist(), self._names
        data = self._out[: frames[-1][1]].tobytes()
        sent = [_named(Datagram, (names[link], data[begin:end])) for begin, end, link in frames]
        return stopped_at, last_step, sent[:before], sent[before:]

    def _refresh(self) -> None:
        """Make the templates anew that say much of the autopilot, and note what was received: one of them is due."""
        telemetry, kinds = self._telemetry, self._kinds
        telemetry.landed_state = int(self._slow[LANDED_STATE])
        for kind, message_id in _FRESH:
            payload = CONTENTS[message_id](telemetry)
            kinds[kind, _SIZE] = 0 if payload is None else self._sizes[kind]
            if payload is not None:
                place = kinds[kind, _PLACE]
                self._templates[place : place + len(payload)] = np.frombuffer(payload, np.uint8)
        for row, link in zip(self._state, self._links, strict=True):
            row[RECEIVED:] = link.messages_received, link.bytes_received

    def _borrow(self) -> None:
        """Take the timetables over from the links."""
        self._links = self._endpoint.active_links
        self._names = [link.name for link in self._links]
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
        if len(self._frames) < most:
            self._out, self._frames = _room_for(most)
        for row, link in zip(self._state, self._links, strict=True):
            row[COUNTERS:RECEIVED] = link.counters
            link.counters, link.keeper = row[COUNTERS:RECEIVED], self._give_back
        self._next_fresh_us = 0

    def _give_back(self) -> None:
        columns = list(zip(self._timetable.T.tolist(), self._streams, strict=True))
        for link, (first, end, *_) in zip(self._links, self._state.tolist(), strict=True):
            link.keeper = None
            link.counters = link.counters.tolist()
            link.set_timetable([(column[DUE], column[ORDER], stream) for column, stream in columns[first:end]])
        for column, stream in columns:
            stream.last_sent_us = column[LAST_SENT]


def _room_for(frames: int) -> tuple[Any, Any]:
    """A buffer, and begin, end and link of the frames in it."""
    return np.zeros(frames * LONGEST_FRAME, np.uint8), np.zeros((frames, FRAME_SIZE), np.int64)


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
