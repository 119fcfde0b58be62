"""A short run of each fuzz target; .ci/run gives each a minute. And what fuzzing has found, for ever."""

from __future__ import annotations

import random
import subprocess
import sys
from pathlib import Path

import pytest
from mutation import DAMAGES, mutated
from targets import PX4, TARGETS

from companion.config import Link
from companion.io.log_inputs import tlog_inputs
from companion.io.tlog import read_frames

FUZZ = Path(__file__).with_name("fuzz.py")


@pytest.mark.parametrize(("target", "inputs"), [("session", 300), ("tlog", 25), ("config", 300)])
def test_damaged_input_is_survived(target: str, inputs: int) -> None:
    command = [sys.executable, str(FUZZ), target, "--seed", "7", "--inputs", str(inputs), "--seconds", "240"]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=280, check=False)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert f"{inputs} inputs" in ended.stdout


def test_an_input_can_be_made_again() -> None:
    for target in TARGETS.values():
        seeds = target.seeds()
        assert target.make(seeds, random.Random("x")) == target.make(seeds, random.Random("x"))


def test_damage_is_done() -> None:
    data = bytes(range(256))
    changed = sum(mutated(data, random.Random(k), [b"spare"]) != data for k in range(100))
    assert changed > 95
    assert len(DAMAGES) > 5


def log_with_stamps(folder: Path, stamps_us: list[int]) -> Path:
    frames = [frame for _, frame in list(read_frames(PX4 / "takeoff_land.tlog"))[: len(stamps_us)]]
    path = folder / "odd.tlog"
    path.write_bytes(b"".join(t.to_bytes(8, "big") + f for t, f in zip(stamps_us, frames, strict=True)))
    return path


def test_a_pause_of_years_is_passed_over_at_once(tmp_path: Path) -> None:
    began_us = 1_000_000
    stamps = [began_us + 1000 * i for i in range(20)] + [began_us + 10**15 + 1000 * i for i in range(20)]
    found = tlog_inputs(log_with_stamps(tmp_path, stamps), Link())
    assert len(list(found.messages)) < 200


def test_a_stamp_from_beyond_the_century_is_damage(tmp_path: Path) -> None:
    began_us = 1_700_000_000_000_000
    stamps = [began_us + 1000 * i for i in range(20)] + [2**64 - 1 - i for i in range(20)]
    found = tlog_inputs(log_with_stamps(tmp_path, stamps), Link())
    assert list(found.messages)
    assert found.skipped >= 20
