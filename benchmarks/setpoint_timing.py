"""When setpoints leave, over real UDP sockets in real time, while the detector runs.

    python benchmarks/setpoint_timing.py [--scenario line] [--seed 1] [--seconds 40] [--json]

The simulator runs as its own process and serves MAVLink on 14540 and the camera over HTTP, as `companion demo --udp` does. Printed:
the deviation of the gaps between setpoints from 20 ms (p50, p99, max), the time from the arrival of a frame to the first setpoint
after it was used (p50, p99), frames dropped, and the CPU share of this process. Two cores; other load on the machine shows.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from pathlib import Path

from rich.console import Console

from companion.config import Config
from companion.demo import DemoOptions
from companion.demo_udp import fly_demo_udp
from sitl_stub.scenario import load, with_overrides


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenario", default="line")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        world = {"duration_limit_s": str(options.seconds)}
        demo = DemoOptions(options.scenario, options.seed, Path(folder), show=False, keep=True)
        flown = with_overrides(load(options.scenario), {"duration_limit_s": options.seconds})
        cpu = time.process_time()
        figures = fly_demo_udp(options.scenario, world, flown, Config(), demo, Console(quiet=True))
        cpu_share = (time.process_time() - cpu) / figures["wall_s"]
    row = {**figures["setpoint_timing_ms"], "frame_to_setpoint_ms": figures["frame_to_setpoint_ms"]}
    row |= {"cpu_share": round(cpu_share, 3), "frames": figures["frames"], "frames_dropped": figures["frames_dropped"]}
    row |= {"outcome": figures["outcome"], "seed": options.seed, "scenario": options.scenario}
    if options.json:
        print(json.dumps(row))
        return
    for name, value in row.items():
        print(f"{name:24s} {value}")


if __name__ == "__main__":
    main()
