"""`companion demo`: a simulated landing to watch. In lockstep by default; with real sockets and two processes by `--udp`."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.live import Live

from companion.campaign.flight_sinks import ViewSink
from companion.campaign.recorded_flight import RecordedFlight
from companion.campaign.runner import Flight, Sink
from companion.campaign.summary import summary
from companion.config import Config
from companion.telemetry.live_view import LiveView
from sitl_stub.scenario import Scenario

REDRAW_HZ = 8.0


@dataclass(frozen=True, slots=True)
class DemoOptions:
    """What the command line asked for."""

    scenario_name: str
    seed: int
    runs: Path
    show: bool
    keep: bool


def fly_demo(scenario: Scenario, config: Config, options: DemoOptions, console: Console) -> dict[str, Any]:
    """Fly, show, record, sum up; the figures as in run.json."""
    title = f"companion demo {options.scenario_name}, seed {options.seed} (simulated)"
    view = LiveView(title)
    name, about = options.scenario_name, {"scenario": options.scenario_name, "seed": str(options.seed)}
    recorded = RecordedFlight(options.runs, f"{name}-{options.seed}", config, about) if options.keep else None
    sinks: list[Sink] = list(recorded.sinks) if recorded is not None else []
    if options.show:
        sinks.append(ViewSink(view))
    prepared = time.monotonic()
    flight = Flight(scenario, config, options.seed, sinks)
    started = time.monotonic()
    with _interruptible() as was_interrupted, _drawing(view, console, started, options.show) as draw:

        def on_turn() -> bool:
            draw()
            return was_interrupted()

        result = flight.run(on_turn)
    wall_s = time.monotonic() - started
    figures = summary(result, scenario=name, seed=options.seed, wall_s=wall_s)
    figures["setup_s"] = round(started - prepared, 3)
    return recorded.finish(figures, title=title) if recorded is not None else figures


@contextmanager
def _interruptible() -> Iterator[Callable[[], bool]]:
    """The first Ctrl-C asks for an orderly end (the vehicle goes to Hold); the second is the usual one."""
    asked = [False]

    def on_signal(number: int, frame: object) -> None:
        asked[0] = True
        signal.signal(signal.SIGINT, signal.default_int_handler)

    before = signal.signal(signal.SIGINT, on_signal)
    try:
        yield lambda: asked[0]
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def _drawing(view: LiveView, console: Console, started: float, show: bool) -> Iterator[Callable[[], None]]:
    """A redraw function that costs nothing between redraws."""
    if not show:
        yield lambda: None
        return
    last = [0.0]
    with Live(console=console, auto_refresh=False, transient=False) as live:

        def draw() -> None:
            now = time.monotonic()
            if now - last[0] >= 1.0 / REDRAW_HZ:
                last[0] = now
                live.update(view.panel(wall_s=now - started), refresh=True)

        yield draw
        live.update(view.panel(wall_s=time.monotonic() - started), refresh=True)


def exit_status(figures: dict[str, Any]) -> int:
    """0 only for a landing on the pad."""
    return 0 if figures["outcome"] == "landed" else 1
