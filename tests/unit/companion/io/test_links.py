"""Links over real sockets and a pseudo terminal: bytes arrive whole, peers are learned, broken streams come back."""

from __future__ import annotations

import asyncio
import os
import pty
import socket
import tty

import pytest

from companion.io.address import Address, parse_address
from companion.io.link import LinkError
from companion.io.links import LINKS, open_link

pytestmark = pytest.mark.sockets
PATIENCE_S = 5.0


def free_udp_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Inbox:
    """Collects what a link receives and wakes whoever waits for it."""

    def __init__(self) -> None:
        self.data: asyncio.Queue[bytes] = asyncio.Queue()

    def __call__(self, data: bytes) -> None:
        self.data.put_nowait(data)

    async def bytes_of_length(self, length: int) -> bytes:
        collected = b""
        async with asyncio.timeout(PATIENCE_S):
            while len(collected) < length:
                collected += await self.data.get()
        return collected


def test_udpin_answers_the_peer_that_spoke_first() -> None:
    async def scenario() -> tuple[bytes, bytes, int]:
        port, here, there = free_udp_port(), Inbox(), Inbox()
        async with (
            open_link(f"udpin://127.0.0.1:{port}", here) as waiting,
            open_link(f"udpout://127.0.0.1:{port}", there) as speaking,
        ):
            waiting.send(b"nobody yet")
            speaking.send(b"hello")
            heard = await here.bytes_of_length(5)
            waiting.send(b"welcome")
            return heard, await there.bytes_of_length(7), waiting.counters.unsent

    assert asyncio.run(scenario()) == (b"hello", b"welcome", 1)


def test_udpin_answers_autopilot_and_beacon_on_two_ports() -> None:
    async def scenario() -> tuple[bytes, bytes]:
        port, here, first, second = free_udp_port(), Inbox(), Inbox(), Inbox()
        async with (
            open_link(f"udpin://127.0.0.1:{port}", here) as waiting,
            open_link(f"udpout://127.0.0.1:{port}", first) as autopilot,
            open_link(f"udpout://127.0.0.1:{port}", second) as beacon,
        ):
            autopilot.send(b"a")
            beacon.send(b"b")
            await here.bytes_of_length(2)
            waiting.send(b"setpoint")
            return await first.bytes_of_length(8), await second.bytes_of_length(8)

    assert asyncio.run(scenario()) == (b"setpoint", b"setpoint")


def test_udpout_survives_that_nobody_listens() -> None:
    async def scenario() -> bytes:
        port, here, there = free_udp_port(), Inbox(), Inbox()
        async with open_link(f"udpout://127.0.0.1:{port}", there) as speaking:
            for _ in range(3):
                speaking.send(b"lost")
                await asyncio.sleep(0)
            async with open_link(f"udpin://127.0.0.1:{port}", here):
                speaking.send(b"found")
                return await here.bytes_of_length(5)

    assert asyncio.run(scenario()) == b"found"


def test_tcp_comes_back_after_the_server_dropped_it() -> None:
    async def scenario() -> tuple[bytes, bytes, int, int]:
        connections: asyncio.Queue[tuple[asyncio.StreamReader, asyncio.StreamWriter]] = asyncio.Queue()

        async def accept(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            connections.put_nowait((reader, writer))

        server = await asyncio.start_server(accept, "127.0.0.1", 0)
        port, inbox = server.sockets[0].getsockname()[1], Inbox()
        async with open_link(f"tcp://127.0.0.1:{port}", inbox) as link, asyncio.timeout(PATIENCE_S):
            reader, writer = await connections.get()
            link.send(b"one")
            first = await reader.readexactly(3)
            writer.close()
            reader, writer = await connections.get()
            writer.write(b"two")
            second = await inbox.bytes_of_length(3)
            counters = link.counters
        writer.close()
        server.close()
        return first, second, counters.errors, counters.reconnects

    assert asyncio.run(scenario()) == (b"one", b"two", 1, 1)


def test_serial_line_carries_every_byte_value_both_ways() -> None:
    every_byte = bytes(range(256))

    async def scenario() -> tuple[bytes, bytes]:
        master, slave = pty.openpty()
        tty.setraw(master)
        inbox = Inbox()
        try:
            async with open_link(f"serial://{os.ttyname(slave)}:921600", inbox) as link:
                os.write(master, every_byte)
                received = await inbox.bytes_of_length(256)
                link.send(every_byte)
                async with asyncio.timeout(PATIENCE_S):
                    sent = b""
                    while len(sent) < 256:
                        sent += await asyncio.to_thread(os.read, master, 256)
                return received, sent
        finally:
            os.close(master)
            os.close(slave)

    assert asyncio.run(scenario()) == (every_byte, every_byte)


@pytest.mark.parametrize(
    ("url", "what"),
    [
        ("http://127.0.0.1:1", "a link is one of"),
        ("udpin:127.0.0.1:14540", "a link is one of"),
        ("udpin://127.0.0.1", "must be written like udpin://127.0.0.1:14540"),
        ("udpin://127.0.0.1:x", "must be written like"),
        ("udpout://127.0.0.1:70000", "not in 1..65535"),
        ("serial:///dev/ttyAMA0", "must be written like serial:///dev/ttyAMA0:921600"),
        ("serial:///dev/companion-has-no-such-line:57600", "cannot be opened"),
        ("tcp://127.0.0.1:1", "cannot be opened"),
    ],
)
def test_a_link_that_cannot_be_opened_says_why(url: str, what: str) -> None:
    async def scenario() -> None:
        async with open_link(url, Inbox()):
            pass

    with pytest.raises(LinkError, match=what):
        asyncio.run(scenario())


def test_addresses_keep_device_paths_and_ipv6_hosts() -> None:
    assert parse_address("serial:///dev/ttyAMA0:921600", LINKS) == Address("serial", "/dev/ttyAMA0", 921600)
    assert parse_address("udpin://[::1]:14540", LINKS) == Address("udpin", "::1", 14540)
