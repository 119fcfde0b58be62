"""The server over real sockets on loopback, at ports the system chooses. Real time, at most a few seconds."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
import pytest
from pymavlink.dialects.v20 import common

from sitl_stub import scenario as scenarios
from sitl_stub.cli import run
from sitl_stub.external import ExternalWorld
from sitl_stub.scenario import Scenario
from sitl_stub.server import Server, ServerOptions, Status
from sitl_stub.server_link import LinkOptions
from sitl_stub.world import World

pytestmark = pytest.mark.sockets

SMALL = {
    "cameras.down.width_px": 188,
    "cameras.down.height_px": 120,
    "cameras.down.fx_px": 105.0,
    "cameras.down.fy_px": 105.0,
}


ATTEMPTS = 6
"""Of a measurement in real time: a machine that is busy with something else for a moment says nothing about the server."""


class Client(asyncio.DatagramProtocol):
    """Listens as an application does; keeps what came and from where."""

    def __init__(self) -> None:
        self.received: list[tuple[bytes, tuple[str, int]]] = []
        self.heard = asyncio.Event()

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        self.received.append((data, addr))
        self.heard.set()

    def names(self) -> set[str]:
        reader = common.MAVLink(None)
        reader.robust_parsing = True
        return {m.get_type() for data, _ in self.received for m in reader.parse_buffer(bytearray(data)) or []}


async def listen(port: int = 0) -> tuple[Client, asyncio.DatagramTransport]:
    transport, client = await asyncio.get_running_loop().create_datagram_endpoint(
        Client, local_addr=("127.0.0.1", port)
    )
    return client, transport


def small(**overrides: Any) -> Scenario:
    return scenarios.with_overrides(scenarios.load("static"), {**SMALL, **overrides})


async def serve(scenario: Scenario, remote_port: int, *, speed: float = 1.0, stop_after_s: float | None = None):
    statuses: list[Status] = []
    options = ServerOptions(
        links=(LinkOptions("onboard", 0, remote_port),), camera_port=0, speed=speed, stop_after_s=stop_after_s
    )
    server = Server(World(scenario, 1, render=False), list(scenario.cameras), options, statuses.append)
    await server.open()
    return server, statuses


async def read_part(reader: asyncio.StreamReader) -> tuple[dict[str, str], bytes]:
    headers: dict[str, str] = {}
    line = await reader.readline()
    assert line.startswith(b"--frame"), line
    while (line := (await reader.readline()).strip()) != b"":
        name, _, value = line.decode().partition(":")
        headers[name.lower()] = value.strip()
    body = await reader.readexactly(int(headers["content-length"]))
    await reader.readline()
    return headers, body


async def open_camera(port: int, path: str = "/down") -> tuple[asyncio.StreamReader, asyncio.StreamWriter, bytes]:
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    writer.write(f"GET {path} HTTP/1.1\r\nHost: x\r\n\r\n".encode())
    status = await reader.readline()
    while (await reader.readline()).strip():
        pass
    return reader, writer, status


def test_the_vehicle_speaks_first_and_answers_to_where_it_was_spoken_to_from() -> None:
    async def scene() -> None:
        first, first_transport = await listen()
        second, second_transport = await listen()
        server, _ = await serve(small(), first_transport.get_extra_info("sockname")[1], stop_after_s=2.0)
        port = server.links["onboard"].port
        running = asyncio.create_task(server.run())
        await first.heard.wait()
        assert first.received[0][1] == ("127.0.0.1", port)
        heartbeat = common.MAVLink(None, srcSystem=1, srcComponent=191).heartbeat_encode(18, 8, 0, 0, 4)
        second_transport.sendto(
            heartbeat.pack(common.MAVLink(None, srcSystem=1, srcComponent=191)), ("127.0.0.1", port)
        )
        await running
        assert {"HEARTBEAT", "LOCAL_POSITION_NED", "ATTITUDE_QUATERNION"} <= second.names()
        first_transport.close()
        second_transport.close()

    asyncio.run(scene())


def test_time_runs_at_the_speed_asked_for() -> None:
    async def scene() -> tuple[float, float]:
        server, statuses = await serve(small(), 9, speed=3.0, stop_after_s=4.5)
        loop = asyncio.get_running_loop()
        begun = loop.time()
        await server.run()
        return loop.time() - begun, statuses[0].real_time_factor

    for attempt in range(ATTEMPTS):
        elapsed_s, factor = asyncio.run(scene())
        assert elapsed_s > 1.45  # never faster, whatever else the machine does
        if elapsed_s < 1.9 or attempt == ATTEMPTS - 1:
            break
    assert elapsed_s == pytest.approx(1.5, abs=0.4)
    assert factor == pytest.approx(3.0, rel=0.25)


def test_pictures_come_with_their_capture_time_to_several_clients() -> None:
    async def scene() -> None:
        server, _ = await serve(small(), 9)
        running = asyncio.create_task(server.run())
        cameras = [await open_camera(server.camera_port) for _ in range(2)]
        for reader, writer, status in cameras:
            assert b"200" in status
            parts = [await read_part(reader) for _ in range(5)]
            times = [int(headers["x-capture-time-boot-us"]) for headers, _ in parts]
            sequences = [int(headers["x-frame-sequence"]) for headers, _ in parts]
            assert times == sorted(times)
            assert sequences == sorted(sequences)
            picture = cv2.imdecode(np.frombuffer(parts[0][1], np.uint8), cv2.IMREAD_GRAYSCALE)
            assert picture is not None
            assert picture.shape == (120, 188)
            writer.close()
        server.stop()
        await running

    asyncio.run(scene())


def test_stopping_while_a_client_watches_is_no_accident() -> None:
    async def scene() -> None:
        accidents: list[dict[str, Any]] = []
        asyncio.get_running_loop().set_exception_handler(lambda loop, context: accidents.append(context))
        server, _ = await serve(small(), 9)
        running = asyncio.create_task(server.run())
        reader, writer, _ = await open_camera(server.camera_port)
        await read_part(reader)
        server.stop()
        await running
        while await reader.read(65_536):
            pass
        writer.close()
        assert accidents == []

    asyncio.run(scene())


def test_a_client_that_does_not_read_delays_neither_the_others_nor_the_vehicle() -> None:
    async def scene() -> tuple[int, int]:
        client, transport = await listen()
        scenario = scenarios.load("static")
        server, _ = await serve(scenario, transport.get_extra_info("sockname")[1])
        running = asyncio.create_task(server.run())
        _, idle_writer, _ = await open_camera(server.camera_port)
        reader, writer, _ = await open_camera(server.camera_port)
        times = [int((await read_part(reader))[0]["x-capture-time-boot-us"]) for _ in range(40)]
        datagrams = len(client.received)
        idle_writer.close()
        writer.close()
        server.stop()
        await running
        transport.close()
        return times[-1] - times[0], datagrams

    for _ in range(ATTEMPTS):
        forty_frames_us, datagrams = asyncio.run(scene())
        if forty_frames_us < 3_000_000:
            break
    assert forty_frames_us < 3_000_000
    assert datagrams > 300


def test_the_root_lists_the_cameras_and_anything_else_is_not_found() -> None:
    async def scene() -> None:
        server, _ = await serve(small(), 9)
        running = asyncio.create_task(server.run())
        reader, writer, status = await open_camera(server.camera_port, "/")
        assert b"200" in status
        assert json.loads(await reader.read()) == {"cameras": ["/down"]}
        writer.close()
        _, writer, status = await open_camera(server.camera_port, "/up")
        assert b"404" in status
        writer.close()
        reader, writer = await asyncio.open_connection("127.0.0.1", server.camera_port)
        writer.write(b"\x00nonsense\r\n\r\n")
        assert await reader.read() == b""
        writer.close()
        server.stop()
        await running

    asyncio.run(scene())


def command(*arguments: str) -> Sequence[str]:
    ports = ["--onboard", "0:9", "--ground", "0:9", "--camera-port", "0"]
    return [sys.executable, "-m", "sitl_stub", "static", *ports, *arguments]


def test_the_program_ends_cleanly_on_interrupt_with_its_verdict() -> None:
    process = subprocess.Popen(command("--json"), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    lines = [process.stdout.readline() for _ in range(6)]
    os.kill(process.pid, signal.SIGINT)
    rest, errors = process.communicate(timeout=60)
    assert process.returncode == 0
    assert errors == ""
    assert "AUTO_LOITER" in lines[5]
    assert json.loads(rest.splitlines()[-1])["ending"] == "flying"


def test_the_end_of_a_flight_that_is_no_landing_is_exit_status_1() -> None:
    done = subprocess.run(
        command("--until-landed", "--speed", "4", "--set", "duration_limit_s=2", "--json", "--quiet"),
        capture_output=True,
        text=True,
        timeout=90,
        check=False,
    )
    assert json.loads(done.stdout)["ending"] == "timeout"
    assert done.returncode == 1


def test_a_taken_port_is_said_and_is_exit_status_3(capsys: pytest.CaptureFixture[str]) -> None:
    async def scene() -> int:
        _, transport = await listen()
        port = transport.get_extra_info("sockname")[1]
        status = await asyncio.to_thread(
            run, ["static", "--onboard", f"{port}:9", "--ground", "0:9", "--camera-port", "0"]
        )
        transport.close()
        return status

    assert asyncio.run(scene()) == 3
    assert "cannot listen" in capsys.readouterr().err


def test_help_and_list_name_what_there_is(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--list"]) == 0
    listed = capsys.readouterr().out
    assert all(name in listed for name in scenarios.names())
    with pytest.raises(SystemExit) as left:
        run(["--help"])
    assert left.value.code == 0
    text = capsys.readouterr().out
    for word in ("14540", "18570", "8554", "--vehicle", "--until-landed", "Exit status"):
        assert word in text


@pytest.mark.parametrize(
    ("arguments", "says"),
    [(["nowhere"], "nowhere"), (["--set", "wind.mean=3"], "mean_m_s"), (["--set", "wind"], "KEY=VALUE")],
)
def test_a_wrong_argument_is_said_and_is_exit_status_2(
    arguments: list[str], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(arguments) == 2
    assert says in capsys.readouterr().err


def test_a_pad_for_a_foreign_vehicle_works_over_sockets() -> None:
    async def scene() -> None:
        pad_options = ServerOptions(links=(LinkOptions("ground", 0, 9),), camera_port=0)
        pad = Server(ExternalWorld(small(), 1), ["down"], pad_options, lambda status: None)
        await pad.open()
        bare = scenarios.with_overrides(scenarios.load("static"), {"cameras": {}, "beacon.fitted": False})
        vehicle_options = ServerOptions(links=(LinkOptions("ground", 0, pad.links["ground"].port),), camera_port=0)
        vehicle = Server(World(bare, 1, render=False), [], vehicle_options, lambda status: None)
        await vehicle.open()
        tasks = [asyncio.create_task(server.run()) for server in (pad, vehicle)]
        reader, writer, _ = await open_camera(pad.camera_port)
        headers, _ = await asyncio.wait_for(read_part(reader), 60.0)
        assert int(headers["x-capture-time-boot-us"]) > 0
        writer.close()
        for server in (pad, vehicle):
            server.stop()
        await asyncio.gather(*tasks)

    asyncio.run(scene())
