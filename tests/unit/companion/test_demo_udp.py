"""Times over sockets count from the same instants as in lockstep."""

from __future__ import annotations

import subprocess
import sys
from array import array
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from companion import demo_udp
from companion.app import LiveCounters
from companion.demo import DemoOptions
from companion.demo_udp import _figures, _verdict, timing_ms
from companion.messages import Phase

SECOND_NS = 10**9
BOOT_NS = 700 * SECOND_NS
"""The simulator's zero on the companion's clock."""


class FlownSession:
    """Knows the autopilot's clock."""

    def companion_ns_from_boot_us(self, t_boot_us: int) -> int:
        return BOOT_NS + t_boot_us * 1000


@dataclass
class FlownApp:
    """What is left of a live app after a flight."""

    counters: LiveCounters
    phase: Phase = Phase.DONE
    go_arounds: int = 0
    note: str = "done"
    period_ns: int = 20_000_000
    session: FlownSession = field(default_factory=FlownSession)

    @property
    def onboard(self) -> FlownApp:
        return self

    @property
    def pipeline(self) -> FlownApp:
        return self


def figures(ending: dict[str, Any]) -> dict[str, Any]:
    counters = LiveCounters(first_sight_ns=BOOT_NS + 12 * SECOND_NS, started_ns=BOOT_NS + 3 * SECOND_NS)
    options = DemoOptions("line", 1, Path("runs"), show=False, keep=False)
    return _figures(FlownApp(counters), ending, options, 30.0)  # type: ignore[arg-type]


def test_time_to_touchdown_counts_from_start_and_not_from_the_simulators_beginning() -> None:
    row = figures({"ending": "on_pad", "touchdown_s": 22.0, "t_s": 25.0})
    assert row["time_to_touchdown_s"] == 19.0
    assert row["first_sight_to_touchdown_s"] == 10.0
    assert row["simulated_s"] == 25.0


def test_without_a_touchdown_there_is_no_time() -> None:
    row = figures({"ending": "flying", "touchdown_s": None})
    assert row["time_to_touchdown_s"] is None
    assert row["first_sight_to_touchdown_s"] is None


def test_gaps_are_judged_by_their_deviation_from_the_period() -> None:
    sent = array("q", [0, 20_000_000, 41_000_000, 61_000_000])
    assert timing_ms(sent, 20_000_000) == {"count": 3, "p50": 0.0, "p99": 0.0, "max": 1.0}


def test_a_simulator_that_does_not_end_is_ended_and_gives_no_verdict(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(demo_udp, "STUB_GRACE_S", 0.5)
    deaf = "import signal, time; signal.signal(signal.SIGINT, signal.SIG_IGN); time.sleep(600)"
    with subprocess.Popen([sys.executable, "-c", deaf], stdout=subprocess.PIPE, text=True) as stub:
        assert _verdict(stub) == {}
        assert stub.wait() != 0


def test_the_verdict_is_the_simulators_last_line_of_json() -> None:
    speaks = "print('flying'); print('{\"ending\": \"on_pad\"}')"
    with subprocess.Popen([sys.executable, "-c", speaks], stdout=subprocess.PIPE, text=True) as stub:
        assert _verdict(stub) == {"ending": "on_pad"}
