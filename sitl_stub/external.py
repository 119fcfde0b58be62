"""A virtual pad for a foreign autopilot: deck, cameras, range sensor and beacon around a vehicle that flies elsewhere.

`sitl-stub --vehicle external` speaks MAVLink with an autopilot in simulation (any PX4 with SIH or Gazebo) on its ground
station link: it asks for the vehicle's true pose (external_pose.py says in which messages) with SET_MESSAGE_INTERVAL, learns the autopilot's
boot clock by TIMESYNC, sends the range sensor as DISTANCE_SENSOR and the beacon as a second system, which PX4 forwards to
the application's link. Nothing is simulated of the vehicle, and nothing touches: no contact, no verdict but the time.

Sans-IO like World, and with the same surface, so that server.py drives either. W has its origin on the ground below the
vehicle's first pose: where it stands if it is disarmed then, else at the scenario's altitude. Time is the autopilot's boot clock as soon as it is known.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from sitl_stub.beacon import Beacon
from sitl_stub.camera.scene import CameraView
from sitl_stub.camera_setup import camera_channels, light_of
from sitl_stub.capture import CameraChannel, Capture, turned_back
from sitl_stub.carriers.deck import Deck, DeckState
from sitl_stub.contact import ContactState
from sitl_stub.datagram_faults import Datagram
from sitl_stub.external_pose import PoseSource, ReportedPose
from sitl_stub.geodesy import Origin
from sitl_stub.mavlink.definitions import (
    COMMAND_LONG,
    DISTANCE_SENSOR,
    GPS_GLOBAL_ORIGIN,
    HEARTBEAT,
    TIMESYNC,
    MessageType,
)
from sitl_stub.mavlink.frame import Frame, FrameReader, encode
from sitl_stub.multirotor import VehicleTruth
from sitl_stub.pad_layout import PadLayout
from sitl_stub.randomness import generator
from sitl_stub.rotation import Quaternion, Vec3, from_euler, rotate_back
from sitl_stub.scenario import Scenario, load_pad
from sitl_stub.sensors import distance_down
from sitl_stub.server_link import LinkOptions
from sitl_stub.start import Start, draw_start
from sitl_stub.verdict import Ending, Verdict
from sitl_stub.world import StepOutput, Truth, carried_back
from sitl_stub.world_setup import deck_shape, make_deck, make_range_sensor

EXTERNAL_LINKS = (LinkOptions("ground", 14550, 18570),)
"""Takes the place of a ground station: binds 14550, where PX4 sends to, and speaks to 18570."""

_SYSTEM, _COMPONENT = 254, 190
_POSE_HZ = 100.0
_SECOND_US = 1_000_000
_POSE_STALE_US = 500_000
_GROUND_STATION, _NO_AUTOPILOT, _ACTIVE = 6, 8, 4
_SET_MESSAGE_INTERVAL, _REQUEST_MESSAGE = 511, 512
_ROTATION_DOWN = 25
_LEGS_M = 0.15
_NOT_SEEN = (0.0, 0.0, 0.0)
# TIMESYNC answers that took longer than this say little about the clock.
_LARGEST_ROUND_TRIP_US = 20_000
_CLOCK_SHARE = 0.1


@dataclass(frozen=True, slots=True)
class TruePose:
    """What the autopilot said in W, and when it came (our clock)."""

    t_us: int
    position_ned_m: Vec3
    velocity_ned_m_s: Vec3
    q_ned_frd: Quaternion
    rates_frd_rad_s: Vec3


class BootClock:
    """The autopilot's boot clock minus ours, from TIMESYNC; never goes back."""

    def __init__(self) -> None:
        self.offset_us: float | None = None
        self._last_us = 0

    def answered(self, sent_us: int, now_us: int, boot_us: int) -> None:
        """A TIMESYNC request sent at `sent_us` has been answered with the autopilot's time."""
        if now_us - sent_us > _LARGEST_ROUND_TRIP_US:
            return
        measured = boot_us - 0.5 * (sent_us + now_us)
        if self.offset_us is None or abs(measured - self.offset_us) > _SECOND_US:
            self.offset_us, self._last_us = measured, 0
        else:
            self.offset_us += _CLOCK_SHARE * (measured - self.offset_us)

    def boot_us(self, now_us: int) -> int:
        self._last_us = max(self._last_us, round(now_us + (self.offset_us or 0.0)))
        return self._last_us


class ExternalWorld:
    """Pad, cameras, range sensor and beacon; the vehicle is somebody else's."""

    def __init__(self, scenario: Scenario, seed: int) -> None:
        self.scenario = scenario
        self.t_us = 0
        self.clock = BootClock()
        self.pose: TruePose | None = None
        self.source = PoseSource()
        self.target: tuple[int, int] | None = None
        """System and component of the autopilot."""
        self.origin: Origin | None = None
        self.pad: PadLayout = load_pad(scenario)
        self._seed = seed
        self._shape = deck_shape(self.pad)
        self._start: Start = draw_start(scenario, generator(seed, "start"))
        self._deck: Deck | None = None
        self._deck_zero_us = 0
        self._beacon: Beacon | None = None
        self._range = make_range_sensor(scenario, seed)
        self._cameras: list[CameraChannel] = camera_channels(scenario, self.pad, seed)
        self._light = light_of(scenario.light)
        self._reader = FrameReader()
        self._sequence = 0
        self._armed = False
        self._mode = "no autopilot"
        self._asked_us = self._heartbeat_us = self._timesync_us = -_SECOND_US
        self._range_us = self._beacon_us = 0
        self._waiting_beacon: list[tuple[int, list[bytes]]] = []

    def step(self, dt_s: float, datagrams_in: Sequence[Datagram] = ()) -> StepOutput:
        """Read what the autopilot sent, go on by `dt_s` of our time, give out what is due."""
        for datagram in datagrams_in:
            for frame in self._reader.read(datagram.data):
                self._handle(frame)
        self.t_us += round(dt_s * 1e6)
        sent = self._requests()
        output = StepOutput()
        if self._sees_vehicle():
            self._take_pictures(output)
            sent += self._sense()
        output.datagrams += [Datagram("ground", data) for data in sent]
        return output

    # ---------------------------------------------------------------------------------------------------------- reading

    def _handle(self, frame: Frame) -> None:
        if frame.message_type is HEARTBEAT:
            self._handle_heartbeat(frame)
        elif (frame.system_id, frame.component_id) != self.target:
            return
        elif frame.message_type is TIMESYNC:
            self._handle_timesync(frame)
        else:
            reported = self.source.read(frame, self.t_us)
            if reported is not None:
                self._handle_pose(reported)

    def _handle_heartbeat(self, frame: Frame) -> None:
        custom_mode, kind, autopilot, base_mode, *_ = (int(value) for value in frame.values())
        if autopilot == _NO_AUTOPILOT or kind == _GROUND_STATION or frame.component_id != 1:
            return
        if self.target is None:
            self.target = (frame.system_id, frame.component_id)
        if self.target == (frame.system_id, frame.component_id):
            self._armed = bool(base_mode & 0x80)
            self._mode = f"mode {custom_mode >> 16 & 0xFF}.{custom_mode >> 24}"

    def _handle_pose(self, pose: ReportedPose) -> None:
        if self.origin is None:
            # Disarmed, it stands on the ground; armed, it may be anywhere above the ground of the scenario.
            ground_m = self.scenario.place.altitude_m if self._armed else pose.altitude_m - _LEGS_M
            self.origin = Origin(pose.latitude_deg, pose.longitude_deg, ground_m)
        north, east = self.origin.to_local(pose.latitude_deg, pose.longitude_deg)
        position = (north, east, self.origin.altitude_m - pose.altitude_m)
        self.pose = TruePose(self.t_us, position, pose.velocity_ned_m_s, pose.q_ned_frd, pose.rates_frd_rad_s)

    def _handle_timesync(self, frame: Frame) -> None:
        answered_ns, sent_ns, *_ = (int(value) for value in frame.values())
        # Ours come back with the autopilot's time in tc1; a request of its own has 0 there.
        if answered_ns > 0:
            self.clock.answered(sent_ns // 1000, self.t_us, answered_ns // 1000)

    # ---------------------------------------------------------------------------------------------------------- sending

    def _requests(self) -> list[bytes]:
        sent = []
        if self.t_us - self._heartbeat_us >= _SECOND_US:
            self._heartbeat_us = self.t_us
            sent.append(self._frame(HEARTBEAT, 0, _GROUND_STATION, _NO_AUTOPILOT, 0, _ACTIVE, 3))
        if self.target is None:
            return sent
        if self.t_us - self._timesync_us >= _SECOND_US // 5:
            self._timesync_us = self.t_us
            sent.append(self._frame(TIMESYNC, 0, self.t_us * 1000, *self.target))
        if not self._sees_vehicle() and self.t_us - self._asked_us >= _SECOND_US:
            self._asked_us = self.t_us
            sent.append(self._command(_SET_MESSAGE_INTERVAL, self.source.ask().id, 1e6 / _POSE_HZ))
            if self.source.needs_origin:
                sent.append(self._command(_REQUEST_MESSAGE, GPS_GLOBAL_ORIGIN.id))
        return sent

    def _command(self, command: int, *parameters: float) -> bytes:
        assert self.target is not None
        values = (*parameters, *(0.0,) * (7 - len(parameters)))
        return self._frame(COMMAND_LONG, *values, command, *self.target, 0)

    def _sees_vehicle(self) -> bool:
        """A fresh pose and a known clock."""
        fresh = self.pose is not None and self.t_us - self.pose.t_us < _POSE_STALE_US
        return fresh and self.clock.offset_us is not None

    def _sense(self) -> list[bytes]:
        sent: list[bytes] = []
        pose, deck, boot_us = self._vehicle_now(0.0), self._deck_now(), self._boot_us()
        if self.scenario.range_sensor.fitted and self.t_us >= self._range_us:
            self._range_us = self.t_us + self._range.period_us
            self._range.sample(distance_down(pose.position_ned_m, pose.q_ned_frd, deck, self._shape))
            sent += self._distance_sensor(boot_us)
        if self.scenario.beacon.fitted:
            sent += self._beacon_frames(deck, boot_us)
        return sent

    def _distance_sensor(self, boot_us: int) -> list[bytes]:
        s, value_m = self.scenario.range_sensor, self._range.value_m
        if value_m is None:
            return []
        ranges = (round(s.min_m * 100.0), round(s.max_m * 100.0), round(value_m * 100.0))
        rest = (0, 1, _ROTATION_DOWN, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 100)
        return [self._frame(DISTANCE_SENSOR, boot_us // 1000 & 0xFFFFFFFF, *ranges, *rest)]

    def _beacon_frames(self, deck: DeckState, boot_us: int) -> list[bytes]:
        if self._beacon is None:
            assert self.origin is not None
            self._beacon = Beacon(self.scenario.beacon, self.origin, generator(self._seed, "beacon"))
        if self.t_us >= self._beacon_us:
            self._beacon_us = self.t_us + self._beacon.period_us
            self._waiting_beacon.append((self.t_us + self._beacon.delay_us, self._beacon.frames(deck, boot_us)))
        sent: list[bytes] = []
        while self._waiting_beacon and self._waiting_beacon[0][0] <= self.t_us:
            sent += self._waiting_beacon.pop(0)[1]
        return sent

    def _frame(self, message: MessageType, *values: float | int) -> bytes:
        self._sequence = (self._sequence + 1) & 0xFF
        return encode(message, message.struct.pack(*values), self._sequence, _SYSTEM, _COMPONENT)

    # ---------------------------------------------------------------------------------------------------------- looking

    def _boot_us(self) -> int:
        return self.clock.boot_us(self.t_us)

    def _deck_now(self) -> DeckState:
        boot_us = self._boot_us()
        if self._deck is None:
            self._deck = make_deck(self.scenario, self._seed, self._start, self.pad)
            self._deck_zero_us = boot_us
        return self._deck.at((boot_us - self._deck_zero_us) * 1e-6)

    def _vehicle_now(self, back_s: float) -> TruePose:
        """The last pose carried to `back_s` before now at constant velocity and body rates."""
        pose = self.pose
        assert pose is not None
        since_s = (self.t_us - pose.t_us) * 1e-6 - back_s
        position = carried_back(pose.position_ned_m, pose.velocity_ned_m_s, -since_s)
        turned = turned_back(pose.q_ned_frd, pose.rates_frd_rad_s, -since_s)
        return TruePose(self.t_us, position, pose.velocity_ned_m_s, turned, pose.rates_frd_rad_s)

    def _take_pictures(self, output: StepOutput) -> None:
        boot_us = self._boot_us()
        for camera in self._cameras:
            camera.skip_to(boot_us - _POSE_STALE_US // 10)
            while camera.next_us <= boot_us:
                capture: Capture | None = camera.capture(self._view(camera, boot_us))
                if capture is not None:
                    output.captures.append(capture)

    def _view(self, camera: CameraChannel, boot_us: int) -> CameraView:
        back_s = (boot_us - camera.next_us) * 1e-6
        deck, vehicle = self._deck_now(), self._vehicle_now(back_s)
        deck_q = from_euler(*deck.rpy_rad)
        deck_rates = rotate_back(deck_q, deck.angular_velocity_ned_rad_s)
        return CameraView(
            t_us=camera.next_us,
            vehicle_position_ned_m=vehicle.position_ned_m,
            vehicle_q_ned_frd=vehicle.q_ned_frd,
            deck_position_ned_m=carried_back(deck.position_ned_m, deck.velocity_ned_m_s, back_s),
            deck_q_ned_pad=turned_back(deck_q, deck_rates, back_s),
            vehicle_velocity_ned_m_s=vehicle.velocity_ned_m_s,
            vehicle_angular_velocity_frd_rad_s=vehicle.rates_frd_rad_s,
            deck_velocity_ned_m_s=deck.velocity_ned_m_s,
            deck_angular_velocity_pad_rad_s=deck_rates,
            light=self._light,
        )

    def truth(self) -> Truth:
        """What is true now; zeros until the vehicle is seen."""
        if not self._sees_vehicle():
            nothing = VehicleTruth(_NOT_SEEN, _NOT_SEEN, (1.0, 0.0, 0.0, 0.0), _NOT_SEEN, _NOT_SEEN, _NOT_SEEN, False)
            return self._truth(nothing, None)
        v = self._vehicle_now(0.0)
        vehicle = VehicleTruth(
            v.position_ned_m, v.velocity_ned_m_s, v.q_ned_frd, v.rates_frd_rad_s, _NOT_SEEN, _NOT_SEEN, False
        )
        return self._truth(vehicle, self._deck_now())

    def _truth(self, vehicle: VehicleTruth, deck: DeckState | None) -> Truth:
        identity = (1.0, 0.0, 0.0, 0.0)
        in_pad = _NOT_SEEN
        if deck is not None:
            o, p = deck.position_ned_m, vehicle.position_ned_m
            in_pad = rotate_back(from_euler(*deck.rpy_rad), (p[0] - o[0], p[1] - o[1], p[2] - o[2]))
        return Truth(
            t_us=self.t_us,
            vehicle=vehicle,
            pad_position_ned_m=deck.position_ned_m if deck else _NOT_SEEN,
            pad_velocity_ned_m_s=deck.velocity_ned_m_s if deck else _NOT_SEEN,
            pad_q_ned_pad=from_euler(*deck.rpy_rad) if deck else identity,
            pad_angular_velocity_ned_rad_s=deck.angular_velocity_ned_rad_s if deck else _NOT_SEEN,
            contact=ContactState(),
            vehicle_in_pad_m=in_pad,
            mode=self._mode,
            is_armed=self._armed,
            wind_ned_m_s=_NOT_SEEN,
        )

    def verdict(self) -> Verdict:
        """Only the distance: what the foreign simulator's ground does to the vehicle is not ours to judge."""
        x, y, _ = self.truth().vehicle_in_pad_m
        return Verdict(Ending.FLYING, False, self.t_us * 1e-6, final_error_m=math.hypot(x, y))
