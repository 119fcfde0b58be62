"""The vehicle's side of the wire: bytes in, handlers called; telemetry in, bytes out. No socket, no clock of its own.

Answers as a recorded PX4 v1.17: COMMAND_LONG and COMMAND_INT only when addressed to this system (never to 0), two acknowledgements for
DO_SET_MODE, silence for a wrong target. STATUSTEXT goes only to links on which a ground station beats; events go everywhere.
Heartbeats of others are passed on between the links. MAVLink 1 and 2 are understood, 2 is spoken.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from functools import partial
from itertools import repeat
from math import isfinite, nan
from typing import Any, Protocol

from sitl_stub.autopilot.commands import Command, CommandId, Result
from sitl_stub.autopilot.events import Notice
from sitl_stub.autopilot.manual_control import Sticks
from sitl_stub.autopilot.offboard import LocalTarget
from sitl_stub.autopilot.parameters import HASH_NAME, MAV_PARAM_TYPE_UINT32, Parameters
from sitl_stub.mavlink import definitions as mav
from sitl_stub.mavlink.definitions import MESSAGE_TYPES, MessageType
from sitl_stub.mavlink.frame import Frame
from sitl_stub.mavlink.link import DISABLED, Link
from sitl_stub.mavlink_timetable import FIRST_OTHERS_US, FIRST_US, TIMETABLES, least_interval_us
from sitl_stub.stream_contents import CONTENTS, NEEDS_ESTIMATE_ONLY, SILENT_STREAMS, event
from sitl_stub.stream_values import per_second
from sitl_stub.telemetry import Telemetry

SYSTEM_ID = 1
COMPONENT_ID = 1

_MAV_TYPE_GCS = 6
_TEXT_CHUNK = 50
_GROUND_STATION_TIMEOUT_US = 2_500_000
_PARAMETERS_PER_BURST = 20
_PARAMETER_BURST_US = 8_000
_EVENT_MEMORY = 64
_ANSWERS_FROM_US = 1_200_000
_LOCAL_NED = 1
_NEVER_US = 1 << 62


class Vehicle(Protocol):
    """What the endpoint hands received messages to."""

    def handle_command(self, command: Command) -> Result | None: ...

    def receive_local_target(self, target: LocalTarget) -> None: ...

    def receive_attitude_target(
        self, q_ned_frd: tuple[float, float, float, float], rates: tuple[float, float, float], thrust: float, mask: int
    ) -> None: ...

    def receive_landing_target(self, x_m: float, y_m: float, z_m: float) -> None: ...

    def receive_sticks(self, sticks: Sticks) -> None: ...


class MavlinkEndpoint:
    """Both links of one vehicle."""

    def __init__(
        self, telemetry: Telemetry, parameters: Parameters, vehicle: Vehicle, *, ground_link: bool, cold_boot: bool
    ) -> None:
        self._telemetry = telemetry
        self._parameters = parameters
        self._vehicle = vehicle
        self._answers_from_us = _ANSWERS_FROM_US if cold_boot else 0
        self._event_sequence = 0
        self._text_id = 0
        self._events: deque[tuple[int, bytes]] = deque(maxlen=_EVENT_MEMORY)
        self.pings_sent = 0
        self._listings: dict[str, int] = {}
        self._next_burst_us = 0
        self._ground_station_us: int | None = None
        self._cache: dict[int, bytes | None] = {}
        self._links = {name: Link(name, SYSTEM_ID, COMPONENT_ID) for name in TIMETABLES}
        self._links["ground"].enabled = ground_link
        self._active = [link for link in self._links.values() if link.enabled]
        self._contents = {name: partial(self._content, link) for name, link in self._links.items()}
        self._origin_sent = False
        self.next_due_us = 0
        for link in self._links.values():
            self._fill_timetable(link, cold_boot)

    def _fill_timetable(self, link: Link, cold_boot: bool) -> None:
        for message_type, rate_hz in TIMETABLES[link.name].items():
            first_us = FIRST_US.get(message_type, FIRST_OTHERS_US) if cold_boot else 0
            link.add_stream(message_type, round(1e6 / rate_hz), first_us)

    @property
    def links(self) -> dict[str, Link]:
        return self._links

    @property
    def active_links(self) -> list[Link]:
        """Those that send."""
        return self._active

    @property
    def sends_streams_only(self) -> bool:
        """Nothing waits to be sent but streams, and none is signed."""
        return self.next_due_us != 0 and not any(link.signing.is_active for link in self._active)

    def silence(self, link_name: str) -> None:
        """Send nothing on a link from now on; what comes in on it is still taken."""
        self._links[link_name].enabled = False
        for link in self._active:
            link.own_timetable()
        self._active = [link for link in self._links.values() if link.enabled]
        self.look_ahead()

    @property
    def ground_station_seen_us(self) -> int | None:
        """When a ground station last beat, on any link."""
        return self._ground_station_us

    # Out ----------------------------------------------------------------------------------------------------------

    def drain(self) -> list[tuple[str, bytes]]:
        """Datagrams since the last call, each with its link."""
        datagrams: list[tuple[str, bytes]] = []
        for name, link in self._links.items():
            if link.out:
                datagrams += zip(repeat(name), link.out)
                link.out = []
        return datagrams

    def is_due(self, t_us: int) -> bool:
        """Whether `step` has anything to send."""
        return self.next_due_us <= t_us

    def look_ahead(self) -> None:
        """Note when `step` has something to send, at the earliest."""
        if self._listings or not self._origin_sent:
            self.next_due_us = 0
        else:
            due_us = _NEVER_US
            for link in self._active:
                due_us = min(due_us, link.next_due_us)
            self.next_due_us = due_us

    def _leave_with_this_step(self) -> None:
        """What waits on the links is not to be mixed with what later steps send."""
        self.next_due_us = 0

    def step(self, t_us: int) -> None:
        """Send what is due."""
        self._cache.clear()
        for link in self._active:
            if link.next_due_us <= t_us:
                link.send_due(t_us, self._contents[link.name])
        if self._listings and t_us >= self._next_burst_us:
            self._next_burst_us = t_us + _PARAMETER_BURST_US
            self._send_parameter_burst()
        if not self._origin_sent and self._telemetry.home.is_set:
            self._origin_sent = True
            self._send_everywhere(mav.GPS_GLOBAL_ORIGIN)
        self.look_ahead()

    def _send_everywhere(self, message_type: MessageType) -> None:
        self._telemetry.complete()
        payload = CONTENTS[message_type.id](self._telemetry)
        if payload is not None:
            for link in self._links.values():
                link.send(message_type, payload)

    def _content(self, link: Link, message_type: MessageType) -> bytes | None:
        """A stream's payload; both links send the same where both are due."""
        cache, message_id = self._cache, message_type.id
        if message_id in cache:
            return cache[message_id]
        content = CONTENTS.get(message_id)
        if content is None:
            own = _LINK_CONTENTS.get(message_id)
            return None if own is None else own(self, link)
        telemetry = self._telemetry
        if telemetry.pending is not None and message_id not in NEEDS_ESTIMATE_ONLY:
            telemetry.complete()
        payload = cache[message_id] = content(telemetry)
        return payload

    def _timesync(self, link: Link) -> bytes:
        return mav.TIMESYNC.struct.pack(0, self._telemetry.t_us * 1000, 0, 0)

    def _ping(self, link: Link) -> bytes:
        self.pings_sent += 1
        return mav.PING.struct.pack(self._telemetry.t_us, self.pings_sent, 0, 0)

    def _link_node_status(self, link: Link) -> bytes:
        t_us = self._telemetry.t_us
        return mav.LINK_NODE_STATUS.struct.pack(
            t_us,
            per_second(link.bytes_sent, t_us),
            per_second(link.bytes_received, t_us),
            link.messages_sent,
            link.messages_received,
            0,
            0,
            0,
            0,
            0,
            0,
        )

    def tell(self, notice: Notice) -> None:
        """An event to all links, its text to those with a ground station."""
        t = self._telemetry
        payload = event(notice, self._event_sequence, t.boot_ms)
        t.event_sequence = self._event_sequence
        self._events.append((self._event_sequence, payload))
        self._event_sequence = (self._event_sequence + 1) & 0xFFFF
        level = notice.level if notice.text_level is None else notice.text_level
        chunks = list(self._text_chunks(notice.text, level))
        self._leave_with_this_step()
        for link in self._links.values():
            link.send(mav.EVENT, payload)
            if self._has_ground_station(link):
                for chunk in chunks:
                    link.send(mav.STATUSTEXT, chunk)

    def _has_ground_station(self, link: Link) -> bool:
        seen = link.ground_station_seen_us
        return seen is not None and self._telemetry.t_us - seen <= _GROUND_STATION_TIMEOUT_US

    def _text_chunks(self, text: str, level: int) -> Iterable[bytes]:
        data = text.encode("ascii")
        if not data:
            return
        chunk_id = 0
        if len(data) >= _TEXT_CHUNK:
            self._text_id = self._text_id % 0xFFFF + 1
            chunk_id = self._text_id
        for number, at in enumerate(range(0, len(data), _TEXT_CHUNK)):
            yield mav.STATUSTEXT.struct.pack(level, data[at : at + _TEXT_CHUNK], chunk_id, number)

    # In -----------------------------------------------------------------------------------------------------------

    def receive(self, link_name: str, data: bytes) -> None:
        """Bytes that came on a link."""
        link = self._links[link_name]
        link.bytes_received += len(data)
        for frame in link.reader.read(data):
            link.messages_received += 1
            self._take(link, frame)
        self.look_ahead()
        for each in self._active:
            if each.out:
                self._leave_with_this_step()

    def _take(self, link: Link, frame: Frame) -> None:
        if (frame.system_id, frame.component_id) == (SYSTEM_ID, COMPONENT_ID) or not link.signing.accepts(frame):
            return
        handler = _HANDLERS.get(frame.message_type.id)
        if handler is not None:
            handler(self, link, frame, frame.values())

    def _is_for_me(self, system_id: int, component_id: int) -> bool:
        return system_id == SYSTEM_ID and component_id in (0, COMPONENT_ID)

    def _is_for_me_or_all(self, system_id: int, component_id: int) -> bool:
        return system_id in (0, SYSTEM_ID) and component_id in (0, COMPONENT_ID)

    def _on_heartbeat(self, link: Link, frame: Frame, v: Any) -> None:
        if v[1] == _MAV_TYPE_GCS:
            link.ground_station_seen_us = self._telemetry.t_us
            self._ground_station_us = self._telemetry.t_us
        for other in self._links.values():
            if other is not link:
                other.forward(frame.raw)

    def _on_ping(self, link: Link, frame: Frame, v: Any) -> None:
        time_usec, sequence, system_id, component_id = v
        if system_id == 0 and component_id == 0:
            link.send_values(mav.PING, time_usec, sequence, frame.system_id, frame.component_id)

    def _on_timesync(self, link: Link, frame: Frame, v: Any) -> None:
        if v[0] == 0:
            now_ns = self._telemetry.t_us * 1000
            link.send_values(mav.TIMESYNC, now_ns, v[1], frame.system_id, frame.component_id)

    # Commands -----------------------------------------------------------------------------------------------------

    def _on_command_long(self, link: Link, frame: Frame, v: Any) -> None:
        *parameters, command_id, system_id, component_id, _ = v
        if self._is_for_me(system_id, component_id):
            self._run(link, Command(command_id, tuple(parameters), link.name, (frame.system_id, frame.component_id)))

    def _on_command_int(self, link: Link, frame: Frame, v: Any) -> None:
        p1, p2, p3, p4, x, y, z, command_id, system_id, component_id, *_ = v
        if self._is_for_me(system_id, component_id):
            parameters = (p1, p2, p3, p4, x * 1e-7, y * 1e-7, z)
            self._run(link, Command(command_id, parameters, link.name, (frame.system_id, frame.component_id)))

    def _on_set_mode(self, link: Link, frame: Frame, v: Any) -> None:
        custom_mode, system_id, base_mode = v
        if system_id != SYSTEM_ID:
            return
        parameters = (float(base_mode), float(custom_mode >> 16 & 0xFF), float(custom_mode >> 24), nan, nan, nan, nan)
        command = Command(CommandId.DO_SET_MODE, parameters, link.name, (frame.system_id, frame.component_id))
        self._acknowledge(link, command, self._answer(command))

    def _run(self, link: Link, command: Command) -> None:
        """Handle a command; PX4's receiver answers DO_SET_MODE once more, at once and always with ACCEPTED."""
        if command.id == CommandId.DO_SET_MODE and self._is_awake:
            self._acknowledge(link, command, Result.ACCEPTED)
        own = _OWN_COMMANDS.get(command.id)
        result = self._answer(command) if own is None else own(self, link, command)
        self._acknowledge(link, command, result)

    @property
    def _is_awake(self) -> bool:
        return self._telemetry.t_us >= self._answers_from_us

    def _answer(self, command: Command) -> Result | None:
        return self._vehicle.handle_command(command) if self._is_awake else None

    def _acknowledge(self, link: Link, command: Command, result: Result | None) -> None:
        if result is not None:
            link.send_values(mav.COMMAND_ACK, command.id, result, 0, 0, *command.sender)

    def _request_message(self, link: Link, command: Command) -> Result:
        message_type = _requested_type(command)
        if message_type is None or message_type.id not in CONTENTS:
            return Result.DENIED
        stream = link.streams.get(message_type.id)
        t_us = self._telemetry.t_us
        if stream is not None and 0 <= stream.last_sent_us > t_us - least_interval_us(message_type):
            return Result.DENIED
        self._telemetry.complete()
        payload = CONTENTS[message_type.id](self._telemetry)
        if payload is None:
            return Result.DENIED
        link.send(message_type, payload)
        if stream is not None:
            stream.last_sent_us = t_us
        return Result.ACCEPTED

    def _set_message_interval(self, link: Link, command: Command) -> Result:
        message_type = _requested_type(command)
        interval = command.parameters[1]
        if message_type is None or message_type is mav.HEARTBEAT or not isfinite(interval):
            return Result.FAILED
        if not _is_stream(message_type):
            return Result.FAILED
        link.set_interval(message_type, self._interval_us(link, message_type, interval), self._telemetry.t_us)
        return Result.ACCEPTED

    def _interval_us(self, link: Link, message_type: MessageType, asked_us: float) -> int:
        if asked_us < 0.0:
            return DISABLED
        if asked_us == 0.0:
            rate_hz = TIMETABLES[link.name].get(message_type)
            return DISABLED if rate_hz is None else round(1e6 / rate_hz)
        return max(int(asked_us), least_interval_us(message_type))

    def _get_message_interval(self, link: Link, command: Command) -> Result:
        message_id = int(command.parameters[0])
        stream = link.streams.get(message_id)
        known = MESSAGE_TYPES.get(message_id)
        interval = 0 if known is None or not _is_stream(known) else -1 if stream is None else stream.interval_us
        link.send_values(mav.MESSAGE_INTERVAL, interval, message_id & 0xFFFF)
        return Result.ACCEPTED

    def _send_version(self, link: Link, command: Command) -> Result:
        payload = CONTENTS[mav.AUTOPILOT_VERSION.id](self._telemetry)
        assert payload is not None
        link.send(mav.AUTOPILOT_VERSION, payload)
        return Result.ACCEPTED

    def _send_protocol(self, link: Link, command: Command) -> Result:
        payload = CONTENTS[mav.PROTOCOL_VERSION.id](self._telemetry)
        assert payload is not None
        link.send(mav.PROTOCOL_VERSION, payload)
        return Result.ACCEPTED

    # Setpoints ----------------------------------------------------------------------------------------------------

    def _on_local_target(self, link: Link, frame: Frame, v: Any) -> None:
        _, x, y, z, vx, vy, vz, ax, ay, az, yaw, yaw_rate, mask, system_id, component_id, coordinate_frame = v
        if self._is_for_me_or_all(system_id, component_id):
            self._vehicle.receive_local_target(
                tuple.__new__(
                    LocalTarget, (coordinate_frame, mask, (x, y, z), (vx, vy, vz), (ax, ay, az), yaw, yaw_rate)
                )
            )

    def _on_attitude_target(self, link: Link, frame: Frame, v: Any) -> None:
        _, qw, qx, qy, qz, p, q, r, thrust, system_id, component_id, mask, *_ = v
        if self._is_for_me_or_all(system_id, component_id):
            self._vehicle.receive_attitude_target((qw, qx, qy, qz), (p, q, r), thrust, mask)

    def _on_landing_target(self, link: Link, frame: Frame, v: Any) -> None:
        coordinate_frame, x, y, z, position_valid = v[7], v[8], v[9], v[10], v[16]
        if position_valid and coordinate_frame == _LOCAL_NED:
            self._vehicle.receive_landing_target(x, y, z)

    def _on_manual_control(self, link: Link, frame: Frame, v: Any) -> None:
        x, y, z, r, _, target, *_ = v
        if target == SYSTEM_ID:
            self._vehicle.receive_sticks(Sticks(y / 1000.0, x / 1000.0, r / 1000.0, z / 500.0 - 1.0))

    # Parameters ---------------------------------------------------------------------------------------------------

    def _on_parameter_list(self, link: Link, frame: Frame, v: Any) -> None:
        if self._is_for_me_or_all(*v):
            self._listings[link.name] = 0

    def _send_parameter_burst(self) -> None:
        for name, start in list(self._listings.items()):
            link = self._links[name]
            end = min(start + _PARAMETERS_PER_BURST, len(self._parameters))
            for index in range(start, end):
                parameter = self._parameters.name_at(index)
                assert parameter is not None
                self._send_parameter(link, parameter)
            if end < len(self._parameters):
                self._listings[name] = end
            else:
                del self._listings[name]
                self._send_hash(link)

    def _send_parameter(self, link: Link, name: str) -> None:
        p = self._parameters
        link.send_values(
            mav.PARAM_VALUE, p.wire_value(name), len(p), p.index_of(name), name.encode("ascii"), p.wire_type(name)
        )

    def _send_hash(self, link: Link) -> None:
        value = self._parameters.hash().to_bytes(4, "little")
        count = len(self._parameters)
        link.send_values(mav.PARAM_VALUE, value, count, 0xFFFF, HASH_NAME.encode("ascii"), MAV_PARAM_TYPE_UINT32)

    def _on_parameter_read(self, link: Link, frame: Frame, v: Any) -> None:
        index, system_id, component_id, raw_name = v
        if not self._is_for_me_or_all(system_id, component_id):
            return
        name = _parameter_name(raw_name) if index < 0 else self._parameters.name_at(index)
        if name == HASH_NAME:
            self._send_hash(link)
        elif name is not None and name in self._parameters:
            self._send_parameter(link, name)

    def _on_parameter_set(self, link: Link, frame: Frame, v: Any) -> None:
        raw, system_id, component_id, raw_name, wire_type = v
        name = _parameter_name(raw_name)
        if not self._is_for_me_or_all(system_id, component_id) or name not in self._parameters:
            return
        if self._parameters.set_from_wire(name, raw, wire_type):
            for each in self._links.values():
                self._send_parameter(each, name)

    # Missions, events, signing ------------------------------------------------------------------------------------

    def _on_mission_list(self, link: Link, frame: Frame, v: Any) -> None:
        system_id, component_id, mission_type = v
        if self._is_for_me_or_all(system_id, component_id):
            link.send_values(mav.MISSION_COUNT, 0, frame.system_id, frame.component_id, mission_type, 0)

    def _on_mission_clear(self, link: Link, frame: Frame, v: Any) -> None:
        system_id, component_id, mission_type = v
        if self._is_for_me_or_all(system_id, component_id):
            link.send_values(mav.MISSION_ACK, frame.system_id, frame.component_id, 0, mission_type, 0)

    def _on_event_request(self, link: Link, frame: Frame, v: Any) -> None:
        first, last, system_id, component_id = v
        if not self._is_for_me(system_id, component_id):
            return
        for sequence, payload in self._events:
            if (sequence - first) & 0xFFFF <= (last - first) & 0xFFFF:
                link.send(mav.EVENT, payload)

    def _on_setup_signing(self, link: Link, frame: Frame, v: Any) -> None:
        time, system_id, component_id, key = v
        if self._is_for_me(system_id, component_id):
            link.signing.set_key(key, time)


def _parameter_name(raw: bytes) -> str:
    return raw.split(b"\0", 1)[0].decode("ascii", "replace")


def _is_stream(message_type: MessageType) -> bool:
    message_id = message_type.id
    return message_id in CONTENTS or message_id in SILENT_STREAMS or message_id in _LINK_CONTENTS


def _requested_type(command: Command) -> MessageType | None:
    wanted = command.parameters[0]
    return MESSAGE_TYPES.get(round(wanted)) if isfinite(wanted) else None


_LINK_CONTENTS: dict[int, Callable[[MavlinkEndpoint, Link], bytes]] = {
    mav.TIMESYNC.id: MavlinkEndpoint._timesync,
    mav.PING.id: MavlinkEndpoint._ping,
    mav.LINK_NODE_STATUS.id: MavlinkEndpoint._link_node_status,
}

_OWN_COMMANDS: dict[int, Callable[[MavlinkEndpoint, Link, Command], Result]] = {
    CommandId.REQUEST_MESSAGE: MavlinkEndpoint._request_message,
    CommandId.SET_MESSAGE_INTERVAL: MavlinkEndpoint._set_message_interval,
    CommandId.GET_MESSAGE_INTERVAL: MavlinkEndpoint._get_message_interval,
    CommandId.REQUEST_AUTOPILOT_CAPABILITIES: MavlinkEndpoint._send_version,
    CommandId.REQUEST_PROTOCOL_VERSION: MavlinkEndpoint._send_protocol,
}

_HANDLERS: dict[int, Callable[[MavlinkEndpoint, Link, Frame, Any], None]] = {
    mav.HEARTBEAT.id: MavlinkEndpoint._on_heartbeat,
    mav.PING.id: MavlinkEndpoint._on_ping,
    mav.TIMESYNC.id: MavlinkEndpoint._on_timesync,
    mav.COMMAND_LONG.id: MavlinkEndpoint._on_command_long,
    mav.COMMAND_INT.id: MavlinkEndpoint._on_command_int,
    mav.SET_MODE.id: MavlinkEndpoint._on_set_mode,
    mav.SET_POSITION_TARGET_LOCAL_NED.id: MavlinkEndpoint._on_local_target,
    mav.SET_ATTITUDE_TARGET.id: MavlinkEndpoint._on_attitude_target,
    mav.LANDING_TARGET.id: MavlinkEndpoint._on_landing_target,
    mav.MANUAL_CONTROL.id: MavlinkEndpoint._on_manual_control,
    mav.PARAM_REQUEST_LIST.id: MavlinkEndpoint._on_parameter_list,
    mav.PARAM_REQUEST_READ.id: MavlinkEndpoint._on_parameter_read,
    mav.PARAM_SET.id: MavlinkEndpoint._on_parameter_set,
    mav.MISSION_REQUEST_LIST.id: MavlinkEndpoint._on_mission_list,
    mav.MISSION_CLEAR_ALL.id: MavlinkEndpoint._on_mission_clear,
    mav.REQUEST_EVENT.id: MavlinkEndpoint._on_event_request,
    mav.SETUP_SIGNING.id: MavlinkEndpoint._on_setup_signing,
}
