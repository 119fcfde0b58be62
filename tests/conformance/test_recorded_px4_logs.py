"""Recorded logs of a real PX4 go through `log info`, `replay` and `report` without an error, in seconds.

The logs in tests/data/px4 are pieces; whole ones (.tlog, .ulg) are looked for in the folder that COMPANION_PX4_LOGS names, where
the fast reader is also compared with pymavlink message by message.
"""

from __future__ import annotations

import json
import math
import os
import time
from pathlib import Path
from typing import Any

import pytest
from pymavlink import mavutil
from typer.testing import CliRunner, Result

from companion.cli import app
from companion.io.tlog_columns import TlogColumns

PIECES = sorted((Path(__file__).resolve().parents[1] / "data" / "px4").glob("*.tlog"))
FOLDER = os.environ.get("COMPANION_PX4_LOGS", "")
WHOLE = sorted(p for p in Path(FOLDER).glob("*") if p.suffix in (".tlog", ".ulg")) if FOLDER else []
UNKNOWN = {"EVENT", "CURRENT_EVENT_SEQUENCE", "LINK_NODE_STATUS", "TIME_ESTIMATE_TO_TARGET"}
"""To mavutil's usual dialect."""
NONE_HERE = pytest.param(None, marks=pytest.mark.skip(reason="COMPANION_PX4_LOGS names no folder of whole logs"))
pytestmark = pytest.mark.timeout(300)


def run(*arguments: str) -> Result:
    result = CliRunner().invoke(app, list(arguments))
    assert result.exit_code == 0, f"{arguments}: {result.output}{result.stderr}"
    return result


def go_through(log: Path, tmp_path: Path) -> dict[str, Any]:
    """All three; what the replay says."""
    found = json.loads(run("log", "info", str(log), "--json").stdout)
    assert found["messages"] > 1000
    assert found["duration_s"] > 5.0
    replayed: dict[str, Any] = json.loads(run("replay", str(log), "--json").stdout)
    page = tmp_path / "page.html"
    run("report", str(log), "--out", str(page))
    assert 20_000 < page.stat().st_size < 3_000_000
    return replayed


@pytest.mark.parametrize("log", PIECES, ids=lambda log: log.stem)
def test_a_piece_of_a_recorded_log(log: Path, tmp_path: Path) -> None:
    assert go_through(log, tmp_path)["figures"]["vehicle_states"] > 100


@pytest.mark.parametrize("log", WHOLE or [NONE_HERE], ids=lambda log: getattr(log, "name", "none"))
def test_a_whole_recorded_log(log: Path, tmp_path: Path) -> None:
    if log.suffix == ".ulg":
        pytest.importorskip("pyulog", reason="the ulog extra is not installed")
    began_s = time.perf_counter()
    replayed = go_through(log, tmp_path)
    assert time.perf_counter() - began_s < 120.0
    assert replayed["log_s"] > 10.0
    assert replayed["damage"] == "none"


@pytest.mark.parametrize(
    "log", [log for log in WHOLE if log.suffix == ".tlog"] or [NONE_HERE], ids=lambda log: getattr(log, "name", "none")
)
def test_the_fast_reader_agrees_with_pymavlink_on_a_whole_log(log: Path) -> None:
    columns = TlogColumns(log.read_bytes())
    at = dict.fromkeys(columns, 0)
    reader = mavutil.mavlink_connection(str(log))
    while (message := reader.recv_msg()) is not None:
        name = message.get_type()
        if name == "BAD_DATA" or name not in columns:
            continue
        table, index = columns[name], at[name]
        at[name] += 1
        for field in message.get_fieldnames():
            assert same(getattr(message, field), table[field][index].tolist()), f"{name}[{index}].{field}"
    reader.close()
    assert {name: n for name, n in at.items() if n} == {n: len(t) for n, t in columns.items() if n not in UNKNOWN}


def same(one: Any, other: Any) -> bool:
    if isinstance(one, str):
        text = other if isinstance(other, bytes) else bytes(other) if isinstance(other, list) else str(other).encode()
        return text.split(b"\0")[0].decode("utf-8", "replace") == one
    if isinstance(one, (list, tuple)):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, float) and math.isnan(one):
        return isinstance(other, float) and math.isnan(other)
    return bool(one == other)
