"""The simulated vehicle answers each recorded setpoint as the real PX4 did, within the limits that the recording itself allows."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
DATA = ROOT / "tests" / "data" / "px4"
FOLDERS = ("steps", "steps_lowdrag")
FILES = [(folder, path.stem) for folder in FOLDERS for path in sorted((DATA / folder).glob("*.csv"))]


def _fidelity(folder: str) -> dict[str, dict[str, Any]]:
    command = [sys.executable, str(ROOT / "benchmarks" / "px4_fidelity.py"), str(DATA / folder), "--json"]
    run = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)
    assert run.returncode in (0, 1), run.stderr
    return {row["name"]: row for row in json.loads(run.stdout)}


@pytest.fixture(scope="module")
def rows() -> dict[str, dict[str, dict[str, Any]]]:
    return {folder: _fidelity(folder) for folder in FOLDERS}


def test_every_recording_is_replayed(rows: dict[str, dict[str, dict[str, Any]]]) -> None:
    assert {(folder, name) for folder in FOLDERS for name in rows[folder]} == set(FILES)
    assert len(FILES) == 39


@pytest.mark.parametrize(("folder", "name"), FILES)
def test_response_stays_within_the_recordings_own_error(
    rows: dict[str, dict[str, dict[str, Any]]], folder: str, name: str
) -> None:
    row = rows[folder][name]
    assert row["nrmse"] <= row["allowed"] == pytest.approx((0.06**2 + row["floor"] ** 2) ** 0.5)


@pytest.mark.parametrize(("folder", "name"), [file for file in FILES if file[1][:3] in ("vx_", "vy_")])
def test_rise_tilt_and_reaction_of_large_steps_are_the_recorded_ones(
    rows: dict[str, dict[str, dict[str, Any]]], folder: str, name: str
) -> None:
    row = rows[folder][name]
    large = row["step"] >= 3.0 and "sine" not in name
    assert bool(row["rise"]) == large
    assert row["failures"] == []


def test_twelve_metres_a_second_is_followed_within_two_percent(rows: dict[str, dict[str, dict[str, Any]]]) -> None:
    assert rows["steps"]["vx_12"]["nrmse"] < 0.02
    assert rows["steps_lowdrag"]["vx_12"]["nrmse"] < 0.02
