"""A link over a byte stream that comes back by itself: what TCP and serial lines share.

While the stream is away frames are dropped and counted, never kept: an old setpoint is worse than none.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import suppress

from companion.io.link import LinkCounters, Receive

FIRST_PAUSE_S = 0.2
LONGEST_PAUSE_S = 5.0
MOST_UNSENT_BYTES = 4096
"""More than this waiting means a line that cannot keep up; about 50 ms at 921600 baud."""

Connect = Callable[[Callable[[], asyncio.Protocol]], Awaitable[asyncio.Transport]]


class StreamLink(asyncio.Protocol):
    """One connection at a time, reopened by `connect` with growing pauses when it breaks."""

    def __init__(self, receive: Receive, connect: Connect) -> None:
        self.counters = LinkCounters()
        self._receive = receive
        self._connect = connect
        self._transport: asyncio.Transport | None = None
        self._broken = asyncio.Event()
        self._keeper: asyncio.Task[None] | None = None

    async def open(self) -> None:
        """The first connection must succeed: a wrong address is an error at the start."""
        self._transport = await self._connect(lambda: self)
        self._keeper = asyncio.get_running_loop().create_task(self._keep_open())

    def data_received(self, data: bytes) -> None:
        self.counters.received += 1
        self.counters.bytes_received += len(data)
        self._receive(data)

    def connection_lost(self, exc: Exception | None) -> None:
        self._transport = None
        self._broken.set()

    def send(self, frame: bytes) -> None:
        transport = self._transport
        if transport is None or transport.is_closing() or transport.get_write_buffer_size() > MOST_UNSENT_BYTES:
            self.counters.unsent += 1
            return
        transport.write(frame)
        self.counters.sent += 1
        self.counters.bytes_sent += len(frame)

    async def _keep_open(self) -> None:
        while True:
            await self._broken.wait()
            self._broken.clear()
            self.counters.errors += 1
            await self._reopen()

    async def _reopen(self) -> None:
        pause_s = FIRST_PAUSE_S
        while self._transport is None:
            await asyncio.sleep(pause_s)
            pause_s = min(2.0 * pause_s, LONGEST_PAUSE_S)
            with suppress(OSError):
                self._transport = await self._connect(lambda: self)
                self.counters.reconnects += 1

    async def close(self) -> None:
        if self._keeper is not None:
            self._keeper.cancel()
            with suppress(asyncio.CancelledError):
                await self._keeper
        if self._transport is not None:
            self._transport.close()
            await self._broken.wait()
