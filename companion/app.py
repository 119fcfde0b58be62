"""The live shell: sockets, camera, clock, terminal, files around the onboard program. It decides nothing.

Tasks (one TaskGroup): timers (session deadlines and the 50 Hz tick), one reader per camera, the detector worker (newest
frame wins; drops are counted), the sinks. Datagrams are handled in the socket's own callback. If any of this fails, nothing is
sent any more and the autopilot's offboard-loss failsafe acts: no task here re-sends anything.
"""

from __future__ import annotations

import asyncio
import contextlib
import gc
import signal
import time
from array import array
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from rich.console import Console
from rich.live import Live

from companion.config import Config
from companion.io.cameras import CameraError, CameraFrame, CaptureClock, frames
from companion.io.link import Link
from companion.io.links import open_link
from companion.io.mcap_log import FrameSink, LogOrigin, McapWriter
from companion.io.run_folder import RunFolder, versions
from companion.io.service_manager import service_manager
from companion.io.side_thread import Ask
from companion.io.signing_key import signing_of
from companion.io.tlog import TlogWriter
from companion.messages import (
    Health,
    Image,
    Message,
    OperatorAction,
    OperatorCommand,
    PadBeacon,
    PadNotSeen,
    Phase,
    VelocitySetpoint,
)
from companion.onboard import JournalEntry, Onboard
from companion.services import services_of
from companion.telemetry.flight_record import FlightRecord
from companion.telemetry.live_view import LiveView
from companion.telemetry.report import picture, report_html
from companion.trouble import Trouble
from companion.vision import Detection
from companion.vision.frame_watch import ArrivalWatch
from companion.vision_worker import VisionWorker

SPIN_NS = 1_000_000
"""The event loop wakes up to a millisecond late; the last one before a deadline is polled."""

HOLD_GRACE_S = 2.0
"""After Ctrl-C: time for the request for Hold to be answered."""

LINGER_S = 1.0
RECONNECT_S = 1.0
WATCH_S = 0.1
START_GRACE_NS = 3_000_000_000
"""Before a camera that never sent a frame counts as dead: opening one takes a second or two."""

REDRAW_S = 0.15


class LiveSink(Protocol):
    """Somebody who watches; must not block."""

    def datagram(self, now_ns: int, data: bytes, *, outgoing: bool) -> None: ...

    def journal(self, entries: Sequence[JournalEntry]) -> None: ...

    def close(self) -> None: ...


@runtime_checkable
class LiveService(LiveSink, Protocol):
    """A sink that also asks, from a thread of its own: broker, page."""

    def start(self, ask: Ask) -> None: ...


@dataclass(slots=True)
class LiveCounters:
    """What the shell saw. `setpoint_sent_ns` is kept for the timing report."""

    frames: int = 0
    frames_with_pad: int = 0
    frames_dropped: int = 0
    first_sight_ns: int | None = None
    started_ns: int | None = None
    """The first START, by whomever."""
    setpoint_sent_ns: array[int] = field(default_factory=lambda: array("q"))
    frame_to_setpoint_ns: array[int] = field(default_factory=lambda: array("q"))
    frame_waiting_ns: int | None = None
    """Arrival of the latest frame that was used and that no setpoint has followed yet."""

    def note_setpoint(self, now_ns: int) -> None:
        self.setpoint_sent_ns.append(now_ns)
        if self.frame_waiting_ns is not None:
            self.frame_to_setpoint_ns.append(now_ns - self.frame_waiting_ns)
            self.frame_waiting_ns = None


class LiveApp:
    """One run over real links. `run()` returns when the mission is done, or after Ctrl-C or `stop()`."""

    def __init__(self, config: Config, *, sinks: Sequence[LiveSink], autostart: bool) -> None:
        self.counters = LiveCounters()
        self.onboard = Onboard(config, start_ns=time.monotonic_ns(), signing=signing_of(config.link))
        self._config = config
        self._sinks = sinks
        self._frame_sinks = [sink for sink in sinks if isinstance(sink, FrameSink)]
        self._autostart = autostart
        self._link: Link | None = None
        self._stop = asyncio.Event()
        self._newest: tuple[str, CameraFrame] | None = None
        self._frame_ready = asyncio.Event()
        self._worker = VisionWorker(config)
        self._arrivals = {config.vision.camera: _arrival_watch(config, config.vision.camera)}

    @property
    def period_ns(self) -> int:
        """Of the control loop."""
        return round(1e9 / self._config.control.rate_hz)

    def stop(self) -> None:
        """Ask for an orderly end: Hold first."""
        self._stop.set()

    async def run(self) -> Phase:
        """Fly until done; the phase at the end."""
        await self._worker.warm_up()
        gc.collect()
        gc.freeze()  # a full collection under load would cost tens of milliseconds of the control loop
        async with open_link(self._config.link.url, self._on_datagram) as link:
            self._link = link
            self._start_services()
            try:
                async with asyncio.TaskGroup() as tasks:
                    background = [
                        tasks.create_task(self._timers()),
                        tasks.create_task(self._camera(self._config.vision.camera)),
                        tasks.create_task(self._detect()),
                        tasks.create_task(self._watch()),
                    ]
                    await self._until_over()
                    for task in background:
                        task.cancel()
            finally:
                self._link = None
                self._worker.close()
                for sink in self._sinks:
                    sink.close()
        return self.onboard.pipeline.phase

    def _start_services(self) -> None:
        loop = asyncio.get_running_loop()
        for sink in self._sinks:
            if isinstance(sink, LiveService):
                sink.start(lambda message: _hand_over(loop, self._asked, message))

    def _asked(self, message: OperatorCommand | PadBeacon | Health) -> None:
        if isinstance(message, Health):
            self._report(message)
            return
        self.onboard.receive(message, time.monotonic_ns())
        self._flush()

    async def _until_over(self) -> None:
        started = False
        while not self._stop.is_set():
            if self._autostart and not started and self.onboard.session.connected:
                await asyncio.sleep(1.0)
                self._operate(OperatorAction.START, "autostart")
                started = True
            if self.onboard.pipeline.phase is Phase.DONE:
                await asyncio.sleep(LINGER_S)
                return
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._stop.wait(), 0.1)
        if self.onboard.pipeline.phase not in (Phase.IDLE, Phase.DONE):
            self._operate(OperatorAction.HOLD, "keyboard")
            await asyncio.sleep(HOLD_GRACE_S)

    def _operate(self, action: OperatorAction, source: str) -> None:
        self.onboard.operate(action, source, time.monotonic_ns())
        self._flush()

    # --------------------------------------------------------------------------------------------------- link and time

    def _on_datagram(self, data: bytes) -> None:
        now_ns = time.monotonic_ns()
        for sink in self._sinks:
            sink.datagram(now_ns, data, outgoing=False)
        self.onboard.receive_datagram(data, now_ns)
        self._flush()

    async def _timers(self) -> None:
        while True:
            await _until(self.onboard.next_timer_ns())
            self.onboard.handle_timers(time.monotonic_ns())
            self._flush()

    def _flush(self) -> None:
        """Send what there is to send, then show what happened."""
        for data in self.onboard.datagrams_to_send():
            if self._link is not None:
                self._link.send(data)
            now_ns = time.monotonic_ns()
            for sink in self._sinks:
                sink.datagram(now_ns, data, outgoing=True)
        entries = self.onboard.take_journal()
        if self.counters.started_ns is None:
            self.counters.started_ns = next((e.message.t_ns for e in entries if _is_start(e.message)), None)
        if any(isinstance(entry.message, VelocitySetpoint) for entry in entries):
            self.counters.note_setpoint(time.monotonic_ns())
        for sink in self._sinks:
            sink.journal(entries)

    # ---------------------------------------------------------------------------------------------------------- camera

    async def _camera(self, name: str) -> None:
        """Read frames; reconnect for ever: a camera that comes back is a camera."""
        url, trouble = self._config.cameras[name].source, Trouble()
        while True:
            text = f"{url}: the stream ended; trying again"
            try:
                async for frame in frames(url):
                    if trouble.over():
                        self._report(Health(time.monotonic_ns(), f"camera {name}", 0, "frames come"))
                    if self._newest is not None:
                        self.counters.frames_dropped += 1
                    self._newest = (name, frame)
                    self._frame_ready.set()
                    self._report(*self._arrivals[name].arrived(time.monotonic_ns()))
            except CameraError as error:
                text = str(error)
            self._say(trouble, f"camera {name}", text)
            await asyncio.sleep(RECONNECT_S)

    async def _watch(self) -> None:
        """A dead camera sends nothing that could say so; nor does an autopilot that is refused."""
        refused, trouble = 0, Trouble()
        while True:
            await asyncio.sleep(WATCH_S)
            for watch in self._arrivals.values():
                self._report(*watch.check(time.monotonic_ns()))
            before, refused = refused, self.onboard.session.counters.frames_refused
            if refused > before:
                self._say(trouble, "link", f"frames refused: not signed with {self._config.link.signing_key_file}")

    def _say(self, trouble: Trouble, subject: str, text: str) -> None:
        now_ns = time.monotonic_ns()
        if trouble.is_worth_saying(now_ns, text):
            self._report(Health(now_ns, subject, 1, text))

    def _report(self, *health: Health) -> None:
        for sink in self._sinks:
            for message in health:
                sink.journal((JournalEntry(0, message.t_ns, "out", None, message),))

    async def _detect(self) -> None:
        """Newest frame to the worker, its answer to the pipeline."""
        while True:
            await self._frame_ready.wait()
            self._frame_ready.clear()
            if self._newest is None:
                continue
            (name, frame), self._newest = self._newest, None
            capture_boot_us, local_ns = _capture_stamps(frame, self._config.cameras[name].clock)
            stamp = self.onboard.capture_time_ns(name, capture_boot_us=capture_boot_us, arrived_ns=local_ns)
            for sink in self._frame_sinks:
                sink.frame(name, frame.arrived_ns, stamp, frame.content)
            seen = await self._worker.look(
                name,
                frame.content,
                t_ns=stamp,
                sequence=frame.sequence or 0,
                hint=self.onboard.hint(name, stamp),
                capture_uncertainty_ns=frame.capture_uncertainty_ns,
            )
            self._report(*seen.health)
            self._count(seen.detection)
            self.counters.frame_waiting_ns = frame.arrived_ns
            self.onboard.receive(seen.detection, time.monotonic_ns())
            self._flush()

    def _count(self, detection: Detection) -> None:
        self.counters.frames += 1
        if not isinstance(detection, PadNotSeen):
            self.counters.frames_with_pad += 1
            if self.counters.first_sight_ns is None:
                self.counters.first_sight_ns = detection.t_ns


def _is_start(message: Message) -> bool:
    return isinstance(message, OperatorCommand) and message.action is OperatorAction.START


def _arrival_watch(config: Config, name: str) -> ArrivalWatch:
    return ArrivalWatch(
        name, timeout_ns=round(config.cameras[name].timeout_s * 1e9), start_ns=time.monotonic_ns() + START_GRACE_NS
    )


def _capture_stamps(frame: CameraFrame, clock: str) -> tuple[int | None, int]:
    """(capture on the autopilot's boot clock if the frame says so, instant on this computer's clock), us and ns.

    A configured clock of "arrival" distrusts what the source says of its time.
    """
    if clock == "arrival" or frame.clock in (CaptureClock.MEDIA, CaptureClock.UNIX):
        return None, frame.arrived_ns
    if frame.clock is CaptureClock.AUTOPILOT:
        return frame.capture_ns // 1000, frame.arrived_ns
    return None, frame.capture_ns


def _hand_over(loop: asyncio.AbstractEventLoop, take: Callable[[Any], None], message: object) -> None:
    """From another thread; what comes when all is over is dropped."""
    with contextlib.suppress(RuntimeError):
        loop.call_soon_threadsafe(take, message)


async def _until(deadline_ns: int) -> None:
    """Sleep, then poll for the last millisecond, letting the loop do its work in between."""
    remaining_ns = deadline_ns - time.monotonic_ns()
    if remaining_ns > SPIN_NS:
        await asyncio.sleep((remaining_ns - SPIN_NS) / 1e9)
    while time.monotonic_ns() < deadline_ns:  # noqa: ASYNC110 - an event would wake up late again
        await asyncio.sleep(0)


class FolderSink:
    """flight.tlog and flight.mcap on the wall clock's time, and the record for the report."""

    def __init__(self, folder: RunFolder, config: Config, about: Mapping[str, str]) -> None:
        self.record = FlightRecord()
        self._writer = TlogWriter(folder.tlog)
        self._wall_minus_monotonic_ns = time.time_ns() - time.monotonic_ns()
        self._messages = McapWriter(folder.mcap, LogOrigin(config, versions(), self._wall_minus_monotonic_ns, about))

    def datagram(self, now_ns: int, data: bytes, *, outgoing: bool) -> None:
        self._writer.write((now_ns + self._wall_minus_monotonic_ns) // 1000, data)

    def journal(self, entries: Sequence[JournalEntry]) -> None:
        self.record.add_entries(entries)
        for entry in entries:
            self._messages.write(entry)

    def frame(self, camera: str, arrived_ns: int, t_ns: int, content: Image | bytes) -> None:
        self._messages.write_frame(camera, arrived_ns, t_ns, content)
        self.record.add_frame(t_ns, content)

    def close(self) -> None:
        self._writer.close()
        self._messages.close()


class LiveViewSink:
    """Draws the terminal view at a few hertz."""

    def __init__(self, view: LiveView, live: Live, started: float) -> None:
        self._view, self._live, self._started, self._drawn = view, live, started, 0.0

    def datagram(self, now_ns: int, data: bytes, *, outgoing: bool) -> None:
        pass

    def journal(self, entries: Sequence[JournalEntry]) -> None:
        for entry in entries:
            self._view.add(entry.message)
        now = time.monotonic()
        if now - self._drawn >= REDRAW_S:
            self._drawn = now
            self._live.update(self._view.panel(wall_s=now - self._started), refresh=True)

    def close(self) -> None:
        self._live.update(self._view.panel(wall_s=time.monotonic() - self._started), refresh=True)


def run_live(config: Config, *, start: bool, runs: Path, show: bool, console: Console | None = None) -> int:
    """`companion run`: fly, keep a run folder, say how it ended. 0 where the vehicle stands on the pad, disarmed,
    or where Companion only guided."""
    console = console or Console()
    signing_of(config.link)  # a wrong key file is an error before anything is made
    folder = RunFolder(runs, time.strftime("run-%Y%m%d-%H%M%S"))
    folder.write_config(config)
    console.print(
        f"link {config.link.url}, camera {config.cameras[config.vision.camera].source}, kept in {folder.path}"
    )
    app, record, wall_s = drive(config, folder, title="companion run", show=show, console=console, autostart=start)
    phase = app.onboard.pipeline.phase
    line = f"{phase}: {app.onboard.pipeline.note}"
    guided = config.guidance.form != "off"
    figures = {
        "outcome": "guided" if guided else "landed" if phase is Phase.DONE else "held",
        "simulated": False,
        "phase": str(phase),
        "wall_s": wall_s,
    }
    folder.write_run(figures)
    folder.write_pages(report_html(record, figures, title="companion run", line=line), picture(record))
    console.print(line)
    return 0 if guided or phase is Phase.DONE else 1


def drive(
    config: Config,
    folder: RunFolder,
    *,
    title: str,
    show: bool,
    console: Console,
    autostart: bool,
    until: Callable[[LiveApp], Any] | None = None,
) -> tuple[LiveApp, FlightRecord, float]:
    """Run the live app with its recorder and view. `until` is a coroutine function that may stop it."""
    started = time.monotonic()
    sink = FolderSink(folder, config, {"title": title})
    sinks: list[LiveSink] = [sink, *services_of(config, title=title, console=console)]
    if (manager := service_manager()) is not None:
        sinks.append(manager)
    with contextlib.ExitStack() as stack:
        if show:
            live = stack.enter_context(Live(console=console, auto_refresh=False))
            sinks.append(LiveViewSink(LiveView(title), live, started))

        async def main() -> LiveApp:
            app = LiveApp(config, sinks=sinks, autostart=autostart)
            for number in (signal.SIGINT, signal.SIGTERM):
                asyncio.get_running_loop().add_signal_handler(number, app.stop)
            watcher = asyncio.create_task(until(app)) if until is not None else None
            await app.run()
            if watcher is not None:
                watcher.cancel()
            return app

        app = asyncio.run(main())
    return app, sink.record, time.monotonic() - started
