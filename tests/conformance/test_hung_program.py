"""A program that hangs while it flies OFFBOARD through MAVSDK: MAVSDK's threads live on, and PX4's own failsafe must act all the same.

The vehicle is the simulated one over real UDP at four times real time. The hang is real: the event loop is blocked.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from math import nan

import pytest
from udp_vehicle import UdpVehicle, free_port

from companion.io.link import Link
from companion.io.links import open_link
from companion.mavlink import codec, dialect

pytestmark = [pytest.mark.sockets, pytest.mark.timeout(240)]

PATIENCE_S = 60.0
TAKEOFF, SET_MODE, ARM = 22, 176, 400
SET_VELOCITY = 1479
"""Type mask: velocity and yaw rate."""


async def until(condition: Callable[[], bool], what: str, meanwhile: Callable[[], None] = lambda: None) -> None:
    end_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end_s, f"{what}: not within {PATIENCE_S} s"
        meanwhile()
        await asyncio.sleep(0.02)


class Pilot:
    """Commands and setpoints as the app sends them, without the app."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self._sequence = 0

    def command(self, number: int, *parameters: float) -> None:
        values = [*parameters, *[nan if number == TAKEOFF else 0.0] * (7 - len(parameters))]
        self._send(dialect.CommandLong(*values, number, 1, 1, 0))

    def setpoint(self) -> None:
        self._send(
            dialect.SetPositionTargetLocalNed(
                0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, SET_VELOCITY, 1, 1, 1
            )
        )

    def ask_for_offboard(self) -> None:
        self.setpoint()
        self.command(SET_MODE, 1.0, 6.0)

    def _send(self, message: dialect.CommandLong | dialect.SetPositionTargetLocalNed) -> None:
        self._sequence = (self._sequence + 1) % 256
        self._link.send(codec.encode(message, self._sequence, 1, 191))


def test_a_program_that_hangs_behind_mavsdk_loses_offboard() -> None:
    port = free_port()

    async def fly(vehicle: UdpVehicle) -> None:
        rig = vehicle.rig

        def is_offboard() -> bool:
            return rig.autopilot.mode_name == "OFFBOARD"

        heard: list[bytes] = []
        async with open_link(f"mavsdk+udpin://127.0.0.1:{port}", heard.append) as link:
            pilot = Pilot(link)
            await until(lambda: bool(heard), "the vehicle is heard")
            await until(
                lambda: rig.autopilot.mode_name == "AUTO_TAKEOFF", "take-off mode", lambda: pilot.command(TAKEOFF)
            )
            await until(lambda: rig.is_armed, "arming", lambda: pilot.command(ARM, 1.0))
            await until(lambda: rig.height_m > 1.5, "take-off")
            await until(is_offboard, "offboard", pilot.ask_for_offboard)
            await until(lambda: rig.vehicle.state.vx > 0.7, "flight to the north", pilot.setpoint)
            assert is_offboard()
            end_s = time.monotonic() + PATIENCE_S
            while is_offboard():  # nothing here gives the event loop a turn: this is the hang
                assert time.monotonic() < end_s, "still OFFBOARD: somebody keeps sending setpoints"
                time.sleep(0.01)  # noqa: ASYNC251 - on purpose

    with UdpVehicle(port) as vehicle:
        asyncio.run(fly(vehicle))
