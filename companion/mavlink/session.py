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

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from companion import config
from companion.mavlink import codec, dialect, streams
from companion.mavlink.beacon import BeaconReader, geo_origin
from companion.mavlink.codec import finite
from companion.mavlink.commands import Commander, request_for
from companion.mavlink.framing import FrameSplitter
from companion.mavlink.geodesy import GeoOrigin
from companion.mavlink.status import StatusTracker, same_but_for_age
from companion.mavlink.texts import TextAssembler, event_text
from companion.mavlink.timesync import ClockQuality, PeerClock
from companion.mavlink.vehicle import VehicleReader, acceleration_report, range_measurement, thrust_report
from companion.messages import CommandKind, SensorInput, VehicleCommand, VehicleStatus, VelocitySetpoint

Handler = Callable[[Any, int], None]
Handlers = dict[type, Handler]

SECOND_NS = 1_000_000_000
HEARTBEAT_PERIOD_NS = SECOND_NS
STATUS_PERIOD_NS = SECOND_NS
TIMESYNC_FAST_NS = SECOND_NS // 10
TIMESYNC_SLOW_NS = SECOND_NS // 5
TIMESYNC_FAST_SAMPLES = 30
OLDEST_STAMP_NS = SECOND_NS
"""A stamp further back than this is a wrong clock, not a slow link."""

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
    frames_invalid: int = 0
    bytes_skipped: int = 0
    frames_sent: int = 0
    setpoints_sent: int = 0
    setpoints_expired: int = 0
    setpoints_not_finite: int = 0


class Session:
    """The companion's end of the link. See the module's docstring for how to drive it."""

    def __init__(self, link: config.Link, start_ns: int) -> None:
        self.counters = Counters()
        self._link = link
        self._lost_after_ns = round(link.lost_after_s * SECOND_NS)
        self._splitter = FrameSplitter(codec.frame_is_valid, stream=link.url.startswith(("serial:", "tcp:")))
        self._clocks: dict[int, PeerClock] = {link.target_system: PeerClock(), link.beacon_system: PeerClock()}
        self._streams = streams.StreamRequests(streams.wanted_rates_hz(link.state_rate_hz, link.status_rate_hz))
        self._commander = Commander(
            target_system=link.target_system,
            target_component=link.target_component,
            timeout_ns=round(link.command_timeout_s * SECOND_NS),
            attempts=link.command_attempts,
        )
        self._status = StatusTracker()
        self._texts = TextAssembler()
        self._vehicle = VehicleReader()
        self._beacon = BeaconReader(position_sigma_m=link.beacon_sigma_m)
        self._origin: GeoOrigin | None = None
        self._altitude_amsl_m: float | None = None
        self._connected = False
        self._heard_ns: int | None = None
        self._reported: VehicleStatus | None = None
        self._report_due_ns = start_ns + STATUS_PERIOD_NS
        self._heartbeat_due_ns = start_ns
        self._timesync_due_ns = start_ns
        self._timesync_sent_ns: deque[int] = deque(maxlen=16)
        self._sequence = 0
        self._outbox: list[bytes] = []
        self._inbox: list[SensorInput] = []
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
            self._send(dialect.Heartbeat(0, TYPE_ONBOARD_CONTROLLER, AUTOPILOT_INVALID, 0, STATE_ACTIVE))
        if self._connected:
            self._ask_time(now_ns)
            self._ask_streams(now_ns)
        self._commander.handle_timer(now_ns)
        return self._drain(now_ns)

    def next_timer_ns(self) -> int | None:
        """When `handle_timer` is wanted next; never None, a heartbeat is always to come."""
        due = [self._heartbeat_due_ns, self._report_due_ns]
        if self._connected and self._heard_ns is not None:
            due += [self._timesync_due_ns, self._heard_ns + self._lost_after_ns]
            due += [t for t in (self._streams.next_timer_ns(),) if t is not None]
        command_ns = self._commander.next_timer_ns()
        return min(due if command_ns is None else [*due, command_ns])

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
        boot_ns = self._clocks[self._link.target_system].boot_ns(now_ns)
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
        self._send(message)
        self.counters.setpoints_sent += 1
        return True

    def send_command(self, command: VehicleCommand, now_ns: int) -> None:
        """Ask the autopilot; the answer comes as a CommandResult. The same command again, while it waits, is one command.

        A forced disarm without evidence is refused here: in the air it is a crash.
        """
        if command.kind is CommandKind.FORCE_DISARM and not command.evidence:
            self._commander.refuse(command, "no evidence", now_ns)
        else:
            self._commander.ask(command, request_for(command, self._takeoff_altitude_m(command)), now_ns)
        self._drain_commands()

    def _takeoff_altitude_m(self, command: VehicleCommand) -> float | None:
        """Metres above sea level; PX4 takes nothing else. None (its own default height) where no altitude is known."""
        if command.height_m is None:
            return None
        state = self._vehicle.state
        if self._origin is not None and state is not None:
            return self._origin.altitude_m - state.position_ned_m[2] + command.height_m
        return None if self._altitude_amsl_m is None else self._altitude_amsl_m + command.height_m

    def _send(self, message: dialect.WireMessage) -> None:
        self._outbox.append(codec.encode(message, self._sequence, self._link.system_id, self._link.component_id))
        self._sequence = self._sequence + 1 & 0xFF
        self.counters.frames_sent += 1

    # --------------------------------------------------------------------------------------------------- clocks, link

    def companion_ns_from_boot_us(self, t_boot_us: int) -> int | None:
        """The companion's time at a time of the autopilot's boot clock; None before the clocks are known."""
        return self._clocks[self._link.target_system].companion_ns(t_boot_us * 1000)

    @property
    def clock(self) -> ClockQuality:
        """How well the autopilot's clock is known."""
        return self._clocks[self._link.target_system].quality

    @property
    def connected(self) -> bool:
        return self._connected

    def _stamp(self, system: int, boot_ns: int, now_ns: int) -> int:
        """When it was true: mapped, never in the future; the arrival where the mapping is unknown or absurd."""
        mapped_ns = self._clocks[system].companion_ns(boot_ns)
        if mapped_ns is None or mapped_ns > now_ns or now_ns - mapped_ns > OLDEST_STAMP_NS:
            return now_ns
        return mapped_ns

    def _ask_time(self, now_ns: int) -> None:
        if now_ns < self._timesync_due_ns:
            return
        quality = self.clock
        settled = quality.converged and quality.samples >= TIMESYNC_FAST_SAMPLES
        self._timesync_due_ns = now_ns + (TIMESYNC_SLOW_NS if settled else TIMESYNC_FAST_NS)
        self._timesync_sent_ns.append(now_ns)
        self._send(dialect.Timesync(0, now_ns))

    def _ask_streams(self, now_ns: int) -> None:
        target = {"system": self._link.target_system, "component": self._link.target_component}
        for command, parameters in self._streams.due(now_ns):
            self._send(streams.request(command, parameters, **target))

    def _link_age_s(self, now_ns: int) -> float:
        return 0.0 if self._heard_ns is None else (now_ns - self._heard_ns) * 1e-9

    def _found(self, now_ns: int) -> None:
        """First heartbeat, or the first after a loss: the autopilot may have restarted and forgotten what it was asked."""
        self._connected = True
        self._heard_ns = now_ns
        self._timesync_due_ns = now_ns
        self._streams.start_over(now_ns)

    # ------------------------------------------------------------------------------------------------------------- in

    def _receive_frame(self, frame: bytes, now_ns: int) -> None:
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
        vehicle, system = self._vehicle, self._link.target_system
        return {
            dialect.Odometry: self._stamped(system, vehicle.odometry, "time_usec", 1_000),
            dialect.AttitudeQuaternion: lambda m, _: vehicle.attitude(m),
            dialect.LocalPositionNed: self._stamped(system, vehicle.local_position, "time_boot_ms", 1_000_000),
            dialect.DistanceSensor: self._stamped(system, range_measurement, "time_boot_ms", 1_000_000),
            dialect.AttitudeTarget: self._stamped(system, thrust_report, "time_boot_ms", 1_000_000),
            dialect.HighresImu: self._stamped(system, acceleration_report, "time_usec", 1_000),
            dialect.GlobalPositionInt: self._on_global_position,
            dialect.GpsGlobalOrigin: self._on_origin,
            dialect.Heartbeat: self._on_heartbeat,
            dialect.CurrentMode: self._on_current_mode,
            dialect.ExtendedSysState: lambda m, _: self._status.extended_state(m),
            dialect.SysStatus: lambda m, _: self._status.system_state(m),
            dialect.BatteryStatus: lambda m, _: self._status.battery(m),
            dialect.HomePosition: lambda m, _: self._status.home(m),
            dialect.CommandAck: self._on_ack,
            dialect.Timesync: lambda m, now_ns: self._on_timesync(system, m, now_ns),
            dialect.Ping: self._on_ping,
            dialect.Statustext: lambda m, now_ns: self._put(self._texts.statustext(m, now_ns)),
            dialect.Event: lambda m, now_ns: self._put(event_text(m, now_ns)),
        }

    def _beacon_handlers(self) -> Handlers:
        system = self._link.beacon_system
        return {
            dialect.GlobalPositionInt: self._on_beacon_position,
            dialect.Odometry: self._on_beacon_odometry,
            dialect.GpsGlobalOrigin: lambda m, _: self._beacon.set_origin(m),
            dialect.Timesync: lambda m, now_ns: self._on_timesync(system, m, now_ns),
        }

    def _stamped(self, system: int, read: Callable[[Any, int], SensorInput | None], clock: str, to_ns: int) -> Handler:
        """A handler that stamps with the boot time in field `clock`, in units of `to_ns`, and keeps what `read` makes."""

        def handle(message: Any, now_ns: int) -> None:
            self._put(read(message, self._stamp(system, getattr(message, clock) * to_ns, now_ns)))

        return handle

    def _on_heartbeat(self, message: dialect.Heartbeat, now_ns: int) -> None:
        if not self._connected:
            self._found(now_ns)
        self._status.heartbeat(message, now_ns)
        self._commander.mode_seen(self._status.mode, self._status.intended_mode, now_ns)

    def _on_current_mode(self, message: dialect.CurrentMode, now_ns: int) -> None:
        self._commander.current_mode_seen = True
        self._status.current_mode(message, now_ns)
        self._report_due_ns = now_ns  # every mode report is passed on: its age decides whether setpoints may be sent
        self._commander.mode_seen(self._status.mode, self._status.intended_mode, now_ns)

    def _on_ack(self, message: dialect.CommandAck, now_ns: int) -> None:
        kind = self._commander.acknowledged(message, now_ns)
        if kind in (CommandKind.ARM, CommandKind.DISARM, CommandKind.FORCE_DISARM):
            self._status.arm_answered(armed=kind is CommandKind.ARM, now_ns=now_ns)

    def _on_timesync(self, system: int, message: dialect.Timesync, now_ns: int) -> None:
        """A question is answered with our time; an answer counts only when it is to a question of ours."""
        if message.tc1 == 0:
            if system == self._link.target_system:
                self._send(dialect.Timesync(now_ns, message.ts1))
        elif message.ts1 in self._timesync_sent_ns:
            self._clocks[system].add(sent_ns=message.ts1, boot_ns=message.tc1, received_ns=now_ns)

    def _on_ping(self, message: dialect.Ping, _now_ns: int) -> None:
        if message.target_system == 0 and message.target_component == 0:
            self._send(
                message._replace(target_system=self._link.target_system, target_component=self._link.target_component)
            )

    def _on_origin(self, message: dialect.GpsGlobalOrigin, _now_ns: int) -> None:
        self._origin = geo_origin(message)

    def _on_global_position(self, message: dialect.GlobalPositionInt, _now_ns: int) -> None:
        self._altitude_amsl_m = message.alt * 1e-3

    def _on_beacon_position(self, message: dialect.GlobalPositionInt, now_ns: int) -> None:
        if self._origin is not None:
            t_ns = self._stamp(self._link.beacon_system, message.time_boot_ms * 1_000_000, now_ns)
            self._put(self._beacon.global_position(message, self._origin, t_ns))

    def _on_beacon_odometry(self, message: dialect.Odometry, now_ns: int) -> None:
        if self._origin is not None:
            t_ns = self._stamp(self._link.beacon_system, message.time_usec * 1_000, now_ns)
            self._put(self._beacon.odometry(message, self._origin, t_ns))

    # ------------------------------------------------------------------------------------------------------- messages

    def _put(self, message: SensorInput | None) -> None:
        if message is not None:
            self._inbox.append(message)

    def _drain(self, now_ns: int) -> list[SensorInput]:
        """Everything learned, then the status if it changed or is due: results come before the state they explain."""
        self._drain_commands()
        self._check_link(now_ns)
        self._report_status(now_ns)
        inbox, self._inbox = self._inbox, []
        return inbox

    def _drain_commands(self) -> None:
        to_send, results = self._commander.drain()
        for message in to_send:
            self._send(message)
        self._inbox.extend(results)

    def _check_link(self, now_ns: int) -> None:
        if self._connected and self._heard_ns is not None and now_ns - self._heard_ns >= self._lost_after_ns:
            self._connected = False

    def _report_status(self, now_ns: int) -> None:
        report = self._status.report(connected=self._connected, link_age_s=self._link_age_s(now_ns))
        changed = self._reported is None or not same_but_for_age(report, self._reported)
        if (changed and self._heard_ns is not None) or now_ns >= self._report_due_ns:
            self._reported = report
            self._report_due_ns = now_ns + STATUS_PERIOD_NS
            self._inbox.append(report)
