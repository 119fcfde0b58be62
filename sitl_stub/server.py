"""The shell around a simulation: MAVLink over UDP, cameras over HTTP, real time or a multiple of it.

Everything runs on one asyncio loop but the rendering of pictures, which has a thread. The simulation goes on in steps of
4 ms, few at a time, so that sockets are served in between; time that the machine cannot keep up with is given up and
said, not caught up in a burst. Binds loopback unless told otherwise. Used by cli.py and by tests.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import monotonic
from typing import Protocol

from sitl_stub.datagram_faults import Datagram
from sitl_stub.frame_worker import FrameWorker
from sitl_stub.mjpeg import CameraServer
from sitl_stub.pacing import Pace
from sitl_stub.server_link import PX4_LINKS, LinkOptions
from sitl_stub.udp_link import UdpLink, open_link
from sitl_stub.verdict import Verdict
from sitl_stub.world import STEP_S, STEP_US, StepOutput, Truth

_STEPS_A_TURN = 5
_STATUS_PERIOD_S = 1.0


class Simulation(Protocol):
    """What the server drives: a World, or an ExternalWorld."""

    t_us: int

    def step(self, dt_s: float, datagrams_in: Sequence[Datagram] = ()) -> StepOutput: ...
    def truth(self) -> Truth: ...
    def verdict(self) -> Verdict: ...


@dataclass(frozen=True, slots=True)
class ServerOptions:
    """Where the server listens and how fast time goes."""

    host: str = "127.0.0.1"
    """Address to bind, for links and cameras."""
    remote_host: str = "127.0.0.1"
    links: tuple[LinkOptions, ...] = PX4_LINKS
    camera_port: int = 8554
    speed: float = 1.0
    jpeg_quality: int = 92
    until_landed: bool = False
    """Stop when the flight has ended (verdict), not only when told to."""
    stop_after_s: float | None = None
    """Simulated time after which to stop."""


@dataclass(frozen=True, slots=True)
class Status:
    """What a person wants to see once a second."""

    truth: Truth
    verdict: Verdict
    real_time_factor: float
    given_up_s: float
    frames_dropped: int


class Server:
    """Runs one simulation until `stop` is called, its time is up, or the flight has ended and that was asked for."""

    def __init__(
        self,
        simulation: Simulation,
        cameras: Sequence[str],
        options: ServerOptions,
        on_status: Callable[[Status], None],
    ) -> None:
        self._simulation = simulation
        self._options = options
        self._on_status = on_status
        self._http = CameraServer(cameras)
        self._frames = FrameWorker(self._http.publish, options.jpeg_quality)
        self._links: dict[str, UdpLink] = {}
        self._stopping = False
        self.camera_port = options.camera_port

    @property
    def links(self) -> dict[str, UdpLink]:
        """Open links by name (for tests that let the system choose ports)."""
        return self._links

    def stop(self) -> None:
        """Finish the turn and return from `run`."""
        self._stopping = True

    async def open(self) -> None:
        """Bind all ports; OSError where one is taken."""
        o = self._options
        try:
            for link in o.links:
                remote = (o.remote_host, link.remote_port)
                self._links[link.name] = await open_link(link.name, (o.host, link.local_port), remote)
            self.camera_port = await self._http.start(o.host, o.camera_port)
        except OSError:
            await self.close()
            raise

    async def run(self) -> Verdict:
        """Serve until stopped; the verdict as it is then. `open` first."""
        try:
            await self._go()
        finally:
            await self.close()
        return self._simulation.verdict()

    async def close(self) -> None:
        await self._http.stop()
        for link in self._links.values():
            link.close()
        self._frames.close()

    async def _go(self) -> None:
        simulation = self._simulation
        pace = Pace(self._options.speed, monotonic(), simulation.t_us)
        status_s, status_us = monotonic(), simulation.t_us
        while not self._is_done():
            self._turn(pace.target_us(monotonic(), simulation.t_us))
            await asyncio.sleep(pace.wait_s(monotonic(), simulation.t_us + STEP_US))
            elapsed_s = monotonic() - status_s
            if elapsed_s >= _STATUS_PERIOD_S:
                factor = (simulation.t_us - status_us) * 1e-6 / elapsed_s
                self._report(factor, pace.given_up_s)
                status_s, status_us = status_s + elapsed_s, simulation.t_us

    def _is_done(self) -> bool:
        o = self._options
        if self._stopping:
            return True
        if o.stop_after_s is not None and self._simulation.t_us >= o.stop_after_s * 1e6:
            return True
        return o.until_landed and self._simulation.verdict().is_over

    def _turn(self, target_us: int) -> None:
        """At most a few steps towards the target; the sockets are served after them."""
        simulation = self._simulation
        for _ in range(_STEPS_A_TURN):
            if simulation.t_us + STEP_US > target_us:
                break
            self._dispatch(simulation.step(STEP_S, self._received()))
        self._frames.publish_due(simulation.t_us)

    def _received(self) -> list[Datagram]:
        datagrams = []
        for name, link in self._links.items():
            while link.received:
                datagrams.append(Datagram(name, link.received.popleft()))
        return datagrams

    def _dispatch(self, output: StepOutput) -> None:
        for datagram in output.datagrams:
            link = self._links.get(datagram.link)
            if link is not None:
                link.send(datagram.data)
        for capture in output.captures:
            if self._http.is_watched(capture.channel.name):
                self._frames.take(capture)

    def _report(self, real_time_factor: float, given_up_s: float) -> None:
        s = self._simulation
        self._on_status(Status(s.truth(), s.verdict(), real_time_factor, given_up_s, self._frames.dropped))
