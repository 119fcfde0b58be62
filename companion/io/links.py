"""Open a link by its URL. One line in LINKS for each scheme.

udpin://0.0.0.0:14540            wait there; answer whoever speaks
udpout://192.168.1.10:14550      speak first
tcp://127.0.0.1:5760
serial:///dev/ttyAMA0:921600
mavsdk+udpin://0.0.0.0:14540     the same bytes through MAVSDK
"""

from __future__ import annotations

from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager

from companion.io.address import Address, parse_address
from companion.io.link import Link, LinkError, Receive
from companion.io.serial import open_serial
from companion.io.tcp import open_tcp
from companion.io.udp import open_udp_in, open_udp_out


async def _open_mavsdk(address: Address, receive: Receive) -> Link:
    """Its library is loaded when somebody asks for it: 19 MB and five threads."""
    from companion.io.mavsdk_link import open_mavsdk

    return await open_mavsdk(address, receive)


LINKS: dict[str, Callable[[Address, Receive], Awaitable[Link]]] = {
    "udpin": open_udp_in,
    "udpout": open_udp_out,
    "tcp": open_tcp,
    "serial": open_serial,
    "mavsdk+udpin": _open_mavsdk,
    "mavsdk+udpout": _open_mavsdk,
    "mavsdk+tcp": _open_mavsdk,
    "mavsdk+serial": _open_mavsdk,
}


@asynccontextmanager
async def open_link(url: str, receive: Receive) -> AsyncIterator[Link]:
    """The link while the block runs; `receive` gets the bytes. LinkError says what is wrong with the URL or the place."""
    address = parse_address(url, LINKS)
    try:
        link = await LINKS[address.scheme](address, receive)
    except OSError as error:
        raise LinkError(f"{url}: cannot be opened: {error.strerror or error}") from error
    try:
        yield link
    finally:
        await link.close()
