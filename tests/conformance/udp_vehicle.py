"""The rig's vehicle behind a real UDP socket, faster than real time, in a background thread: for clients that can't be driven in lockstep."""

from __future__ import annotations

import select
import socket
import threading
import time
from types import TracebackType

from px4_rig import DT_US, Rig

_MOST_STEPS_AT_ONCE = 50


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class UdpVehicle:
    """Sends to `client_port` unasked, as PX4 does; `with` starts and stops it."""

    def __init__(self, client_port: int, *, link: str = "onboard", speed: float = 4.0, rig: Rig | None = None) -> None:
        self.rig = Rig(options={"ground_link": link == "ground"}) if rig is None else rig
        self.rig.quiet = True
        self._link = link
        self._speed = speed
        self._peer = ("127.0.0.1", client_port)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.setblocking(False)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def __enter__(self) -> UdpVehicle:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop.set()
        self._thread.join(5.0)
        self._socket.close()

    def _serve(self) -> None:
        start_s = time.monotonic()
        offset_us = self.rig.t_us
        while not self._stop.is_set():
            self._receive()
            wanted_us = offset_us + (time.monotonic() - start_s) * self._speed * 1e6
            steps = min(int((wanted_us - self.rig.t_us) / DT_US), _MOST_STEPS_AT_ONCE)
            for _ in range(steps):
                self.rig.step()
            self._send()
            if steps == _MOST_STEPS_AT_ONCE:  # behind: do not run after the lost time
                start_s, offset_us = time.monotonic(), self.rig.t_us

    def _receive(self) -> None:
        ready, _, _ = select.select([self._socket], [], [], 0.002)
        while ready:
            try:
                data, address = self._socket.recvfrom(2048)
            except (BlockingIOError, ConnectionRefusedError):
                return
            self._peer = address
            self.rig.autopilot.receive(self._link, data, self.rig.t_us)

    def _send(self) -> None:
        for _, link, data in self.rig.raw:
            if link == self._link:
                try:
                    self._socket.sendto(data, self._peer)
                except (BlockingIOError, ConnectionRefusedError):
                    continue
        self.rig.raw.clear()
