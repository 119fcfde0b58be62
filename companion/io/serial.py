"""MAVLink over a serial line: `serial:///dev/ttyAMA0:921600`. Needs the extra `serial`."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from companion.io.address import Address
from companion.io.link import Link, LinkError, Receive
from companion.io.stream import StreamLink


async def open_serial(address: Address, receive: Receive) -> Link:
    try:
        import serialx
    except ImportError as error:
        raise LinkError(f"{address}: needs the extra 'serial': pip install 'companion[serial]'") from error

    async def connect(protocol: Callable[[], asyncio.Protocol]) -> asyncio.Transport:
        loop = asyncio.get_running_loop()
        transport, _ = await serialx.create_serial_connection(loop, protocol, address.place, address.number)
        return transport

    link = StreamLink(receive, connect)
    await link.open()
    return link
