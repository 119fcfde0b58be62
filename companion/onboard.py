"""The whole of Companion that flies, without any input or output: session, pipeline and timers as one value.

Bytes and stamped images go in with the time they arrived, bytes and records come out. The live app (asyncio) and the
lockstep runner are the two shells around it; neither adds a decision, so that what is tested is what flies.

    receive_datagram(data, now_ns)        a datagram from the link
    capture_time_ns(...)                  when a frame was taken, on the companion's clock
    hint(camera, t_ns)                    what to expect in a frame taken at t_ns (for the detector, in whatever thread)
    receive(message, now_ns)              an observation, an operator's command
    handle_timers(now_ns), next_timer_ns()
    datagrams_to_send(), take_journal()
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from companion.config import Config
from companion.mavlink.session import Session
from companion.mavlink.signing import Signing
from companion.messages import (
    Input,
    Message,
    OperatorAction,
    OperatorCommand,
    Output,
    PadReport,
    Tick,
    VehicleCommand,
    VelocitySetpoint,
)
from companion.pipeline import Pipeline
from companion.vision import DetectionHint


@dataclass(frozen=True, slots=True)
class JournalEntry:
    """One message in the order of handling. `cause` is the `sequence` of the input that an output answers."""

    sequence: int
    arrived_ns: int
    direction: Literal["in", "out"]
    cause: int | None
    message: Message


class Onboard:
    """State: the session, the pipeline, the next tick, and the journal not yet taken."""

    def __init__(self, config: Config, *, start_ns: int, signing: Signing | None = None) -> None:
        self._period_ns = round(1e9 / config.control.rate_hz)
        self._session = Session(config.link, start_ns, signing=signing)
        self._pipeline = Pipeline(config)
        self._next_tick_ns = start_ns + self._period_ns
        self._cameras = config.cameras
        self._report_form = config.guidance.form
        self._sequence = 0
        self._journal: list[JournalEntry] = []

    @property
    def session(self) -> Session:
        return self._session

    @property
    def pipeline(self) -> Pipeline:
        return self._pipeline

    def receive_datagram(self, data: bytes, now_ns: int) -> None:
        for message in self._session.receive_datagram(data, now_ns):
            self.receive(message, now_ns)

    def receive(self, message: Input, now_ns: int) -> None:
        """Journal the input, then handle it, then journal and send what it caused."""
        cause = self._record(message, now_ns, "in", None)
        for output in self._pipeline.handle(message):
            self._record(output, now_ns, "out", cause)
            self._send(output, now_ns)

    def operate(self, action: OperatorAction, source: str, now_ns: int) -> None:
        self.receive(OperatorCommand(now_ns, action, source), now_ns)

    def _send(self, output: Output, now_ns: int) -> None:
        if isinstance(output, VelocitySetpoint):
            self._session.send_setpoint(output, now_ns)
        elif isinstance(output, PadReport):
            self._session.send_landing_target(self._report_form, output, now_ns)
        elif isinstance(output, VehicleCommand):
            self._session.send_command(output, now_ns)

    def _record(self, message: Message, now_ns: int, direction: Literal["in", "out"], cause: int | None) -> int:
        self._sequence += 1
        self._journal.append(JournalEntry(self._sequence, now_ns, direction, cause, message))
        return self._sequence

    def capture_time_ns(self, camera: str, *, capture_boot_us: int | None, arrived_ns: int) -> int:
        """When a frame was taken, on the companion's clock.

        Without a capture stamp, or before the clocks are known to each other: its arrival less the configured delay.
        """
        if capture_boot_us is not None and self._cameras[camera].clock == "autopilot":
            captured_ns = self._session.companion_ns_from_boot_us(capture_boot_us)
            if captured_ns is not None:
                return captured_ns
        return arrived_ns - round(self._cameras[camera].delay_s * 1e9)

    def hint(self, camera: str, t_ns: int) -> DetectionHint | None:
        return self._pipeline.hint(camera, t_ns)

    def next_timer_ns(self) -> int:
        session_ns = self._session.next_timer_ns()
        return self._next_tick_ns if session_ns is None else min(self._next_tick_ns, session_ns)

    def handle_timers(self, now_ns: int) -> None:
        """Session timers, and the tick when it is due. Ticks that were missed are not made up for."""
        for message in self._session.handle_timer(now_ns):
            self.receive(message, now_ns)
        if now_ns >= self._next_tick_ns:
            self.receive(Tick(now_ns), now_ns)
            late = (now_ns - self._next_tick_ns) // self._period_ns
            self._next_tick_ns += (late + 1) * self._period_ns

    def datagrams_to_send(self) -> list[bytes]:
        return self._session.datagrams_to_send()

    def take_journal(self) -> list[JournalEntry]:
        journal, self._journal = self._journal, []
        return journal
