"""Reading telemetry logs: our columns against pymavlink's mavutil, same file, same run, same messages.

    python benchmarks/tlog_reader.py [LOG.tlog] [--repeat 20]

The log is repeated in a temporary file so that both have something to do. Both decode every message of every type they know;
agreement is tested message by message in tests/unit/companion/io/test_tlog.py, here by counts and sums of three fields.
"""

from __future__ import annotations

import argparse
import math
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np
from pymavlink import mavutil

from companion.io.tlog_columns import TlogColumns

DEFAULT = Path(__file__).parents[1] / "tests" / "data" / "px4" / "takeoff_land.tlog"
SUMS = (("ODOMETRY", "x"), ("LOCAL_POSITION_NED", "vx"), ("ATTITUDE", "roll"))


def by_mavutil(path: Path) -> tuple[float, Counter[str], list[float]]:
    began = time.perf_counter()
    log, counts, values = mavutil.mavlink_connection(str(path)), Counter[str](), {pair: [] for pair in SUMS}
    while (message := log.recv_msg()) is not None:
        name = message.get_type()
        counts[name] += 1
        for pair in SUMS:
            if pair[0] == name:
                values[pair].append(getattr(message, pair[1]))
    log.close()
    return time.perf_counter() - began, counts, [math.fsum(values[pair]) for pair in SUMS]


def by_columns(path: Path, *, use_compiler: bool) -> tuple[float, Counter[str], list[float]]:
    began = time.perf_counter()
    log = TlogColumns(path.read_bytes(), use_compiler=use_compiler)
    counts = Counter({name: len(log[name]) for name in log})
    sums = [float(np.sum(log[name][field], dtype=np.float64)) for name, field in SUMS]
    return time.perf_counter() - began, counts, sums


def compare(path: Path) -> None:
    reference_s, reference_counts, reference_sums = by_mavutil(path)
    total = reference_counts.total()
    known = {name: n for name, n in reference_counts.items() if not name.startswith("UNKNOWN")}
    print(f"{path.stat().st_size / 1e6:.1f} MB, {total} messages")
    print(f"{'mavutil':<28}{total / reference_s:>12,.0f} messages/s")
    for label, use_compiler in (("columns, Python and numpy", False), ("columns, with numba", True)):
        by_columns(DEFAULT, use_compiler=use_compiler)  # definitions are imported and the walk is compiled once
        seconds, counts, sums = min(by_columns(path, use_compiler=use_compiler) for _ in range(3))
        assert counts.total() == total, "not the same messages"
        assert all(counts[name] == n for name, n in known.items()), "not the same messages"
        assert np.allclose(sums, reference_sums, rtol=1e-9), "not the same values"
        print(f"{label:<28}{total / seconds:>12,.0f} messages/s{reference_s / seconds:>8.0f} x")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("log", nargs="?", type=Path, default=DEFAULT)
    parser.add_argument("--repeat", type=int, default=20)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "repeated.tlog"
        path.write_bytes(arguments.log.read_bytes() * arguments.repeat)
        compare(path)


if __name__ == "__main__":
    main()
