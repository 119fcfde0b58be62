"""The other end of the wire for session tests: pymavlink encodes and decodes, so that our codec is not its own judge."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import development as mav

from companion.config import Link
from companion.mavlink.session import Session

MS = 1_000_000
SECOND = 1_000_000_000
START_NS = 1_000 * SECOND
OFFBOARD, HOLD, LAND, RETURN = 6 << 16, 4 << 16 | 3 << 24, 4 << 16 | 6 << 24, 4 << 16 | 5 << 24


class Wire:
    """A session and a hand-driven autopilot that share one clock."""

    def __init__(self, **link: Any) -> None:
        self.now_ns = START_NS
        self.session = Session(Link(**link), START_NS)
        self.inputs: list[Any] = []
        self.sent: list[Any] = []
        self.boot_minus_companion_ns = -990 * SECOND
        self._encoders: dict[tuple[int, int], Any] = {}
        self._decoder = mav.MAVLink(None)
        self._decoder.robust_parsing = True

    @property
    def boot_ms(self) -> int:
        return (self.now_ns + self.boot_minus_companion_ns) // MS

    def bytes_of(self, message: Any, system: int = 1, component: int = 1) -> bytes:
        encoder = self._encoders.setdefault((system, component), mav.MAVLink(None, system, component))
        packed = bytes(message.pack(encoder))
        encoder.seq = (encoder.seq + 1) % 256
        return packed

    def deliver(self, message: Any, system: int = 1, component: int = 1) -> list[Any]:
        return self.deliver_bytes(self.bytes_of(message, system, component))

    def deliver_bytes(self, data: bytes) -> list[Any]:
        inputs = self.session.receive_datagram(data, self.now_ns)
        self.inputs += inputs
        self.collect()
        return inputs

    def collect(self) -> list[Any]:
        """What the session has sent since the last time, decoded by pymavlink."""
        fresh = [self._decoder.decode(bytearray(frame)) for frame in self.session.datagrams_to_send()]
        self.sent += fresh
        return fresh

    def run_timers(self) -> list[Any]:
        """Everything the session does now; what it sent is in `sent`."""
        self.inputs += (inputs := self.session.handle_timer(self.now_ns))
        self.collect()
        return inputs

    def advance(self, milliseconds: float) -> list[Any]:
        """Let time pass, calling the session whenever it wants to be called."""
        end_ns, inputs = self.now_ns + round(milliseconds * MS), []
        while (due_ns := self.session.next_timer_ns()) is not None and due_ns <= end_ns:
            self.now_ns = max(self.now_ns, due_ns)
            inputs += self.run_timers()
        self.now_ns = end_ns
        return inputs

    def heartbeat(self, custom_mode: int = HOLD, *, armed: bool = False, status: int = 3) -> list[Any]:
        base_mode = 0x1D | (0x80 if armed else 0)
        return self.deliver(mav.MAVLink_heartbeat_message(2, 12, base_mode, custom_mode, status, 3))

    def current_mode(self, custom_mode: int, intended: int | None = None) -> list[Any]:
        return self.deliver(mav.MAVLink_current_mode_message(0, custom_mode, intended or custom_mode))

    def ack(self, command: int, result: int = 0) -> list[Any]:
        return self.deliver(mav.MAVLink_command_ack_message(command, result, 0, 0, 1, 191))

    def commands(self, command: int) -> list[Any]:
        """COMMAND_LONGs with this MAV_CMD sent so far."""
        return [m for m in self.sent if m.get_type() == "COMMAND_LONG" and m.command == command]

    def of_type(self, name: str) -> list[Any]:
        """Sent messages of this MAVLink name."""
        return [m for m in self.sent if m.get_type() == name]

    def received(self, kind: type) -> list[Any]:
        """Messages of the vocabulary that came out so far."""
        return [m for m in self.inputs if isinstance(m, kind)]


@pytest.fixture
def wire() -> Wire:
    """A fresh session that has heard nothing."""
    return Wire()


@pytest.fixture
def connected() -> Wire:
    """A session that has heard one heartbeat of a disarmed vehicle in Hold."""
    fresh = Wire()
    fresh.heartbeat()
    fresh.run_timers()
    return fresh


@pytest.fixture
def make_wire() -> Callable[..., Wire]:
    """For sessions with another link configuration."""
    return Wire
