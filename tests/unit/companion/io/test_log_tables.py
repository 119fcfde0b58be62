"""`companion log`: every log becomes the same tables, files and pages; damage is counted and stops nothing."""

from __future__ import annotations

import csv
import json
import random
from pathlib import Path

import pyarrow.parquet
import pytest
from pymavlink import mavutil
from typer.testing import CliRunner, Result

from companion.cli import app
from companion.io.log_commands import export, info, plot
from companion.io.log_tables import LogError, flattened, read_log

ROOT = Path(__file__).parents[4]
TLOG = ROOT / "tests" / "data" / "px4" / "refused_modes.tlog"
MCAP = ROOT / "tests" / "replay" / "line.mcap"


def invoked(*arguments: object) -> Result:
    return CliRunner().invoke(app, ["log", *map(str, arguments)])


@pytest.mark.parametrize(("path", "topic"), [(TLOG, "ODOMETRY"), (MCAP, "/vehicle_state")])
def test_info_counts_what_is_there(path: Path, topic: str) -> None:
    found = info(path)
    assert found["damage"] == "none"
    assert found["topics"][topic]["count"] == len(read_log(path).table(topic).t_s)
    assert found["topics"][topic]["rate_hz"] == pytest.approx(
        found["topics"][topic]["count"] / found["duration_s"], rel=0.01
    )
    assert json.loads(invoked("info", path, "--json").stdout) == found
    assert topic in invoked("info", path).stdout


def test_tables_of_a_telemetry_log_hold_what_pymavlink_reads() -> None:
    log = mavutil.mavlink_connection(str(TLOG), dialect="development")
    theirs = []
    while (message := log.recv_match(type="ODOMETRY")) is not None:
        theirs.append((message.x, message.q[3], message.get_srcComponent()))
    log.close()
    table = read_log(TLOG).table("ODOMETRY")
    ours = list(zip(table.columns["x"], table.columns["q[3]"], table.columns["component"], strict=True))
    assert ours == theirs
    assert len(ours) > 50


def test_csv_holds_every_row_and_every_number_exactly(tmp_path: Path) -> None:
    (written,) = export(MCAP, tmp_path, topics=["Vehicle_State"])
    with written.open(newline="") as file:
        rows = list(csv.DictReader(file))
    table = read_log(MCAP).table("/vehicle_state")
    assert len(rows) == len(table.t_s) > 1000
    assert [float(row["position_ned_m[2]"]) for row in rows] == table.columns["position_ned_m[2]"]
    assert float(rows[-1]["t_s"]) == pytest.approx(table.t_s[-1], abs=1e-6)


def test_one_file_for_each_message_type(tmp_path: Path) -> None:
    done = invoked("export", TLOG, "--out", tmp_path)
    assert done.exit_code == 0
    assert {file.stem for file in tmp_path.iterdir()} == set(read_log(TLOG).counts)


def test_parquet_without_pyarrow_says_what_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pyarrow", None)
    done = invoked("export", TLOG, "--out", tmp_path, "--format", "parquet")
    assert done.exit_code == 2
    assert "pip install 'companion[parquet]'" in done.stderr


@pytest.mark.parametrize("log", [MCAP, TLOG], ids=lambda path: path.suffix)
def test_parquet_holds_what_the_csv_holds(log: Path, tmp_path: Path) -> None:
    content = read_log(log)
    tables = {name.strip("/").replace("/", "_"): content.table(name) for name in content.counts}
    for written in export(log, tmp_path, form="parquet"):
        read = pyarrow.parquet.read_table(written)
        table = tables[written.stem]
        assert read.column_names == ["t_s", *table.columns]
        assert read.num_rows == len(table.t_s)
        for name, values in table.columns.items():
            assert repr(read[name].to_pylist()) == repr(values), name  # not a number is equal to itself


def test_an_array_that_is_sometimes_null_is_columns_of_its_elements_only() -> None:
    names = read_log(MCAP).table("/vehicle_status").columns
    assert "home_position_ned_m[0]" in names
    assert "home_position_ned_m" not in names


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("export", TLOG, "--topic", "NO_SUCH", "--out", "x"), "NO_SUCH"),
        (("export", TLOG, "--format", "xlsx", "--out", "x"), "xlsx"),
        (("plot", TLOG, "ODOMETRY.nothing"), "nothing"),
        (("plot", TLOG, "ODOMETRY"), "MESSAGE.FIELD"),
        (("info", "no_such.tlog"), "no_such.tlog"),
        (("info", "setup.cfg"), "not a log"),
    ],
)
def test_requests_that_cannot_be_met_are_refused_with_a_reason(arguments: tuple[object, ...], told: str) -> None:
    done = invoked(*arguments)
    assert done.exit_code == 2
    assert told in done.stderr


def test_a_plot_draws_every_element_and_needs_no_network(tmp_path: Path) -> None:
    page = plot(TLOG, ["ODOMETRY.q", "ODOMETRY.x", "HEARTBEAT.custom_mode"], tmp_path / "p.html").read_text()
    assert page.count("<svg") == 2
    assert all(f"q[{i}]" in page for i in range(4))
    assert "http" not in page
    assert "nan" not in page


def test_damaged_logs_are_read_as_far_as_they_go(tmp_path: Path) -> None:
    rng = random.Random(11)
    for source, chunk in ((TLOG, 20), (MCAP, 5)):
        data = source.read_bytes()
        for i in range(chunk):
            damaged = bytearray(data[: rng.randrange(8, len(data))] if i % 2 else data)
            for _ in range(rng.randrange(1, 30)):
                damaged[rng.randrange(8, len(damaged))] ^= 1 << rng.randrange(8)
            path = tmp_path / f"damaged{source.suffix}"
            path.write_bytes(bytes(damaged))
            found = info(path)
            assert found["messages"] >= 0
            assert found["duration_s"] < 1000.0


def test_flattened_names_are_paths() -> None:
    assert dict(flattened({"a": [1, {"b": None}], "c": "x"})) == {"a[0]": 1, "a[1].b": None, "c": "x"}


def test_an_unknown_log_names_the_known_ones() -> None:
    with pytest.raises(LogError, match=r"\.tlog, \.mcap, \.ulg"):
        read_log(Path("flight.bag"))
