"""What every link to an autopilot offers, whatever carries the bytes. Implementations are registered in links.py."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

Receive = Callable[[bytes], None]
"""Called on the event loop with each datagram, or piece of a stream, the moment it is read."""


class LinkError(OSError):
    """The link cannot be opened. The text says which address and what to do."""


@dataclass(slots=True)
class LinkCounters:
    """Traffic since opening. `unsent` counts frames for which there was no peer, or the system refused them."""

    received: int = 0
    bytes_received: int = 0
    sent: int = 0
    bytes_sent: int = 0
    unsent: int = 0
    errors: int = 0
    reconnects: int = 0


class Link(Protocol):
    """An open link. `send` never blocks and never raises for what the peer or the network does."""

    @property
    def counters(self) -> LinkCounters: ...

    def send(self, frame: bytes) -> None: ...

    async def close(self) -> None: ...
