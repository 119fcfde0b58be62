"""One MAVLink conversation with the autopilot and the pad's beacon. Sans-IO: the door of this package.

Bytes and the companion's monotonic time go in, messages of the vocabulary and datagrams come out, and the next moment at
which `handle_timer` wants to be called is a value. Nothing here reads a clock or a socket, so that a lockstep run, a
socket, a serial line and a recording drive the same object:

    inputs = session.receive_datagram(data, now_ns)      # or handle_timer(now_ns)
    for datagram in session.datagrams_to_send(): ...
    deadline_ns = session.next_timer_ns()

Every message is stamped with the instant at which it was true, on the companion's clock (timesync); until the clocks are
known, with its arrival. Whatever the peer sends, nothing raises: what cannot be read is counted in `counters`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from companion import config
from companion.mavlink import codec, dialect, streams
from companion.mavlink.beacon import BeaconReader, geo_origin
from companion.mavlink.clocks import Clocks
from companion.mavlink.codec import finite
from companion.mavlink.commands import Commander, request_for
from companion.mavlink.framing import FrameSplitter
from companion.mavlink.geodesy import GeoOrigin
from companion.mavlink.landing_target import LANDING_TARGET_FORMS
from companion.mavlink.parameters import ParameterReader
from companion.mavlink.signing import Signing
from companion.mavlink.status import StatusTracker, same_but_for_age
from companion.mavlink.texts import EventReader, TextAssembler
from companion.mavlink.timesync import ClockQuality
from companion.mavlink.vehicle import VehicleReader, acceleration_report, range_measurement, thrust_report
from companion.messages import CommandKind, PadReport, SensorInput, VehicleCommand, VehicleStatus, VelocitySetpoint

Handler = Callable[[Any, int], None]
Handlers = dict[type, Handler]

SECOND_NS = 1_000_000_000
HEARTBEAT_PERIOD_NS = SECOND_NS
STATUS_PERIOD_NS = SECOND_NS
PARAMETER_TIMEOUT_NS = SECOND_NS // 2

TYPE_ONBOARD_CONTROLLER, AUTOPILOT_INVALID, STATE_ACTIVE = 18, 8, 4
FRAME_LOCAL_NED = 1
MASK_VELOCITY_YAW_RATE = 0x5C7
"""1479: ignore position (7), acceleration (448) and yaw (1024)."""
MASK_VELOCITY_ACCELERATION_YAW_RATE = 0x407
"""1031: ignore position (7) and yaw (1024)."""


@dataclass(slots=True)
class Counters:
    """What went through and what did not, since the start."""

    frames_received: int = 0
    frames_of_others: int = 0
    frames_unknown: int = 0
    frames_refused: int = 0
    bytes_skipped: int = 0
    frames_sent: int = 0
    setpoints_sent: int = 0
    setpoints_expired: int = 0
    setpoints_not_finite: int = 0


class Session:
    """The companion's end of the link. See the module's docstring for how to drive it."""

    def __init__(self, link: config.Link, start_ns: int, *, signing: Signing | None = None) -> None:
        self.counters = Counters()
        self._link = link
        self._lost_after_ns = round(link.lost_after_s * SECOND_NS)
        self._splitter = FrameSplitter(codec.frame_is_valid, stream=link.url.startswith(("serial:", "tcp:")))
        self._signing = signing
        self._clocks = Clocks(link)
        self._streams = streams.StreamRequests(streams.wanted_rates_hz(link.state_rate_hz, link.status_rate_hz))
        target = {"target_system": link.target_system, "target_component": link.target_component}
        timeout_ns = round(link.command_timeout_s * SECOND_NS)
        self._commander = Commander(**target, timeout_ns=timeout_ns, attempts=link.command_attempts)
        self.parameters = ParameterReader(**target, timeout_ns=PARAMETER_TIMEOUT_NS, attempts=link.command_attempts)
        self._status = StatusTracker()
        self._texts = TextAssembler()
        self._events = EventReader()
        self._vehicle = VehicleReader()
        self._beacon = BeaconReader(position_sigma_m=link.beacon_sigma_m)
        self._origin: GeoOrigin | None = None
        self._altitude_amsl_m: float | None = None
        self._connected = False
        self._heard_ns: int | None = None
        self._reported: VehicleStatus | None = None
        self._report_due_ns = start_ns + STATUS_PERIOD_NS
        self._heartbeat_due_ns = start_ns
        self._status_touched = False
        self._sequence = 0
        self._outbox: list[bytes] = []
        self._inbox: list[SensorInput] = []
        self._inbox_due_ns: int | None = None
        self._of_autopilot = self._autopilot_handlers()
        self._of_beacon = self._beacon_handlers()

    # ------------------------------------------------------------------------------------------------- bytes and time

    def receive_datagram(self, data: bytes, now_ns: int) -> list[SensorInput]:
        """Bytes from the link (a datagram or a piece of a stream) to messages, in the order in which they stand there."""
        for frame in self._splitter.split(data):
            self._receive_frame(frame, now_ns)
        self.counters.bytes_skipped = self._splitter.bytes_skipped
        return self._drain(now_ns)

    def handle_timer(self, now_ns: int) -> list[SensorInput]:
        """Do what is due. May be called at any time and as often as one likes."""
        if now_ns >= self._heartbeat_due_ns:
            self._heartbeat_due_ns = now_ns + HEARTBEAT_PERIOD_NS
            self._send(dialect.Heartbeat(0, TYPE_ONBOARD_CONTROLLER, AUTOPILOT_INVALID, 0, STATE_ACTIVE), now_ns)
        if self._connected:
            self._ask(now_ns)
        self._commander.handle_timer(now_ns)
        return self._drain(now_ns)

    def next_timer_ns(self) -> int | None:
        """When `handle_timer` is wanted next; never None, a heartbeat is always to come."""
        due = [self._heartbeat_due_ns, self._report_due_ns, self._commander.next_timer_ns(), self._inbox_due_ns]
        if self._connected and self._heard_ns is not None:
            due += [self._heard_ns + self._lost_after_ns, self._clocks.next_timer_ns()]
            due += [self._streams.next_timer_ns(), self.parameters.next_timer_ns()]
        return min(t for t in due if t is not None)

    def datagrams_to_send(self) -> list[bytes]:
        """Frames to send, oldest first, each a datagram. They are handed out once."""
        outbox, self._outbox = self._outbox, []
        return outbox

    # ----------------------------------------------------------------------------------------------------------- out

    def send_setpoint(self, setpoint: VelocitySetpoint, now_ns: int) -> bool:
        """Put it on the wire now. False, and nothing is sent, where it has expired or is not finite."""
        if now_ns >= setpoint.valid_until_ns:
            self.counters.setpoints_expired += 1
            return False
        acceleration = setpoint.acceleration_ned_m_s2
        numbers = (*setpoint.velocity_ned_m_s, *(acceleration or (0.0, 0.0, 0.0)))
        if not finite(*numbers, setpoint.yaw_rate_rad_s):
            self.counters.setpoints_not_finite += 1
            return False
        boot_ns = self._clocks.boot_ns(now_ns)
        message = dialect.SetPositionTargetLocalNed(
            (boot_ns if boot_ns is not None else now_ns) // 1_000_000 & 0xFFFFFFFF,
            *(0.0, 0.0, 0.0),
            *numbers,
            0.0,
            setpoint.yaw_rate_rad_s,
            MASK_VELOCITY_YAW_RATE if acceleration is None else MASK_VELOCITY_ACCELERATION_YAW_RATE,
            self._link.target_system,
            self._link.target_component,
            FRAME_LOCAL_NED,
        )
        self._send(message, now_ns)
        self.counters.setpoints_sent += 1
        return True

    def send_landing_target(self, form: str, pad: PadReport, now_ns: int) -> bool:
        """Tell an autopilot that lands by itself where the pad is. False where the vehicle's own state is unknown."""
        vehicle = self._vehicle.state
        if vehicle is None or not finite(*pad.position_ned_m):
            return False
        boot_ns = self._clocks.boot_ns(pad.t_ns)
        self._send(LANDING_TARGET_FORMS[form](pad, vehicle, max(boot_ns or 0, 0) // 1000), now_ns)
        return True

    def send_command(self, command: VehicleCommand, now_ns: int) -> None:
        """Ask the autopilot; the answer comes as a CommandResult. The same command again, while it waits, is one command.

        A forced disarm without evidence is refused here: in the air it is a crash.
        """
        if command.kind is CommandKind.FORCE_DISARM and not command.evidence:
            self._commander.refuse(command, "no evidence", now_ns)
        else:
            self._commander.ask(command, request_for(command, self._takeoff_altitude_m(command)), now_ns)
        self._drain_commands(now_ns)
        self._inbox_due_ns = now_ns if self._inbox else None

    def _takeoff_altitude_m(self, command: VehicleCommand) -> float | None:
        """Metres above sea level; PX4 takes nothing else. None (its own default height) where no altitude is known."""
        if command.height_m is None:
            return None
        state = self._vehicle.state
        if self._origin is not None and state is not None:
            return self._origin.altitude_m - state.position_ned_m[2] + command.height_m
        return None if self._altitude_amsl_m is None else self._altitude_amsl_m + command.height_m

    def _send(self, message: dialect.WireMessage, now_ns: int) -> None:
        link = self._link
        frame = codec.encode(message, self._sequence, link.system_id, link.component_id)
        if self._signing is not None:
            frame = self._signing.signed(frame, codec.BY_TYPE[type(message)].crc_extra, now_ns)
        self._outbox.append(frame)
        self._sequence = self._sequence + 1 & 0xFF
        self.counters.frames_sent += 1

    # --------------------------------------------------------------------------------------------------- clocks, link

    def companion_ns_from_boot_us(self, t_boot_us: int) -> int | None:
        """The companion's time at a time of the autopilot's boot clock; None before the clocks are known."""
        return self._clocks.companion_ns(t_boot_us * 1000)

    @property
    def clock(self) -> ClockQuality:
        """How well the autopilot's clock is known."""
        return self._clocks.quality

    @property
    def connected(self) -> bool:
        return self._connected

    def _ask(self, now_ns: int) -> None:
        """Time, streams, parameters: whatever is due."""
        question = self._clocks.question(now_ns)
        if question is not None:
            self._send(question, now_ns)
        for command, parameters in self._streams.due(now_ns):
            target = (self._link.target_system, self._link.target_component)
            self._send(streams.request(command, parameters, *target), now_ns)
        for request in self.parameters.due(now_ns):
            self._send(request, now_ns)

    def _link_age_s(self, now_ns: int) -> float:
        return 0.0 if self._heard_ns is None else (now_ns - self._heard_ns) * 1e-9

    def _found(self, now_ns: int) -> None:
        """First heartbeat, or the first after a loss: the autopilot may have restarted and forgotten what it was asked."""
        self._connected = True
        self._heard_ns = now_ns
        self._clocks.ask_now(now_ns)
        self._streams.start_over(now_ns)

    # ------------------------------------------------------------------------------------------------------------- in

    def _receive_frame(self, frame: bytes, now_ns: int) -> None:
        if self._signing is not None and not self._signing.accepts(frame, now_ns):
            self.counters.frames_refused += 1
            return
        received = codec.decode(frame)
        if received is None:
            self.counters.frames_unknown += 1
            return
        handlers = self._handlers_of(received.system, received.component)
        if handlers is None:
            self.counters.frames_of_others += 1
            return
        self.counters.frames_received += 1
        if handlers is self._of_autopilot:
            self._heard(frame, now_ns)
        handler = handlers.get(type(received.message))
        if handler is not None:
            handler(received.message, now_ns)

    def _handlers_of(self, system: int, component: int) -> Handlers | None:
        """PX4 forwards heartbeats of ground stations and gimbals: only the autopilot and the beacon count."""
        if system == self._link.target_system:
            return self._of_autopilot if component == self._link.target_component else None
        return self._of_beacon if system == self._link.beacon_system else None

    def _heard(self, frame: bytes, now_ns: int) -> None:
        """A heartbeat begins the link, then any frame keeps it: one lost heartbeat in a second is no lost link."""
        self._streams.saw(codec.message_id(frame))
        if self._connected:
            self._heard_ns = now_ns

    def _autopilot_handlers(self) -> Handlers:
        vehicle, status, stamp = self._vehicle, self._status, self._clocks.stamp
        return {
            dialect.Odometry: self._stamped(stamp, vehicle.odometry, "time_usec", 1_000),
            dialect.AttitudeQuaternion: lambda m, _: vehicle.attitude(m),
            dialect.LocalPositionNed: self._stamped(stamp, vehicle.local_position, "time_boot_ms", 1_000_000),
            dialect.DistanceSensor: self._stamped(stamp, range_measurement, "time_boot_ms", 1_000_000),
            dialect.AttitudeTarget: self._stamped(stamp, thrust_report, "time_boot_ms", 1_000_000),
            dialect.HighresImu: self._stamped(stamp, acceleration_report, "time_usec", 1_000),
            dialect.GlobalPositionInt: self._on_global_position,
            dialect.GpsGlobalOrigin: self._on_origin,
            dialect.Heartbeat: self._on_heartbeat,
            dialect.CurrentMode: self._on_current_mode,
            dialect.ExtendedSysState: self._on_status(status.extended_state),
            dialect.SysStatus: self._on_status(status.system_state),
            dialect.BatteryStatus: self._on_status(status.battery),
            dialect.HomePosition: self._on_status(status.home),
            dialect.CommandAck: self._on_ack,
            dialect.Timesync: self._on_timesync,
            dialect.Ping: self._on_ping,
            dialect.ParamValue: lambda m, _: self.parameters.received(m),
            dialect.Statustext: lambda m, now_ns: self._put(self._texts.statustext(m, now_ns)),
            dialect.Event: lambda m, now_ns: self._put(self._events.event(m, now_ns)),
        }

    def _beacon_handlers(self) -> Handlers:
        stamp = self._clocks.beacon_stamp
        return {
            dialect.GlobalPositionInt: self._stamped(stamp, self._beacon_position, "time_boot_ms", 1_000_000),
            dialect.Odometry: self._stamped(stamp, self._beacon.odometry, "time_usec", 1_000),
            dialect.Timesync: self._clocks.from_beacon,
        }

    def _stamped(
        self, stamp: Callable[[int, int], int], read: Callable[[Any, int], SensorInput | None], clock: str, to_ns: int
    ) -> Handler:
        """A handler that stamps with the boot time in field `clock`, in units of `to_ns`, and keeps what `read` makes."""

        def handle(message: Any, now_ns: int) -> None:
            self._put(read(message, stamp(getattr(message, clock) * to_ns, now_ns)))

        return handle

    def _on_status(self, take: Callable[[Any], None]) -> Handler:
        def handle(message: Any, _now_ns: int) -> None:
            take(message)
            self._status_touched = True

        return handle

    def _on_heartbeat(self, message: dialect.Heartbeat, now_ns: int) -> None:
        if not self._connected:
            self._found(now_ns)
        self._status.heartbeat(message, now_ns)
        self._status_touched = True
        self._commander.armed_seen(self._status.armed, now_ns)
        if not self._commander.current_mode_seen:
            self._commander.mode_seen(self._status.mode, None, now_ns)

    def _on_current_mode(self, message: dialect.CurrentMode, now_ns: int) -> None:
        self._commander.current_mode_seen = True
        self._status.current_mode(message, now_ns)
        self._report_due_ns = now_ns  # every mode report is passed on: its age decides whether setpoints may be sent
        self._commander.mode_seen(self._status.mode, self._status.intended_mode, now_ns)

    def _on_ack(self, message: dialect.CommandAck, now_ns: int) -> None:
        kind = self._commander.acknowledged(message, now_ns)
        if kind in (CommandKind.ARM, CommandKind.DISARM, CommandKind.FORCE_DISARM):
            self._status.arm_answered(armed=kind is CommandKind.ARM, now_ns=now_ns)
            self._status_touched = True

    def _on_timesync(self, message: dialect.Timesync, now_ns: int) -> None:
        answer = self._clocks.from_autopilot(message, now_ns)
        if answer is not None:
            self._send(answer, now_ns)

    def _on_ping(self, message: dialect.Ping, now_ns: int) -> None:
        link = self._link
        if message.target_system == 0 and message.target_component == 0:
            answer = message._replace(target_system=link.target_system, target_component=link.target_component)
            self._send(answer, now_ns)

    def _on_origin(self, message: dialect.GpsGlobalOrigin, _now_ns: int) -> None:
        self._origin = geo_origin(message)

    def _on_global_position(self, message: dialect.GlobalPositionInt, _now_ns: int) -> None:
        self._altitude_amsl_m = message.alt * 1e-3

    def _beacon_position(self, message: dialect.GlobalPositionInt, t_ns: int) -> SensorInput | None:
        return None if self._origin is None else self._beacon.global_position(message, self._origin, t_ns)

    # ------------------------------------------------------------------------------------------------------- messages

    def _put(self, message: SensorInput | None) -> None:
        if message is not None:
            self._inbox.append(message)

    def _drain(self, now_ns: int) -> list[SensorInput]:
        """Everything learned, then the status if it changed or is due: results come before the state they explain."""
        self._drain_commands(now_ns)
        self._check_link(now_ns)
        self._report_status(now_ns)
        inbox, self._inbox, self._inbox_due_ns = self._inbox, [], None
        return inbox

    def _drain_commands(self, now_ns: int) -> None:
        to_send, results = self._commander.drain()
        for message in to_send:
            self._send(message, now_ns)
        self._inbox.extend(results)

    def _check_link(self, now_ns: int) -> None:
        if self._connected and self._heard_ns is not None and now_ns - self._heard_ns >= self._lost_after_ns:
            self._connected = False
            self._status_touched = True

    def _report_status(self, now_ns: int) -> None:
        is_due = now_ns >= self._report_due_ns
        if not (self._status_touched or is_due):
            return
        self._status_touched = False
        report = self._status.report(connected=self._connected, link_age_s=self._link_age_s(now_ns))
        if is_due or self._reported is None or not same_but_for_age(report, self._reported):
            self._reported = report
            self._report_due_ns = now_ns + STATUS_PERIOD_NS
            self._inbox.append(report)
