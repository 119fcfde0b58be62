"""Feed one reader with damaged input for a while.

    python tests/fuzz/fuzz.py session --seconds 60 [--seed 1]      session, tlog, config
    python tests/fuzz/fuzz.py config --seed 1 --only 4711          one input again

Input k of a seed is always the same. Bounds: ten seconds for one input, `--memory-mb` of address space above what the program has
after loading, and no more than a tenth of that kept between the first tenth of the time and the end. A finding is kept in runs/fuzz,
printed with the line that repeats it, and ends the run with status 1.
"""

from __future__ import annotations

import argparse
import gc
import random
import resource
import signal
import sys
import time
import traceback
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
from targets import TARGETS, Target

FINDINGS = Path("runs/fuzz")
LONGEST_S = 10
PAGE_BYTES = resource.getpagesize()


class Hang(Exception):
    """One input took too long."""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("target", choices=TARGETS)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--inputs", type=int, default=None, help="stop after so many, however long that takes")
    parser.add_argument("--only", type=int, default=None, help="this input alone")
    parser.add_argument("--memory-mb", type=int, default=512)
    options = parser.parse_args()
    target = TARGETS[options.target]
    seeds = target.seeds()
    bound_memory(options.memory_mb)
    signal.signal(signal.SIGALRM, on_alarm)
    if options.only is not None:
        return int(not try_one(target, seeds, options.seed, options.only))
    return run(target, seeds, options)


def run(target: Target, seeds: object, options: argparse.Namespace) -> int:
    began = time.monotonic()
    number, early_kb = 0, 0
    while time.monotonic() - began < options.seconds and (options.inputs is None or number < options.inputs):
        if not try_one(target, seeds, options.seed, number):
            return 1
        number += 1
        if not early_kb and time.monotonic() - began > 0.1 * options.seconds:
            early_kb = resident_kb()
    took_s = time.monotonic() - began
    grown_kb = resident_kb() - early_kb if early_kb else 0
    print(
        f"{target.name}: {number} inputs in {took_s:.0f} s, seed {options.seed}, nothing found; grown by {grown_kb} KB"
    )
    if grown_kb > 1024 * options.memory_mb // 10:
        print(f"{target.name}: memory grows", file=sys.stderr)
        return 1
    return 0


def try_one(target: Target, seeds: object, seed: int, number: int) -> bool:
    """Whether input `number` is survived."""
    data = target.make(seeds, random.Random(f"{target.name}-{seed}-{number}"))  # type: ignore[arg-type]
    signal.alarm(LONGEST_S)
    try:
        target.run(data)
    except Exception:
        signal.alarm(0)
        report(target, seed, number, data)
        return False
    finally:
        signal.alarm(0)
    return True


def report(target: Target, seed: int, number: int, data: bytes) -> None:
    FINDINGS.mkdir(parents=True, exist_ok=True)
    kept = FINDINGS / f"{target.name}-{seed}-{number}.bin"
    kept.write_bytes(data)
    traceback.print_exc()
    print(f"input kept in {kept}; again: python tests/fuzz/fuzz.py {target.name} --seed {seed} --only {number}")


def bound_memory(megabytes: int) -> None:
    """Of address space above what is mapped now: one input that asks for more gets a MemoryError, which is a finding."""
    mapped = int(Path("/proc/self/statm").read_text().split()[0]) * PAGE_BYTES
    limit = mapped + megabytes * 1024 * 1024
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


def resident_kb() -> int:
    gc.collect()
    return int(Path("/proc/self/statm").read_text().split()[1]) * PAGE_BYTES // 1024


def on_alarm(number: int, frame: object) -> None:
    raise Hang(f"one input took more than {LONGEST_S} s")


if __name__ == "__main__":
    sys.exit(main())
