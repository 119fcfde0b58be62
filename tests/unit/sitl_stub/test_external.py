"""A virtual pad around a foreign autopilot: here a second simulated one, reached only through its ground link."""

from __future__ import annotations

import math

import pytest
from pymavlink.dialects.v20 import common

from sitl_stub import scenario as scenarios
from sitl_stub.datagram_faults import Datagram
from sitl_stub.external import BootClock, ExternalWorld
from sitl_stub.external_pose import read_odometry
from sitl_stub.geodesy import Origin
from sitl_stub.mavlink.definitions import HIL_STATE_QUATERNION, ODOMETRY, SIM_STATE, MessageType
from sitl_stub.mavlink.frame import Frame, FrameReader
from sitl_stub.world import StepOutput, World

STEP_S = 0.004
BOOT_AHEAD_S = 3.0


class Pair:
    """The pad's world, and a vehicle's that booted earlier and has no pad near.

    `only` is the message by which the vehicle tells its pose, as its autopilot would: PX4's HIL_STATE_QUATERNION (None), or in its place
    the same truth as SIM_STATE (as ArduPilot sends it), or nothing but ODOMETRY.
    """

    def __init__(self, only: str | None = None) -> None:
        self.only = only
        small = {
            "cameras.down.width_px": 188,
            "cameras.down.height_px": 120,
            "cameras.down.fx_px": 105.0,
            "cameras.down.fy_px": 105.0,
            "place.pad_distance_m": 3.0,
        }
        self.pad = ExternalWorld(scenarios.with_overrides(scenarios.load("circle"), small), 7)
        self.sim_state = common.MAVLink(None, srcSystem=1, srcComponent=1)
        bare = {
            "estimate.error_scale": 0.0 if only == "ODOMETRY" else 1.0,
            "cameras": {},
            "beacon.fitted": False,
            "range_sensor.fitted": False,
            "place.pad_distance_m": 500.0,
        }
        self.vehicle = World(scenarios.with_overrides(scenarios.load("static"), bare), 2)
        self.vehicle.step(BOOT_AHEAD_S)
        self.to_pad: list[Datagram] = []
        self.to_vehicle: list[Datagram] = []

    def run(self, duration_s: float) -> list[StepOutput]:
        outputs = []
        for _ in range(round(duration_s / STEP_S)):
            output = self.pad.step(STEP_S, self.to_pad)
            self.to_vehicle = output.datagrams
            sent = self.vehicle.step(STEP_S, self.to_vehicle).datagrams
            self.to_pad = [self._instead(datagram) for datagram in sent if datagram.link == "ground"]
            outputs.append(output)
        return outputs

    def _instead(self, datagram: Datagram) -> Datagram:
        if self.only is None or message_id(datagram.data) != HIL_STATE_QUATERNION.id:
            return datagram
        return Datagram("ground", b"" if self.only == "ODOMETRY" else self._sim_state())

    def _sim_state(self) -> bytes:
        v, origin = self.vehicle.truth().vehicle, self.vehicle.autopilot.options.origin
        lat, lon = origin.to_global(*v.position_ned_m[:2])
        alt = origin.altitude_m - v.position_ned_m[2]
        turning = (*(0.0,) * 3, *v.specific_force_frd_m_s2, *v.angular_velocity_frd_rad_s)
        where = (lat, lon, alt, 0.0, 0.0, *v.velocity_ned_m_s, round(lat * 1e7), round(lon * 1e7))
        return bytes(common.MAVLink_sim_state_message(*v.q_ned_frd, *turning, *where).pack(self.sim_state))


def message_id(data: bytes) -> int:
    return data[7] | data[8] << 8 | data[9] << 16


@pytest.fixture(scope="module")
def flown() -> tuple[Pair, list[StepOutput]]:
    pair = Pair()
    pair.run(3.0)
    return pair, pair.run(3.0)


def decoded(outputs: list[StepOutput], kind: str) -> list:
    reader = common.MAVLink(None)
    reader.robust_parsing = True
    every = [m for o in outputs for d in o.datagrams for m in reader.parse_buffer(bytearray(d.data)) or []]
    return [m for m in every if m.get_type() == kind]


def test_it_asks_for_the_true_pose_and_follows_it_to_the_centimetre(flown: tuple[Pair, list[StepOutput]]) -> None:
    pair, _ = flown
    assert pair.pad.target == (1, 1)
    seen, true = pair.pad.truth().vehicle, pair.vehicle.truth().vehicle
    assert seen.velocity_ned_m_s == pytest.approx(true.velocity_ned_m_s, abs=0.1)
    assert seen.q_ned_frd == pytest.approx(true.q_ned_frd, abs=0.01)
    assert seen.position_ned_m[2] == pytest.approx(true.position_ned_m[2], abs=0.05)


@pytest.mark.parametrize(("only", "source"), [("SIM_STATE", SIM_STATE), ("ODOMETRY", ODOMETRY)])
def test_it_takes_the_pose_from_what_the_autopilot_has(only: str, source: MessageType) -> None:
    pair = Pair(only)
    pair.run(7.5)
    assert pair.pad.source.message is source
    seen, true = pair.pad.truth().vehicle, pair.vehicle.truth().vehicle
    assert seen.velocity_ned_m_s == pytest.approx(true.velocity_ned_m_s, abs=0.1)
    assert seen.q_ned_frd == pytest.approx(true.q_ned_frd, abs=0.01)
    assert seen.position_ned_m[2] == pytest.approx(true.position_ned_m[2], abs=0.05)
    origin = pair.pad.origin
    assert origin is not None
    start = pair.vehicle.autopilot.options.origin.to_local(origin.latitude_deg, origin.longitude_deg)
    assert seen.position_ned_m[0] + start[0] == pytest.approx(true.position_ned_m[0], abs=0.05)
    assert seen.position_ned_m[1] + start[1] == pytest.approx(true.position_ned_m[1], abs=0.05)


def test_an_estimate_sent_unasked_is_not_taken_for_the_truth(flown: tuple[Pair, list[StepOutput]]) -> None:
    """PX4 streams ODOMETRY by itself; the pose must still be the simulator's."""
    pair, _ = flown
    assert pair.pad.source.message is HIL_STATE_QUATERNION


def frame_of(message: common.MAVLink_message) -> Frame:
    (frame,) = FrameReader().read(bytes(message.pack(common.MAVLink(None, srcSystem=1, srcComponent=1))))
    return frame


def test_odometry_in_the_body_frame_is_turned_into_north_and_east() -> None:
    half = math.sqrt(0.5)
    east_facing = (half, 0.0, 0.0, half)
    message = common.MAVLink_odometry_message(
        0, 1, 12, 1.0, 2.0, -3.0, east_facing, 4.0, 0.0, 0.0, 0.0, 0.0, 0.1, (0.0,) * 21, (0.0,) * 21
    )
    pose = read_odometry(frame_of(message), Origin(47.0, 8.0, 500.0))
    assert pose is not None
    assert pose.velocity_ned_m_s == pytest.approx((0.0, 4.0, 0.0), abs=1e-6)
    assert pose.altitude_m == pytest.approx(503.0)
    assert Origin(47.0, 8.0, 500.0).to_local(pose.latitude_deg, pose.longitude_deg) == pytest.approx((1.0, 2.0))
    assert read_odometry(frame_of(message), None) is None


def test_it_learns_the_boot_clock_and_stamps_pictures_with_it(flown: tuple[Pair, list[StepOutput]]) -> None:
    pair, outputs = flown
    captures = [capture for output in outputs for capture in output.captures]
    assert len(captures) == pytest.approx(90, abs=3)
    assert pair.pad.clock.boot_us(pair.pad.t_us) == pytest.approx(pair.vehicle.t_us, abs=10_000)
    assert abs(captures[-1].t_capture_us - pair.vehicle.t_us) < 60_000
    frame = captures[-1].render()
    assert frame.image.shape == (120, 188)
    assert frame.image.std() > 3.0


def test_the_pad_moves_and_its_beacon_says_so(flown: tuple[Pair, list[StepOutput]]) -> None:
    pair, outputs = flown
    positions = [m for m in decoded(outputs, "GLOBAL_POSITION_INT") if m.get_srcSystem() == 2]
    assert len(positions) == pytest.approx(15, abs=1)
    assert math.hypot(positions[-1].vx, positions[-1].vy) * 0.01 == pytest.approx(1.5, abs=0.5)
    assert abs(positions[-1].time_boot_ms * 1000 - pair.vehicle.t_us) < 400_000
    assert math.hypot(*pair.pad.truth().pad_velocity_ned_m_s) == pytest.approx(1.5, abs=0.2)


def test_the_range_sensor_is_sent_to_the_autopilot(flown: tuple[Pair, list[StepOutput]]) -> None:
    pair, outputs = flown
    ranges = decoded(outputs, "DISTANCE_SENSOR")
    assert len(ranges) == pytest.approx(60, abs=2)
    assert ranges[-1].orientation == 25
    assert ranges[-1].current_distance * 0.01 == pytest.approx(-pair.vehicle.truth().vehicle.position_ned_m[2], abs=0.8)


def test_without_an_autopilot_it_only_heartbeats() -> None:
    world = ExternalWorld(scenarios.load("line"), 1)
    outputs = [world.step(STEP_S) for _ in range(750)]
    names = {m.get_type() for o in outputs for m in decoded([o], "HEARTBEAT")}
    assert names == {"HEARTBEAT"}
    assert sum(len(o.datagrams) for o in outputs) == 3
    assert not [c for o in outputs for c in o.captures]
    assert world.truth().mode == "no autopilot"


def test_an_autopilot_that_falls_silent_stops_the_pictures() -> None:
    pair = Pair()
    pair.run(2.0)
    silent = [pair.pad.step(STEP_S) for _ in range(500)]
    late = silent[150:]
    assert not [c for o in late for c in o.captures]
    assert decoded(late, "COMMAND_LONG")


def test_a_boot_clock_takes_slow_answers_for_nothing_and_never_goes_back() -> None:
    clock = BootClock()
    clock.answered(0, 30_000, 5_000_000)
    assert clock.offset_us is None
    clock.answered(100_000, 102_000, 5_101_000)
    assert clock.boot_us(200_000) == 5_200_000
    clock.answered(300_000, 302_000, 5_300_000)
    assert clock.boot_us(200_000) == 5_200_000
    assert clock.boot_us(1_000_000) == pytest.approx(5_999_900)
