"""`companion demo --udp`: the simulator as a second process, real sockets, real time, the camera over HTTP.

The app side is exactly `companion run`; the simulator's own verdict, which knows the truth, is read from its output at the end.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from rich.console import Console

from companion.app import LiveApp, drive
from companion.campaign.summary import summary_line
from companion.config import Config
from companion.demo import DemoOptions
from companion.io.run_folder import RunFolder, versions
from companion.messages import Phase
from companion.telemetry.report import picture, report_html
from sitl_stub.scenario import Scenario

STUB_GRACE_S = 8.0
"""The simulator names an ending only after the vehicle has stood still for a while."""


def fly_demo_udp(
    scenario: str, world: Mapping[str, str], flown: Scenario, config: Config, options: DemoOptions, console: Console
) -> dict[str, Any]:
    """Start the simulator, fly, stop it; the figures as in run.json."""
    title = f"companion demo {options.scenario_name} --udp, seed {options.seed} (simulated, real time)"
    folder = RunFolder(options.runs, f"{options.scenario_name}-{options.seed}-udp")
    folder.write_config(config)
    # A session of its own: Ctrl-C in the terminal must reach the app alone, whose vehicle still has to be put into Hold.
    with subprocess.Popen(
        _stub_command(scenario, world, options.seed),
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        start_new_session=True,
    ) as stub:
        try:
            app, record, wall_s = drive(
                config,
                folder,
                title=title,
                show=options.show,
                console=console,
                autostart=True,
                until=lambda live: _watch(live, stub, flown.duration_limit_s),
            )
            ending = _verdict(stub)
        finally:
            stub.terminate()
    figures = _figures(app, ending, options, wall_s)
    figures["run"] = str(folder.path)
    folder.write_run(figures)
    page = report_html(record, {**figures, **versions()}, title=title, line=summary_line(figures))
    folder.write_pages(page, picture(record))
    return figures


def _stub_command(scenario: str, world: Mapping[str, str], seed: int) -> list[str]:
    overrides = [part for key, value in world.items() for part in ("--set", f"{key}={value}")]
    return [sys.executable, "-m", "sitl_stub", scenario, "--seed", str(seed), "--json", "--until-landed", *overrides]


async def _watch(app: LiveApp, stub: subprocess.Popen[str], limit_s: float) -> None:
    """Stop the app when the simulator is gone, the attempt is over or the scenario's time is up."""
    began = time.monotonic()
    flying = False
    while time.monotonic() - began < limit_s:
        phase = app.onboard.pipeline.phase
        flying = flying or phase is not Phase.IDLE
        over = flying and phase in (Phase.IDLE, Phase.HOLD, Phase.RETURN)
        if stub.poll() is not None or over:
            break
        await asyncio.sleep(0.2)
    await asyncio.sleep(1.0)
    app.stop()


def _verdict(stub: subprocess.Popen[str]) -> dict[str, Any]:
    """The simulator's last line of JSON; empty where it ended without one, if need be by force."""
    output = ""
    for last_word in (None, signal.SIGINT, signal.SIGKILL):
        if last_word is not None:
            stub.send_signal(last_word)
        with contextlib.suppress(subprocess.TimeoutExpired):
            output, _ = stub.communicate(timeout=STUB_GRACE_S)
            break
    lines = [line for line in output.splitlines() if line.startswith("{")]
    return dict(json.loads(lines[-1])) if lines else {}


def _figures(app: LiveApp, ending: Mapping[str, Any], options: DemoOptions, wall_s: float) -> dict[str, Any]:
    name = ending.get("ending", "flying")
    phase = app.onboard.pipeline.phase
    given_up = "held" if phase in (Phase.IDLE, Phase.HOLD, Phase.RETURN) else "timeout"
    counters = app.counters
    touchdown_ns = _companion_ns(app, ending.get("touchdown_s"))
    return {
        "outcome": {"on_pad": "landed", "flying": given_up, "timeout": given_up}.get(name, name),
        "seed": options.seed,
        "scenario": options.scenario_name,
        "simulated": True,
        "udp": True,
        "touchdown_error_m": ending.get("touchdown_error_m"),
        "touchdown_relative_speed_horizontal_m_s": ending.get("touchdown_relative_speed_horizontal_m_s"),
        "touchdown_relative_speed_vertical_m_s": ending.get("touchdown_relative_speed_vertical_m_s"),
        "time_to_touchdown_s": _since(counters.started_ns, touchdown_ns),
        "first_sight_to_touchdown_s": _since(counters.first_sight_ns, touchdown_ns),
        "simulated_s": round(ending.get("t_s", wall_s), 3),
        "wall_s": round(wall_s, 3),
        "real_time_factor": 1.0,
        "forced_disarm_in_air": ending.get("forced_disarm_in_air", False),
        "go_arounds": app.onboard.pipeline.go_arounds,
        "frames": counters.frames,
        "frames_with_pad": counters.frames_with_pad,
        "frames_dropped": counters.frames_dropped,
        "final_phase": str(phase),
        "final_note": app.onboard.pipeline.note,
        "setpoint_timing_ms": timing_ms(counters.setpoint_sent_ns, app.period_ns),
        "frame_to_setpoint_ms": _percentiles_ms(counters.frame_to_setpoint_ns),
    }


def _companion_ns(app: LiveApp, boot_s: float | None) -> int | None:
    """An instant of the simulator, whose clock is the autopilot's, on the companion's clock."""
    return None if boot_s is None else app.onboard.session.companion_ns_from_boot_us(round(boot_s * 1e6))


def _since(began_ns: int | None, ended_ns: int | None) -> float | None:
    return None if began_ns is None or ended_ns is None else round((ended_ns - began_ns) / 1e9, 3)


def timing_ms(sent_ns: Sequence[int], period_ns: int) -> dict[str, float]:
    """Deviation of the gaps between setpoints from their period, ms: median, p99, max."""
    gaps_ns = [abs(later - earlier - period_ns) for earlier, later in pairwise(sent_ns)]
    return {"count": len(gaps_ns), **_percentiles_ms(gaps_ns)}


def _percentiles_ms(values_ns: Sequence[int]) -> dict[str, float]:
    if not values_ns:
        return {}
    ordered = sorted(values_ns)
    at = {"p50": len(ordered) // 2, "p99": int(0.99 * (len(ordered) - 1)), "max": len(ordered) - 1}
    return {name: round(ordered[index] / 1e6, 3) for name, index in at.items()}
