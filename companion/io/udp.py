"""MAVLink over UDP. `udpin` binds and answers everybody it has heard lately; `udpout` speaks to one address.

Several senders behind one port are normal (autopilot and the pad's beacon on different radios); MAVLink addresses by
system id, so each hears everything.
"""

from __future__ import annotations

import asyncio
import time
from typing import Any

from companion.io.address import Address
from companion.io.link import Link, LinkCounters, Receive

MOST_PEERS = 4
PEER_FORGOTTEN_S = 10.0


class UdpLink(asyncio.DatagramProtocol):
    """One socket. `fixed_peer` None means: learn peers."""

    def __init__(self, receive: Receive, fixed_peer: tuple[str, int] | None) -> None:
        self.counters = LinkCounters()
        self._receive = receive
        self._fixed_peer = fixed_peer
        self._heard_s: dict[Any, float] = {}
        self._transport: asyncio.DatagramTransport | None = None
        self._closed: asyncio.Future[None] = asyncio.get_running_loop().create_future()

    def connection_made(self, transport: asyncio.DatagramTransport) -> None:  # type: ignore[override]
        self._transport = transport

    def datagram_received(self, data: bytes, addr: Any) -> None:
        self.counters.received += 1
        self.counters.bytes_received += len(data)
        if self._fixed_peer is None:
            self._learn(addr)
        self._receive(data)

    def _learn(self, peer: Any) -> None:
        now_s = time.monotonic()
        self._heard_s[peer] = now_s
        if len(self._heard_s) > 1:
            self._heard_s = {p: t for p, t in self._heard_s.items() if now_s - t < PEER_FORGOTTEN_S}
        while len(self._heard_s) > MOST_PEERS:
            del self._heard_s[min(self._heard_s, key=self._heard_s.__getitem__)]

    def send(self, frame: bytes) -> None:
        peers = [None] if self._fixed_peer is not None else list(self._heard_s)
        if self._transport is None or self._transport.is_closing() or not peers:
            self.counters.unsent += 1
            return
        for peer in peers:
            self._transport.sendto(frame, peer)
        self.counters.sent += 1
        self.counters.bytes_sent += len(frame)

    def error_received(self, exc: Exception) -> None:
        """Nobody listens there (yet), no route: UDP goes on."""
        self.counters.errors += 1

    def connection_lost(self, exc: Exception | None) -> None:
        if not self._closed.done():
            self._closed.set_result(None)

    async def close(self) -> None:
        if self._transport is not None:
            self._transport.close()
            await self._closed

    @property
    def port(self) -> int:
        """The local port."""
        assert self._transport is not None
        return int(self._transport.get_extra_info("sockname")[1])


async def open_udp_in(address: Address, receive: Receive) -> Link:
    link = UdpLink(receive, None)
    loop = asyncio.get_running_loop()
    await loop.create_datagram_endpoint(lambda: link, local_addr=(address.place, address.number))
    return link


async def open_udp_out(address: Address, receive: Receive) -> Link:
    peer = (address.place, address.number)
    link = UdpLink(receive, peer)
    await asyncio.get_running_loop().create_datagram_endpoint(lambda: link, remote_addr=peer)
    return link
