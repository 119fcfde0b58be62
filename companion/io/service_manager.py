"""What systemd wants to know of a service of Type=notify: ready, alive, stopping. Datagrams to the socket in NOTIFY_SOCKET.

A sink of the live app. It says WATCHDOG=1 only when ticks of the control loop have been handled: a hung or starved loop falls
silent, systemd ends the program, and the autopilot's own failsafe has the vehicle by then. It has no timer of its own on
purpose. Nothing here blocks or raises: a service manager that does not listen is no reason not to fly.
"""

from __future__ import annotations

import os
import socket
from collections.abc import Mapping, Sequence
from contextlib import suppress

from companion.messages import PhaseChanged, Tick
from companion.onboard import JournalEntry

SIGNS_PER_TIMEOUT = 4


class ServiceManager:
    """State: the socket, whether READY has been said, and when the last sign of life was."""

    def __init__(self, address: str, *, timeout_us: int | None) -> None:
        """`timeout_us` is systemd's WatchdogSec in microseconds, None without a watchdog."""
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._period_ns = None if timeout_us is None else timeout_us * 1000 // SIGNS_PER_TIMEOUT
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
        self._socket.setblocking(False)
        self._is_ready = False
        self._sign_due_ns = 0

    def datagram(self, now_ns: int, data: bytes, *, outgoing: bool) -> None:
        pass

    def journal(self, entries: Sequence[JournalEntry]) -> None:
        for entry in entries:
            if isinstance(entry.message, Tick):
                self._alive(entry.arrived_ns)
            elif isinstance(entry.message, PhaseChanged):
                self._say(f"STATUS={entry.message.after}: {entry.message.reason}")

    def close(self) -> None:
        self._say("STOPPING=1")
        self._socket.close()

    def _alive(self, now_ns: int) -> None:
        if not self._is_ready:
            self._is_ready = True
            self._say("READY=1\nSTATUS=idle: waiting for start")
        if self._period_ns is not None and now_ns >= self._sign_due_ns:
            self._sign_due_ns = now_ns + self._period_ns
            self._say("WATCHDOG=1")

    def _say(self, text: str) -> None:
        with suppress(OSError):
            self._socket.sendto(text.encode(), self._address)


def service_manager(environment: Mapping[str, str] | None = None) -> ServiceManager | None:
    """The one that started this process and asked to be told; None without."""
    environment = os.environ if environment is None else environment
    address = environment.get("NOTIFY_SOCKET", "")
    if not address.startswith(("/", "@")):
        return None
    timeout = environment.get("WATCHDOG_USEC", "")
    is_meant = environment.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
    return ServiceManager(address, timeout_us=int(timeout) if timeout.isdecimal() and is_meant else None)
