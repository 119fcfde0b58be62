"""How fast `companion replay` goes: processor seconds a log, apart from loading the program.

    companion demo line --seed 3 --json
    python benchmarks/replay.py runs/line-3/flight.mcap

Processor time, because wall time on a busy machine tells of the machine. The loading of machine code (the extra `fast`) and of
the program is told apart: it is the same for a log of an hour.
"""

from __future__ import annotations

import argparse
import time

STARTED_S = time.process_time()

from pathlib import Path  # noqa: E402

from companion.compiled import COMPILED  # noqa: E402
from companion.estimation.kalman import warm_up  # noqa: E402
from companion.replay import ReplayOptions, replay  # noqa: E402


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("logs", nargs="+", type=Path)
    parser.add_argument("--times", type=int, default=5, help="replays of each log; the first and the best are shown")
    arguments = parser.parse_args()
    imported_s = time.process_time()
    warm_up()
    print(f"import {imported_s - STARTED_S:.2f} s, machine code {time.process_time() - imported_s:.2f} s, ", end="")
    print(f"kernels {'compiled' if COMPILED else 'plain'}")
    for log in arguments.logs:
        taken = []
        for _ in range(arguments.times):
            before_s = time.process_time()
            result = replay(log, ReplayOptions())
            taken.append(time.process_time() - before_s)
        first, best = (result.log_s / seconds for seconds in (taken[0], min(taken)))
        print(
            f"{log}: {result.log_s:.1f} s of log, first {taken[0]:.2f} s ({first:.0f} x), best {min(taken):.2f} s ",
            end="",
        )
        print(f"({best:.0f} x), {result.mode}, {result.differing} of {result.compared} outputs differ")


if __name__ == "__main__":
    main()
