"""A campaign flown in other processes, interrupted, resumed, and one of its flights repeated exactly."""

from __future__ import annotations

import io
import json
from pathlib import Path

import pytest
from rich.console import Console

from companion.campaign.command import rerun, run_campaign
from companion.campaign.results_file import stored_rows
from companion.campaign.summary import repeatable
from companion.replay import ReplayOptions, replay

TEXT = """
name = "short"
scenarios = ["line"]
seeds = 2
[world]
"place.pad_distance_m" = 3.0
"vehicle.start_height_m" = 6.0
"path.speed_m_s" = 0.5
"""

WHOLE_RUN_FOLDER = {"flight.tlog", "flight.mcap", "run.json", "config.json", "report.html", "landing.svg"}


@pytest.mark.timeout(300)
def test_a_flight_of_a_campaign_comes_out_the_same_to_the_last_byte(tmp_path: Path) -> None:
    path, out = tmp_path / "short.toml", tmp_path / "out"
    path.write_text(TEXT, encoding="utf-8")
    said = io.StringIO()
    console = Console(file=said, width=200)
    first = run_campaign(path, out=out, workers=2, scheduler=None, console=console, seeds=1)
    assert [cell["n"] for cell in first["cells"]] == [1]
    again = rerun(path, 0, console, out=out, runs=None)
    folder = Path(again.pop("run"))
    stored = stored_rows(out / "samples.jsonl")[0]
    assert json.dumps(repeatable(again)) == json.dumps(repeatable(stored))
    assert stored["outcome"] == "landed"
    assert "the same as in the campaign" in said.getvalue()
    assert (out / "report.html").stat().st_size > 2000
    assert 'href="sample-0/report.html"' in (out / "report.html").read_text(encoding="utf-8")
    assert {page.name for page in folder.iterdir()} == WHOLE_RUN_FOLDER
    assert all(file.stat().st_size > 100 for file in folder.iterdir())
    nothing = run_campaign(path, out=out, workers=2, scheduler=None, console=console, seeds=1)
    assert "0 of 1 flights to fly" in said.getvalue()
    assert nothing["cells"] == first["cells"]
    replayed = replay(folder / "flight.mcap", ReplayOptions())
    assert (replayed.mode, replayed.differing) == ("exact", 0)
