"""Half an hour of following a moving pad: does anything grow, drift or stay behind?

    nice python benchmarks/soak.py [--minutes 30] [--seed 1] [--camera-hz 5] [--json]

Lockstep, as fast as it goes: simulator, onboard program, recorder (flight.tlog, flight.mcap) and the record for the report, the
camera at a lower rate than usual so that rendering does not take most of the time. Every simulated half minute: resident memory,
Python objects, threads, open files. After a warm-up of five minutes memory may grow by 5 %. The control loop's own account: ticks
handled against those due, the largest deviation of a gap between two setpoints from 20 ms. Status 1 where a bound is broken.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import resource
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from companion.campaign.flight_sinks import McapSink, ReportSink, TlogSink
from companion.campaign.runner import Flight
from companion.config import load as load_config
from companion.messages import Phase, PhaseChanged, Tick, VelocitySetpoint
from companion.onboard import JournalEntry
from sitl_stub.scenario import load, with_overrides
from sitl_stub.world import Truth

EVERY_S = 30.0
WARM_UP_S = 300.0
MOST_GROWTH = 0.05
PAGE = resource.getpagesize()


@dataclass(frozen=True)
class Sample:
    """One look at the process. `objects` are those that the collector knows."""

    t_s: float
    resident_mb: float
    objects: int
    threads: int
    files: int


class Watch:
    """A sink that looks at the process now and then and counts what the loop did."""

    def __init__(self) -> None:
        self.samples: list[Sample] = []
        self.ticks = 0
        self.first_ns = self.last_ns = 0
        self.setpoints = 0
        self.worst_gap_ns = 0
        self.phases: list[tuple[float, str]] = []
        self._last_setpoint_ns: int | None = None
        self._due_s = 0.0

    def datagram(self, now_ns: int, data: bytes, *, outgoing: bool) -> None:
        pass

    def truth(self, now_ns: int, truth: Truth) -> None:
        if truth.t_us / 1e6 >= self._due_s:
            self._due_s += EVERY_S
            self.samples.append(look(truth.t_us / 1e6))

    def journal(self, entries: Sequence[JournalEntry]) -> None:
        for entry in entries:
            if isinstance(entry.message, Tick):
                self.ticks += 1
                self.first_ns = self.first_ns or entry.message.t_ns
                self.last_ns = entry.message.t_ns
            elif isinstance(entry.message, VelocitySetpoint):
                self._setpoint(entry.message.t_ns)
            elif isinstance(entry.message, PhaseChanged):
                self._last_setpoint_ns = None
                self.phases.append(((entry.message.t_ns - self.first_ns) / 1e9, str(entry.message.after)))

    def _setpoint(self, t_ns: int) -> None:
        self.setpoints += 1
        if self._last_setpoint_ns is not None:
            self.worst_gap_ns = max(self.worst_gap_ns, abs(t_ns - self._last_setpoint_ns - 20_000_000))
        self._last_setpoint_ns = t_ns

    def close(self) -> None:
        pass


def look(t_s: float) -> Sample:
    gc.collect()
    resident = int(Path("/proc/self/statm").read_text().split()[1]) * PAGE
    files = len(os.listdir("/proc/self/fd"))
    return Sample(t_s, resident / 1e6, len(gc.get_objects()), threading.active_count(), files)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--camera-hz", type=float, default=5.0)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    watch, wall_s = fly(60.0 * options.minutes, options.seed, options.camera_hz)
    figures = judged(watch, 60.0 * options.minutes, wall_s)
    if options.json:
        print(json.dumps({**figures, "samples": [asdict(sample) for sample in watch.samples]}))
    else:
        for sample in watch.samples:
            print(
                f"{sample.t_s:7.0f} s  {sample.resident_mb:7.1f} MB  {sample.objects:8d} objects  {sample.threads} threads  {sample.files} files"
            )
        for name, value in figures.items():
            print(f"{name:28} {value}")
    return int(not figures["passed"])


def fly(seconds: float, seed: int, camera_hz: float) -> tuple[Watch, float]:
    """Follow at follow height until the time is over: the descent is never allowed to begin."""
    world = {"duration_limit_s": seconds, "cameras.down.rate_hz": camera_hz}
    config = load_config(
        [],
        {
            "mission.follow_time_s": str(10.0 * seconds),
            "safety.max_flight_time_s": str(10.0 * seconds),
            "safety.min_battery": "0.0",
        },
    )
    watch = Watch()
    with tempfile.TemporaryDirectory() as folder:
        sinks = [
            watch,
            ReportSink(),
            TlogSink(Path(folder) / "flight.tlog"),
            McapSink(Path(folder) / "flight.mcap", config, {}),
        ]
        flight = Flight(with_overrides(load("circle"), world), config, seed, sinks)
        began_s = time.monotonic()
        flight.run(lambda: False)
    return watch, time.monotonic() - began_s


def judged(watch: Watch, seconds: float, wall_s: float) -> dict[str, object]:
    warm = [sample for sample in watch.samples if sample.t_s >= min(WARM_UP_S, seconds / 3.0)]
    first, last = warm[0], warm[-1]
    growth = max(sample.resident_mb for sample in warm) / first.resident_mb - 1.0
    due = round((watch.last_ns - watch.first_ns) / 20_000_000) + 1
    following_s = seconds - next((t_s for t_s, phase in watch.phases if phase == Phase.FOLLOW), seconds)
    followed = watch.phases[-1][1] == Phase.FOLLOW if watch.phases else False
    kept = (first.threads, first.files) == (last.threads, last.files)
    return {
        "simulated_s": seconds,
        "wall_s": round(wall_s, 1),
        "followed_s": round(following_s, 1),
        "memory_after_warm_up_mb": round(first.resident_mb, 1),
        "memory_at_the_end_mb": round(last.resident_mb, 1),
        "largest_growth": f"{100.0 * growth:.2f} %",
        "objects": f"{first.objects} -> {last.objects}",
        "threads": f"{first.threads} -> {last.threads}",
        "files": f"{first.files} -> {last.files}",
        "ticks": f"{watch.ticks} of {due}",
        "setpoints": watch.setpoints,
        "worst_gap_deviation_ms": watch.worst_gap_ns / 1e6,
        "passed": growth < MOST_GROWTH and watch.ticks == due and followed and kept,
    }


if __name__ == "__main__":
    sys.exit(main())
