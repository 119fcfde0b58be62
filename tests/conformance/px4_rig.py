"""A simulated PX4 on SIH's flat ground, flown in lockstep through MAVLink bytes: what the recordings of the real one are compared with.

The ground is SIH's (benchmarks/sih_ground.py). Messages go out through pymavlink (not through the simulator's own packer) and come back
through the recorded rows' eyes: acknowledgements, modes, texts.
"""

from __future__ import annotations

import struct
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import development as mavlink

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "benchmarks"))

from sih_ground import SihGround  # noqa: E402

from sitl_stub.airframe import read_airframe  # noqa: E402
from sitl_stub.autopilot.autopilot import Autopilot, AutopilotOptions  # noqa: E402
from sitl_stub.autopilot.estimate import NO_ERRORS  # noqa: E402
from sitl_stub.multirotor import Multirotor  # noqa: E402

DT_US, RANGE_US = 4_000, 20_000
LOITER, OFFBOARD, LAND, RTL, TAKEOFF = 0x03040000, 0x00060000, 0x06040000, 0x05040000, 0x02040000
VELOCITY_MASK = 0b0000_0101_1100_0111
"""Velocity and yaw rate only."""


@dataclass
class Seen:
    """One received message with the time of the simulator."""

    t_s: float
    link: str
    message: Any


@dataclass
class Rig:
    """The vehicle and everything it said."""

    parameters: dict[str, float] = field(default_factory=dict)
    airframe: str = "sih_quadx"
    cold_boot: bool = False
    has_range_sensor: bool = True
    options: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        airframe = read_airframe(ROOT / "configs" / "airframes" / f"{self.airframe}.toml")
        base = {"errors": NO_ERRORS, "home_error_scale": 0.0, "imu_noise_scale": 0.0, **self.options}
        options = AutopilotOptions(cold_boot=self.cold_boot, has_range_sensor=self.has_range_sensor, **base)
        self.vehicle = Multirotor(airframe)
        self.vehicle.on_surface = True
        self.ground = SihGround(self.vehicle)
        self.autopilot = Autopilot(airframe, self.parameters, np.random.default_rng(1), options)
        self.t_us = 0
        self.seen: list[Seen] = []
        self.decoders = {link: mavlink.MAVLink(None) for link in ("onboard", "ground")}
        self.senders = {
            "onboard": mavlink.MAVLink(None, srcSystem=1, srcComponent=191),
            "ground": mavlink.MAVLink(None, srcSystem=255, srcComponent=190),
        }
        self.raw: list[tuple[int, str, bytes]] = []
        self.every: list[tuple[int, int, Callable[[], None]]] = []
        self.decode_all = False
        self.quiet = False
        """Keep raw datagrams only; nothing is decoded."""

    # Time ---------------------------------------------------------------------------------------------------------

    @property
    def t_s(self) -> float:
        return self.t_us * 1e-6

    @property
    def height_m(self) -> float:
        return -self.vehicle.state.z

    def run(self, duration_s: float) -> None:
        """Fly on."""
        end_us = self.t_us + round(duration_s * 1e6)
        while self.t_us < end_us:
            self.step()

    def run_until(self, condition: Callable[[], bool], timeout_s: float) -> float:
        """Fly until the condition holds; time that took, AssertionError after the timeout."""
        start_us = self.t_us
        while not condition():
            assert self.t_us - start_us < timeout_s * 1e6, f"not within {timeout_s} s"
            self.step()
        return (self.t_us - start_us) * 1e-6

    def step(self) -> None:
        """One 4 ms step of vehicle, ground and autopilot."""
        for index, (next_us, period_us, send) in enumerate(self.every):
            if next_us <= self.t_us:
                send()
                self.every[index] = (next_us + period_us, period_us, send)
        truth = self.vehicle.truth()
        range_m = None
        if self.has_range_sensor and 0.0 < self.height_m < 100.0:  # SIH's sensor sees nothing at or below the ground
            range_m = self.height_m
        if self.t_us % RANGE_US == 0:
            self.autopilot.see_range(self.t_us, range_m)
        motors = self.autopilot.step(self.t_us, truth, range_m, DT_US * 1e-6)
        self._collect()
        self.vehicle.step(DT_US * 1e-6, motors)
        self.ground.stop(DT_US)
        self.t_us += DT_US

    # Talking ------------------------------------------------------------------------------------------------------

    def _collect(self) -> None:
        for link, data in self.autopilot.datagrams():
            self.raw.append((self.t_us, link, data))
            if self.quiet:
                continue
            message_id = data[7] | data[8] << 8 | data[9] << 16
            if message_id not in mavlink.mavlink_map or not (self.decode_all or message_id in _INTERESTING):
                continue
            for message in self.decoders[link].parse_buffer(data) or []:
                self.seen.append(Seen(self.t_s, link, message))

    def send(self, message: Any, link: str = "onboard") -> None:
        """A pymavlink message to the vehicle."""
        self.autopilot.receive(link, message.pack(self.senders[link]), self.t_us)

    def command(self, command: int, *parameters: float, link: str = "onboard", to: tuple[int, int] = (1, 1)) -> None:
        values = [*parameters, *([0.0] * (7 - len(parameters)))]
        self.send(mavlink.MAVLink_command_long_message(*to, command, 0, *values), link)

    def set_mode(self, custom_mode: int, link: str = "onboard", flags: float = 1.0) -> None:
        self.command(176, flags, custom_mode >> 16 & 0xFF, custom_mode >> 24, link=link)

    def arm(self) -> None:
        self.command(400, 1.0)

    def velocity(
        self, vx: float, vy: float, vz: float, yaw_rate: float = 0.0, *, frame: int = 1, mask: int = VELOCITY_MASK
    ) -> None:
        self.send(
            mavlink.MAVLink_set_position_target_local_ned_message(
                0, 1, 1, frame, mask, 0, 0, 0, vx, vy, vz, 0, 0, 0, 0, yaw_rate
            )
        )

    def stream_velocity(self, vx: float, vy: float, vz: float, rate_hz: float = 20.0) -> None:
        """Send it again and again from now on."""
        self.stop_streams()
        self.every.append((self.t_us, round(1e6 / rate_hz), lambda: self.velocity(vx, vy, vz)))

    def stop_streams(self) -> None:
        self.every = [entry for entry in self.every if getattr(entry[2], "keep", False)]

    def beat(self, link: str = "ground", kind: int = 6) -> None:
        """Heartbeats at 1 Hz from now on."""

        def send() -> None:
            self.send(mavlink.MAVLink_heartbeat_message(kind, 8, 0, 0, 0, 3), link)

        send.keep = True  # type: ignore[attr-defined]
        self.every.append((self.t_us, 1_000_000, send))

    def take_off(self, height_m: float = 10.0) -> None:
        """AUTO.TAKEOFF to a height and wait for LOITER."""
        amsl = self.autopilot.home.altitude_amsl_m + height_m if self.autopilot.home.is_set else 489.4 + height_m
        self.command(22, nan, nan, nan, nan, nan, nan, amsl)
        self.arm()
        self.run_until(lambda: self.mode == LOITER and not self.is_landed and self.height_m > height_m - 1.0, 60.0)
        self.run(3.0)

    def fly_offboard(self, height_m: float = 10.0) -> None:
        """Hover in OFFBOARD with a velocity stream of zero."""
        self.take_off(height_m)
        self.stream_velocity(0.0, 0.0, 0.0)
        self.run(0.2)
        self.set_mode(OFFBOARD)
        self.run(1.0)

    # Looking ------------------------------------------------------------------------------------------------------

    @property
    def mode(self) -> int:
        return self.autopilot.commander.custom_mode

    @property
    def is_armed(self) -> bool:
        return self.autopilot.is_armed

    @property
    def is_landed(self) -> bool:
        return self.autopilot.land_detector.landed

    def messages(self, kind: str, link: str | None = None, since_s: float = 0.0) -> list[Any]:
        return [
            s.message for s in self.seen if s.message.get_type() == kind and s.t_s >= since_s and link in (None, s.link)
        ]

    def acks(self, since_s: float = 0.0) -> list[tuple[int, int]]:
        return [(m.command, m.result) for m in self.messages("COMMAND_ACK", since_s=since_s)]

    def texts(self, link: str = "ground", since_s: float = 0.0) -> list[str]:
        return [m.text for m in self.messages("STATUSTEXT", link, since_s)]

    def events(self, since_s: float = 0.0) -> list[int]:
        """Ids of EVENT messages on the onboard link."""
        return [
            struct.unpack("<I", data[10:14])[0]
            for t_us, link, data in self.raw
            if link == "onboard" and t_us >= since_s * 1e6 and data[7:10] == b"\x9a\x01\x00"
        ]


_INTERESTING = {0, 4, 11, 22, 77, 111, 148, 242, 244, 245, 253, 436}
