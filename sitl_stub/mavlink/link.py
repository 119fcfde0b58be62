"""One MAVLink link of the vehicle: sequence number, what goes out, and the timetable of its streams.

Streams are kept in a heap by their next due time, so a step costs only what is due. Times are the boot clock, microseconds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from heapq import heappop, heappush, heapreplace
from typing import Any

from sitl_stub.mavlink.definitions import MessageType
from sitl_stub.mavlink.frame import FrameReader, encode
from sitl_stub.mavlink.signing import Signing

DISABLED = -1
_NEVER_US = 1 << 62


@dataclass(slots=True)
class Stream:
    """One message sent again and again; `interval_us` DISABLED means not at all."""

    message_type: MessageType
    default_interval_us: int
    interval_us: int
    generation: int = 0
    last_sent_us: int = -1


class Link:
    """State of one link; `out` holds the datagrams since it was last drained."""

    def __init__(self, name: str, system_id: int, component_id: int) -> None:
        self.name = name
        self.reader = FrameReader()
        self.signing = Signing()
        self.out: list[bytes] = []
        self._streams: dict[int, Stream] = {}
        self.enabled = True
        self.ground_station_seen_us: int | None = None
        self.messages_received = 0
        self.bytes_received = 0
        self.counters: Any = [0, 0, 0]
        """Next sequence number, messages and bytes sent; while somebody else keeps the timetable, its row of an array."""
        self._system_id = system_id
        self._component_id = component_id
        self._due: list[tuple[int, int, int, Stream]] = []
        self._order = 0
        self.keeper: Callable[[], None] | None = None
        """Writes the timetable back; set while somebody else keeps it and says in `kept_due_us` when a stream is due."""
        self.kept_due_us = 0

    @property
    def messages_sent(self) -> int:
        return int(self.counters[1])

    @property
    def bytes_sent(self) -> int:
        return int(self.counters[2])

    @property
    def streams(self) -> dict[int, Stream]:
        """By message id."""
        self.own_timetable()
        return self._streams

    def own_timetable(self) -> None:
        """Have the timetable back from whoever keeps it."""
        if self.keeper is not None:
            self.keeper()

    def timetable(self) -> list[tuple[int, int, Stream]]:
        """When each stream is due next, and its place among those due at the same time."""
        return [(due, order, stream) for due, order, generation, stream in self._due if generation == stream.generation]

    def set_timetable(self, streams: list[tuple[int, int, Stream]]) -> None:
        """What `timetable` gave, some time later."""
        self._due = sorted((due, order, stream.generation, stream) for due, order, stream in streams)

    def send(self, message_type: MessageType, payload: bytes) -> None:
        """Frame a payload and put it on the way."""
        if not self.enabled:
            return
        counters = self.counters
        sequence = int(counters[0])
        if self.signing.is_active:
            frame = self.signing.sign(encode(message_type, payload, sequence, self._system_id, self._component_id, 1))
        else:
            frame = encode(message_type, payload, sequence, self._system_id, self._component_id)
        counters[0] = (sequence + 1) & 0xFF
        counters[1] += 1
        counters[2] += len(frame)
        self.out.append(frame)

    def send_values(self, message_type: MessageType, *values: float | int | bytes) -> None:
        """Pack values in wire order and send."""
        self.send(message_type, message_type.struct.pack(*values))

    def forward(self, raw: bytes) -> None:
        """Pass on a frame of somebody else as it came."""
        if self.enabled:
            self.out.append(raw)

    def add_stream(self, message_type: MessageType, interval_us: int, first_us: int) -> None:
        """A stream of the timetable."""
        stream = Stream(message_type, interval_us, interval_us)
        self._streams[message_type.id] = stream
        if interval_us != DISABLED:
            self._schedule(stream, first_us)

    def set_interval(self, message_type: MessageType, interval_us: int, t_us: int) -> None:
        """New interval from now on; DISABLED stops the stream."""
        streams = self.streams
        stream = streams.get(message_type.id)
        if stream is None:
            stream = streams[message_type.id] = Stream(message_type, DISABLED, DISABLED)
        stream.interval_us = interval_us
        stream.generation += 1
        if interval_us != DISABLED:
            self._schedule(stream, t_us)

    def _schedule(self, stream: Stream, due_us: int) -> None:
        self._order += 1
        heappush(self._due, (due_us, self._order, stream.generation, stream))

    @property
    def next_due_us(self) -> int:
        """When the next stream is due."""
        if self.keeper is not None:
            return self.kept_due_us
        return self._due[0][0] if self._due else _NEVER_US

    def send_due(self, t_us: int, content: Callable[[MessageType], bytes | None]) -> None:
        """Send every stream that is due; `content` gives the payload or None when there is nothing to say."""
        self.own_timetable()
        due_list, send = self._due, self.send
        while due_list and due_list[0][0] <= t_us:
            due_us, order, generation, stream = due_list[0]
            if generation != stream.generation:
                heappop(due_list)
                continue
            next_us = due_us + stream.interval_us
            heapreplace(due_list, (next_us if next_us > t_us else t_us + 1, order, generation, stream))
            message_type = stream.message_type
            payload = content(message_type)
            if payload is not None:
                stream.last_sent_us = t_us
                send(message_type, payload)
