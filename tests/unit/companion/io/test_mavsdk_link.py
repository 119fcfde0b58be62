"""The link through MAVSDK behaves like the plain one, and its setpoint thread stays away."""

from __future__ import annotations

import asyncio
from collections import Counter

import pytest

from companion.io.link import LinkError
from companion.io.links import open_link
from companion.mavlink import codec, dialect
from companion.mavlink.framing import FrameSplitter

pytestmark = pytest.mark.sockets
PATIENCE_S = 10.0
HUNG_S = 1.2
"""Longer than PX4's COM_OF_LOSS_T of 1 s."""


class Listener:
    """Counts messages by (id, system, component) and wakes whoever waits for one."""

    def __init__(self) -> None:
        self.seen: Counter[tuple[int, int, int]] = Counter()
        self._splitter = FrameSplitter(codec.frame_is_valid, stream=False)
        self._news = asyncio.Event()

    def __call__(self, data: bytes) -> None:
        for frame in self._splitter.split(data):
            self.seen[codec.message_id(frame), frame[5], frame[6]] += 1
        self._news.set()

    async def until(self, key: tuple[int, int, int], count: int) -> None:
        async with asyncio.timeout(PATIENCE_S):
            while self.seen[key] < count:
                self._news.clear()
                await self._news.wait()


def setpoint(i: int) -> bytes:
    values = (i, 0.0, 0.0, 0.0, 1.0, 2.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.5, 1479, 1, 1, 1)
    return codec.encode(dialect.SetPositionTargetLocalNed(*values), i, 1, 191)


def test_bytes_pass_both_ways_and_a_hung_program_is_silent(unused_udp_port: int) -> None:
    async def scenario() -> tuple[Counter[tuple[int, int, int]], Counter[tuple[int, int, int]]]:
        ours, autopilot = Listener(), Listener()
        url = f"127.0.0.1:{unused_udp_port}"
        async with (
            open_link(f"mavsdk+udpin://{url}", ours) as link,
            open_link(f"udpout://{url}", autopilot) as vehicle,
        ):
            vehicle.send(codec.encode(dialect.Heartbeat(50593792, 2, 12, 157, 4), 0, 1, 1))
            vehicle.send(codec.encode(dialect.CurrentMode(50593792, 50593792, 0), 1, 1, 1))
            await ours.until((0, 1, 1), 1)
            await ours.until((436, 1, 1), 1)
            for i in range(5):
                link.send(setpoint(i))
            await autopilot.until((84, 1, 191), 5)
            await asyncio.sleep(HUNG_S)  # the program hangs; only MAVSDK's threads run
            return ours.seen, autopilot.seen

    ours, autopilot = asyncio.run(scenario())
    assert autopilot[84, 1, 191] == 5
    assert sum(count for (message_id, _, _), count in autopilot.items() if message_id == 84) == 5
    assert ours[0, 1, 1] == 1


def test_an_address_that_mavsdk_cannot_open_is_an_error() -> None:
    async def scenario() -> None:
        async with open_link("mavsdk+serial:///dev/companion-has-no-such-line:57600", Listener()):
            pass

    with pytest.raises(LinkError, match="MAVSDK says"):
        asyncio.run(scenario())
