"""Each loop of the cascade gives what the real PX4 gave for the same input, row by row from its own log.

attitude_loop.csv: estimated attitude, attitude setpoint of 4 ms before, heading rate, and the rate setpoint that came of them.
acceleration_to_thrust.csv: acceleration setpoint, estimated hover thrust (10 Hz, interpolated) and thrust vector. mixer.csv: thrust and torque
setpoint and motor commands. All from one flight of PX4 v1.17.0, software in the loop (SIH), hover, velocity steps and landing.
"""

from __future__ import annotations

import csv
from math import radians
from pathlib import Path

import pytest

from sitl_stub.autopilot.attitude_control import attitude_gains, control_attitude
from sitl_stub.autopilot.mixer import mix
from sitl_stub.autopilot.parameters import Parameters
from sitl_stub.autopilot.position_control import UNSET_MOTION, Motion, PositionLimits, control_position, position_gains

DATA = Path(__file__).parents[1] / "data" / "px4"
PX4 = Parameters().as_mapping()


def _rows(name: str) -> list[dict[str, float]]:
    with (DATA / name).open(encoding="ascii", newline="") as file:
        return [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]


def test_attitude_loop_asks_for_the_recorded_rates() -> None:
    gains, rows = attitude_gains(PX4), _rows("attitude_loop.csv")
    assert len(rows) > 40
    for r in rows:
        rates = control_attitude(
            (r["qw"], r["qx"], r["qy"], r["qz"]), (r["dw"], r["dx"], r["dy"], r["dz"]), r["yaw_rate"], gains
        )
        assert rates == pytest.approx((r["p"], r["q"], r["r"]), abs=2e-5)


def test_acceleration_becomes_the_recorded_thrust_vector() -> None:
    rows = _rows("acceleration_to_thrust.csv")
    limits = PositionLimits(12.0, 3.0, 1.5, radians(45.0), 0.12, 1.0)
    assert len(rows) > 40
    for r in rows:
        asked = UNSET_MOTION._replace(ax=r["ax"], ay=r["ay"], az=r["az"])
        demand = control_position(
            asked, Motion(*(0.0,) * 9), (0.0, 0.0, 0.0), r["hover_thrust"], position_gains(PX4), limits, 0.008
        )
        assert (demand.tx, demand.ty, demand.tz) == pytest.approx((r["tx"], r["ty"], r["tz"]), abs=1e-3)


def test_mixer_gives_the_recorded_motors() -> None:
    rows = _rows("mixer.csv")
    assert len(rows) > 40
    for r in rows:
        motors, _ = mix(r["thrust"], (r["roll"], r["pitch"], r["yaw"]))
        assert motors == pytest.approx((r["m1"], r["m2"], r["m3"], r["m4"]), abs=2e-6)
