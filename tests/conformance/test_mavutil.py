"""pymavlink's mavutil, as scripts use it, against the simulated vehicle over real UDP, at four times real time."""

from __future__ import annotations

import os
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from udp_vehicle import UdpVehicle, free_port

os.environ.setdefault("MAVLINK20", "1")

PATIENCE_S = 40.0
"""For a machine that does much else; all is there within seconds otherwise."""

PARAMETERS = 887

pytestmark = [pytest.mark.sockets, pytest.mark.timeout(240)]


@contextmanager
def connected() -> Iterator[tuple[UdpVehicle, Any]]:
    from pymavlink import mavutil

    port = free_port()
    with UdpVehicle(port) as vehicle:
        client = mavutil.mavlink_connection(
            f"udpin:127.0.0.1:{port}", source_system=255, dialect="common", autoreconnect=False
        )
        try:
            assert client.wait_heartbeat(timeout=PATIENCE_S) is not None
            yield vehicle, client
        finally:
            client.close()


def receive_until(client: Any, kind: str, accept: Callable[[Any], bool], timeout_s: float = PATIENCE_S) -> Any:
    end_s = time.monotonic() + timeout_s
    while time.monotonic() < end_s:
        message = client.recv_match(type=kind, blocking=True, timeout=1.0)
        if message is not None and accept(message):
            return message
    raise AssertionError(f"no such {kind} within {timeout_s} s")


def test_mavutil_names_the_modes_changes_them_and_arms() -> None:
    with connected() as (vehicle, client):
        assert client.flightmode == "LOITER"
        client.set_mode("RTL")
        receive_until(client, "HEARTBEAT", lambda m: m.get_srcSystem() == 1 and client.flightmode == "RTL")
        client.set_mode("LOITER")
        receive_until(client, "HEARTBEAT", lambda m: m.get_srcSystem() == 1 and client.flightmode == "LOITER")
        client.arducopter_arm()
        ack = receive_until(client, "COMMAND_ACK", lambda m: m.command == 400)
        assert ack.result == 0
        receive_until(client, "HEARTBEAT", lambda m: m.get_srcSystem() == 1 and client.motors_armed())
        assert vehicle.rig.is_armed


def test_mavutil_fetches_parameters_with_the_bytes_of_integers() -> None:
    with connected() as (_, client):
        client.param_fetch_one("SYS_AUTOSTART")
        value = receive_until(client, "PARAM_VALUE", lambda m: m.param_id == "SYS_AUTOSTART")
        assert int.from_bytes(struct.pack("<f", value.param_value), "little") == 10040
        assert len(set(all_parameters(client).values())) == PARAMETERS


def all_parameters(client: Any) -> dict[int, str]:
    """Names by index. As ground stations do it: all are asked for, then again those that a full socket buffer lost."""
    names: dict[int, str] = {}
    end_s = time.monotonic() + PATIENCE_S
    client.param_fetch_all()
    while len(names) < PARAMETERS:
        assert time.monotonic() < end_s, f"{len(names)} of {PARAMETERS} parameters"
        message = client.recv_match(type="PARAM_VALUE", blocking=True, timeout=1.0)
        if message is None:
            for index in [i for i in range(PARAMETERS) if i not in names][:20]:
                client.mav.param_request_read_send(1, 1, b"", index)
        elif message.param_index < PARAMETERS:
            assert message.param_count == PARAMETERS
            names[message.param_index] = message.param_id
    return names


def test_mavutil_flies_a_square_corner_in_offboard() -> None:
    with connected() as (vehicle, client):
        client.mav.command_long_send(1, 1, 22, 0, *[float("nan")] * 7)
        client.arducopter_arm()
        receive_until(client, "EXTENDED_SYS_STATE", lambda m: m.landed_state == 3)
        receive_until(client, "LOCAL_POSITION_NED", lambda m: m.z < -1.5)

        def stream(vx: float, vy: float, reached: Callable[[], bool]) -> None:
            end_s = time.monotonic() + PATIENCE_S
            while time.monotonic() < end_s:
                client.mav.set_position_target_local_ned_send(0, 1, 1, 1, 0x5C7, 0, 0, 0, vx, vy, 0, 0, 0, 0, 0, 0)
                if reached():
                    return
                receive_until(client, "ATTITUDE_TARGET", lambda m: True)
            raise AssertionError("the vehicle did not follow")

        client.mav.set_position_target_local_ned_send(0, 1, 1, 1, 0x5C7, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0)
        client.mav.command_long_send(1, 1, 176, 0, 1, 6, 0, 0, 0, 0, 0)
        stream(2.0, 0.0, lambda: vehicle.rig.vehicle.state.x > 3.0)
        stream(0.0, 2.0, lambda: vehicle.rig.vehicle.state.y > 3.0)
        assert vehicle.rig.autopilot.mode_name == "OFFBOARD"
