"""One MAVLink link of the vehicle over UDP, as PX4 SITL has them: sends unasked to a port, then to whoever has spoken.

Received datagrams wait until the simulation takes them; a flood is dropped, oldest first.
"""

from __future__ import annotations

import asyncio
from collections import deque
from typing import cast

_LARGEST_QUEUE = 1000


class UdpLink(asyncio.DatagramProtocol):
    """`name` is "onboard" or "ground"."""

    def __init__(self, name: str, remote: tuple[str, int]) -> None:
        self.name = name
        self.remote = remote
        self.received: deque[bytes] = deque(maxlen=_LARGEST_QUEUE)
        self._transport: asyncio.DatagramTransport | None = None

    @property
    def port(self) -> int:
        """The local port that was bound."""
        assert self._transport is not None
        return int(self._transport.get_extra_info("sockname")[1])

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.DatagramTransport, transport)

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        self.remote = addr[:2]
        self.received.append(data)

    def error_received(self, exc: Exception) -> None:
        """Nobody listens at the other end yet: normal for a vehicle."""

    def send(self, data: bytes) -> None:
        if self._transport is not None and not self._transport.is_closing():
            self._transport.sendto(data, self.remote)

    def close(self) -> None:
        if self._transport is not None:
            self._transport.close()


async def open_link(name: str, local: tuple[str, int], remote: tuple[str, int]) -> UdpLink:
    """Bind; raises OSError where the port is taken."""
    loop = asyncio.get_running_loop()
    _, link = await loop.create_datagram_endpoint(lambda: UdpLink(name, remote), local_addr=local)
    return link
