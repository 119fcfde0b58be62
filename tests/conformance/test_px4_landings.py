"""Recorded take-offs and landings, flown again by the whole autopilot: the vertical motion is the recorded one until touchdown."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "benchmarks"))

from px4_fidelity import airframe_for  # noqa: E402
from px4_landing import FlightReplay, order_of, read_flight, start_and_ground_z_m  # noqa: E402

FOLDER = ROOT / "tests" / "data" / "px4" / "land"

NAMES = sorted(path.stem for path in FOLDER.glob("*.csv"))


def _table(*options: str) -> dict[str, dict[str, Any]]:
    command = [sys.executable, str(ROOT / "benchmarks" / "px4_fidelity.py"), str(FOLDER), "--json", *options]
    run = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)
    assert run.returncode in (0, 1), run.stderr
    return {row["name"]: row for row in json.loads(run.stdout)}


@pytest.fixture(scope="module")
def rows() -> dict[str, dict[str, Any]]:
    return _table()


@pytest.fixture(scope="module")
def rows_with_error() -> dict[str, dict[str, Any]]:
    return _table("--recorded-error")


@pytest.fixture(scope="module")
def rows_of_truth() -> dict[str, dict[str, Any]]:
    return _table("--own-horizontal")


def test_every_recording_is_flown(rows: dict[str, dict[str, Any]]) -> None:
    assert sorted(rows) == NAMES
    assert len(NAMES) == 14


@pytest.mark.parametrize("name", NAMES)
def test_vertical_motion_stays_within_the_recordings_own_error(rows: dict[str, dict[str, Any]], name: str) -> None:
    assert rows[name]["nrmse"] <= rows[name]["allowed"]


@pytest.mark.parametrize("name", NAMES)
def test_with_the_recorded_error_of_the_estimate_as_input_every_file_is_within_its_limits(
    rows_with_error: dict[str, dict[str, Any]], name: str
) -> None:
    """What differs without it is the estimator's doing, not the controller's."""
    row = rows_with_error[name]
    assert row["nrmse"] <= row["allowed"]
    assert row["nrmse"] < 0.1


def test_a_landing_is_noticed_late_where_the_recorded_estimate_says_that_the_vehicle_moves(
    rows: dict[str, dict[str, Any]], rows_with_error: dict[str, dict[str, Any]]
) -> None:
    """20 s after touchdown, recorded, at 0.3 m/s with range sensor; meanwhile the hover thrust estimate fell, and with it the threshold."""
    after = rows_with_error["offland_0.3_rng"]["rise"]["on_ground_after_s"]
    assert after["stub"] == pytest.approx(after["recorded"], rel=0.1)
    assert after["stub"] > 2.0 * rows["offland_0.3_rng"]["rise"]["on_ground_after_s"]["stub"]


@pytest.mark.parametrize("name", ["offland_1.0_rng", "offland_1.0_norng", "autoland_rng", "land_auto_flight"])
def test_ground_is_noticed_as_long_after_touchdown_as_recorded(rows: dict[str, dict[str, Any]], name: str) -> None:
    after = rows[name]["rise"]["on_ground_after_s"]
    assert after["stub"] == pytest.approx(after["recorded"], rel=0.1)


@pytest.mark.parametrize("name", ["offland_0.3_norng", "offland_0.5_rng"])
def test_a_slow_descent_is_noticed_late_because_the_thrust_falls_slowly(
    rows: dict[str, dict[str, Any]], name: str
) -> None:
    after = rows[name]["rise"]["on_ground_after_s"]
    assert after["stub"] == pytest.approx(after["recorded"], rel=0.25)


@pytest.mark.parametrize("name", ["takeoff_auto", "takeoff_arm_first"])
def test_an_automatic_take_off_comes_later_because_the_horizontal_estimate_wanders_while_the_vehicle_stands(
    rows: dict[str, dict[str, Any]], rows_of_truth: dict[str, dict[str, Any]], name: str
) -> None:
    """The trajectory's time runs slower then, the climb's too."""
    assert rows[name]["nrmse"] < rows_of_truth[name]["nrmse"]


def test_a_landing_with_range_sensor_nearly_stops_when_it_begins_to_creep() -> None:
    """The point's speed falls to MPC_LAND_CRWL while the vehicle, held back horizontally, is ahead of its height."""
    recorded = read_flight(FOLDER / "autoland_rng.csv")
    order = order_of("autoland_rng")
    replay = FlightReplay(order, airframe_for(FOLDER), *start_and_ground_z_m(order, recorded), recorded)
    flown = replay.run(float(recorded.t_s[-1]))
    slowest = [float(np.nanmin(f.vz_m_s[(f.height_m < 1.0) & (f.height_m > 0.4)])) for f in (recorded, flown)]
    assert slowest[1] < 0.2
    assert slowest[0] < 0.2
