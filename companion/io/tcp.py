"""MAVLink over TCP as a client: `tcp://host:port`."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from companion.io.address import Address
from companion.io.link import Link, Receive
from companion.io.stream import StreamLink


async def open_tcp(address: Address, receive: Receive) -> Link:
    async def connect(protocol: Callable[[], asyncio.Protocol]) -> asyncio.Transport:
        loop = asyncio.get_running_loop()
        transport, _ = await loop.create_connection(protocol, address.place, address.number)
        return transport

    link = StreamLink(receive, connect)
    await link.open()
    return link
