"""Setpoint timing with and without somebody watching: page with one viewer, MQTT with one broker. In turns, so that other load meets both.

    python benchmarks/watched_timing.py [--rounds 2] [--seconds 25]

Real UDP, real time, camera on, recorder on. Printed: deviation of the gaps between setpoints from 20 ms.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import msgspec
from rich.console import Console

from companion.config import Config, Dashboard, Mqtt
from companion.demo import DemoOptions
from companion.demo_udp import fly_demo_udp
from sitl_stub.scenario import load, with_overrides

PAGE_PORT, BROKER_PORT = 18081, 18831
TOKEN = "a-token-for-the-benchmark"
VIEWER = f"""
import time
from websockets.sync.client import connect
count = 0
while True:
    try:
        with connect("ws://127.0.0.1:{PAGE_PORT}/live", additional_headers={{"Authorization": "Bearer {TOKEN}"}}) as line:
            for _ in line:
                count += 1
    except OSError:
        pass
    except Exception:
        pass
    time.sleep(0.2)
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--seconds", type=float, default=25.0)
    options = parser.parse_args()
    for number in range(options.rounds):
        for is_watched in (False, True):
            row = fly(options.seconds, is_watched=is_watched)
            print(f"round {number + 1}, {'watched' if is_watched else 'alone  '}: {json.dumps(row)}", flush=True)


def fly(seconds: float, *, is_watched: bool) -> dict[str, object]:
    flown = with_overrides(load("line"), {"duration_limit_s": seconds})
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        config = stack.enter_context(watched(Path(folder))) if is_watched else Config()
        options = DemoOptions("line", 1, Path(folder), show=False, keep=True)
        figures = fly_demo_udp("line", {"duration_limit_s": str(seconds)}, flown, config, options, Console(quiet=True))
    return {
        **figures["setpoint_timing_ms"],
        "frames": figures["frames"],
        "outcome": figures["outcome"],
        "note": figures["final_note"],
    }


@contextlib.contextmanager
def watched(folder: Path) -> Iterator[Config]:
    """A configuration with page and broker on, and somebody at both."""
    token = folder / "token"
    token.write_text(TOKEN, encoding="ascii")
    broker = shutil.which("mosquitto", path="/usr/sbin:/usr/bin:/usr/local/sbin")
    commands = [[sys.executable, "-c", VIEWER]]
    commands += [[broker, "-p", str(BROKER_PORT)]] if broker else []
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    processes = [subprocess.Popen(command, **quiet) for command in commands]
    try:
        yield msgspec.structs.replace(
            Config(),
            dashboard=Dashboard(enabled=True, port=PAGE_PORT, token_file=str(token)),
            mqtt=Mqtt(enabled=broker is not None, port=BROKER_PORT),
        )
    finally:
        for process in processes:
            process.kill()
            process.wait()


if __name__ == "__main__":
    main()
