"""The live terminal view: phase, position and speed against the pad, whether the marker is seen, rates, time.

Fed with every message of a flight; drawn a few times a second by the shell. `FlightSummary` fields come from here too, so
that what one sees is what is summed up.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from companion.messages import (
    AutopilotText,
    CommandResult,
    Health,
    Message,
    MissionView,
    PadBeacon,
    PadEstimate,
    PadNotSeen,
    PadObservation,
    Phase,
    PhaseChanged,
    VehicleCommand,
    VehicleState,
    VehicleStatus,
    VelocitySetpoint,
)

PHASE_LADDER = (
    Phase.ENGAGE,
    Phase.SEARCH,
    Phase.APPROACH,
    Phase.FOLLOW,
    Phase.DESCEND,
    Phase.COMMIT,
    Phase.TOUCHDOWN,
    Phase.DONE,
)
RATE_WINDOW_NS = 2_000_000_000
EVENT_LINES = 7


@dataclass(slots=True)
class Rate:
    """Messages per second over the last two seconds of flight time."""

    stamps: deque[int] = field(default_factory=lambda: deque(maxlen=400))

    def add(self, t_ns: int) -> None:
        self.stamps.append(t_ns)

    def hz(self, now_ns: int) -> float:
        return sum(1 for stamp in self.stamps if now_ns - stamp <= RATE_WINDOW_NS) / (RATE_WINDOW_NS / 1e9)


class LiveView:
    """Collects; `panel()` draws."""

    def __init__(self, title: str) -> None:
        self._title = title
        self._mission: MissionView | None = None
        self._status: VehicleStatus | None = None
        self._estimate: PadEstimate | None = None
        self._setpoint: VelocitySetpoint | None = None
        self._start_ns: int | None = None
        self._now_ns = 0
        self._rates = {name: Rate() for name in ("state", "frames", "seen", "beacon", "setpoints")}
        self._events: deque[tuple[float, str]] = deque(maxlen=EVENT_LINES)

    def add(self, message: Message) -> None:
        """Take one message of the flight into account."""
        self._now_ns = max(self._now_ns, message.t_ns)
        if self._start_ns is None:
            self._start_ns = message.t_ns
        match message:
            case MissionView():
                self._mission = message
            case VehicleStatus():
                self._status = message
            case PadEstimate():
                self._estimate = message
            case VehicleState():
                self._rates["state"].add(message.t_ns)
            case PadObservation():
                self._rates["frames"].add(message.t_ns)
                self._rates["seen"].add(message.t_ns)
            case PadNotSeen():
                self._rates["frames"].add(message.t_ns)
            case PadBeacon():
                self._rates["beacon"].add(message.t_ns)
            case VelocitySetpoint():
                self._setpoint = message
                self._rates["setpoints"].add(message.t_ns)
            case _:
                self._add_event(message)

    def _add_event(self, message: Message) -> None:
        match message:
            case PhaseChanged():
                self._note(message.t_ns, f"{message.before} -> {message.after}   {message.reason}")
            case VehicleCommand():
                self._note(message.t_ns, f"ask: {message.kind} ({message.reason})")
            case CommandResult():
                self._note(message.t_ns, f"answer: {message.kind} {message.result}")
            case AutopilotText():
                self._note(message.t_ns, f"autopilot: {message.text}")
            case Health() if message.level > 0:
                self._note(message.t_ns, f"{message.subject}: {message.text}")
            case _:
                pass

    def _note(self, t_ns: int, text: str) -> None:
        self._events.append((self._seconds(t_ns), text))

    def _seconds(self, t_ns: int) -> float:
        return 0.0 if self._start_ns is None else (t_ns - self._start_ns) / 1e9

    def panel(self, *, wall_s: float) -> RenderableType:
        """The whole view. `wall_s` is the time since the start on the wall, for the speed-up."""
        return Panel(
            Group(self._ladder(), Text(), self._numbers(wall_s), Text(), self._event_lines()),
            title=self._title,
            border_style="cyan",
            width=100,
        )

    def _ladder(self) -> Text:
        phase = self._mission.phase if self._mission else Phase.IDLE
        text = Text()
        for step in PHASE_LADDER:
            text.append(f" {step} ", style="bold black on green" if step is phase else "dim")
            text.append(" ")
        if phase not in PHASE_LADDER:
            text.append(f" {phase} ", style="bold black on yellow")
        return text

    def _numbers(self, wall_s: float) -> Table:
        table = Table.grid(padding=(0, 3))
        for _ in range(4):
            table.add_column()
        m, status, estimate = self._mission, self._status, self._estimate
        position = m.relative_position_ned_m if m else None
        velocity = m.relative_velocity_ned_m_s if m else None
        flight_s = self._seconds(self._now_ns)
        rows = [
            ("to the pad N, E", _pair(position, "m"), "pad seen", "yes" if m and m.pad_seen else "no"),
            ("speed against it", _pair(velocity, "m/s"), "height above pad", _number(m.height_above_pad_m if m else None, "m")),
            ("autopilot", _mode(status), "pad sigma", _number(estimate.position_sigma_m if estimate else None, "m")),
            ("rates state, setpoint", self._hz("state", "setpoints"), "frames, seen, beacon", self._hz("frames", "seen", "beacon")),
            ("time", f"{flight_s:6.1f} s", "speed", f"{flight_s / wall_s:4.1f} x real time" if wall_s > 0.5 else "-"),
        ]  # fmt: skip
        for row in rows:
            table.add_row(Text(row[0], style="dim"), row[1], Text(row[2], style="dim"), row[3])
        return table

    def _hz(self, *names: str) -> str:
        return ", ".join(f"{self._rates[name].hz(self._now_ns):.0f}" for name in names) + " Hz"

    def _event_lines(self) -> Text:
        lines = [f"{seconds:7.1f} s  {text}" for seconds, text in self._events]
        return Text("\n".join(lines + [""] * (EVENT_LINES - len(lines))), no_wrap=True, overflow="ellipsis")


def _pair(vector: tuple[float, float, float] | None, unit: str) -> str:
    return "-" if vector is None else f"{vector[0]:+7.2f} {vector[1]:+7.2f} {unit}"


def _number(value: float | None, unit: str) -> str:
    return "-" if value is None else f"{value:6.2f} {unit}"


def _mode(status: VehicleStatus | None) -> str:
    if status is None:
        return "not heard"
    return f"{status.mode}, {'armed' if status.armed else 'disarmed'}"
