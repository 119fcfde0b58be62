"""The same bytes through MAVSDK: `mavsdk+udpin://0.0.0.0:14540`, `mavsdk+serial://…`.

MAVSDK owns the connection and routes between it and an in-process `raw://` connection, which is ours: the session speaks
MAVLink through it exactly as through a socket of its own, beside whatever else uses MAVSDK in this process. None of its
plugins is created. That matters: its Offboard plugin re-sends the last setpoint from a thread of its own for ever, so that a
hung program would fly on; here a setpoint leaves once, when the session sends it, and silence reaches the autopilot.
MAVSDK calls back on its own thread; the bytes are handed to the event loop in order. It heartbeats as component 195.
"""

from __future__ import annotations

import asyncio
import logging

from mavsdk import ComponentType, Configuration, ForwardingOption, Mavsdk
from mavsdk.connection_result import ConnectionResult
from mavsdk.logging import log_subscribe

from companion.io.address import Address
from companion.io.link import Link, LinkCounters, LinkError, Receive

PREFIX = "mavsdk+"
_THEIR_SCHEMES = {"tcp": "tcpout"}
_log = logging.getLogger("mavsdk")


class MavsdkLink:
    """One MAVSDK instance with two connections and forwarding between them."""

    def __init__(self, receive: Receive, mavsdk: Mavsdk) -> None:
        self.counters = LinkCounters()
        self._receive = receive
        self._mavsdk = mavsdk
        self._loop = asyncio.get_running_loop()
        self._open = True

    def heard_on_their_thread(self, data: bytes) -> None:
        if self._open:
            self._loop.call_soon_threadsafe(self._heard, data)

    def _heard(self, data: bytes) -> None:
        if self._open:
            self.counters.received += 1
            self.counters.bytes_received += len(data)
            self._receive(data)

    def send(self, frame: bytes) -> None:
        if not self._open:
            self.counters.unsent += 1
            return
        self._mavsdk.pass_received_raw_bytes(frame)
        self.counters.sent += 1
        self.counters.bytes_sent += len(frame)

    async def close(self) -> None:
        self._open = False
        await asyncio.to_thread(self._mavsdk.destroy)  # waits for their threads


async def open_mavsdk(address: Address, receive: Receive) -> Link:
    log_subscribe(_to_our_log)
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.COMPANION_COMPUTER))
    link = MavsdkLink(receive, mavsdk)
    scheme = address.scheme.removeprefix(PREFIX)
    url = f"{_THEIR_SCHEMES.get(scheme, scheme)}://{address.place}:{address.number}"
    try:
        _add(mavsdk, "raw://")
        mavsdk.subscribe_raw_bytes_to_be_sent(link.heard_on_their_thread)
        _add(mavsdk, url)
    except LinkError:
        await link.close()
        raise
    return link


def _add(mavsdk: Mavsdk, url: str) -> None:
    result = mavsdk.add_any_connection_with_forwarding(url, ForwardingOption.ON)
    if result != ConnectionResult.SUCCESS:
        raise LinkError(f"MAVSDK says {result.name.lower()} for {url}")


def _to_our_log(level: object, message: str, _file: str | None, _line: int) -> bool:
    """True: MAVSDK prints nothing itself."""
    _log.debug("%s", message)
    return True
