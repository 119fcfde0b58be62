"""The report of a campaign: a map square says what the table says, the worst runs come with a command that works."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from companion.campaign.campaign_file import load_campaign, samples
from companion.campaign.command import compared, sample_of, statistics_of
from companion.campaign.report import campaign_report, envelope_maps
from companion.telemetry.heat_map import colour

TEXT = """
name = "wind"
scenarios = ["line", "circle"]
seeds = 4
[axes]
"path.speed_m_s" = [1.0, 2.0]
"wind.mean_m_s" = [0.0, 6.0, 12.0]
[variants]
ours = []
"""


def row(index: int, cell: str, seed: int) -> dict[str, Any]:
    """Every fourth seed fails in wind of 12 m/s."""
    failed = "wind.mean_m_s=12.0" in cell and seed == 4
    return {
        "sample": index,
        "cell": cell,
        "seed": seed,
        "outcome": "slid_off" if failed else "landed",
        "touchdown_error_m": 0.9 if failed else 0.1,
        "touchdown_error_along_m": -0.9 if failed else 0.1,
        "touchdown_error_across_m": 0.0,
        "touchdown_relative_speed_horizontal_m_s": 0.1,
        "touchdown_relative_speed_vertical_m_s": 0.6,
        "time_to_touchdown_s": 17.0,
        "real_time_factor": 4.0,
        "forced_disarm_in_air": False,
        "go_arounds": 1 if failed else 0,
        "final_phase": "done",
    }


@pytest.fixture
def campaign_path(tmp_path: Path) -> Path:
    path = tmp_path / "wind.toml"
    path.write_text(TEXT, encoding="utf-8")
    return path


def test_a_map_has_a_square_for_each_combination(campaign_path: Path) -> None:
    campaign = load_campaign(campaign_path)
    rows = {one.index: row(one.index, one.cell, one.seed) for one in samples(campaign)}
    maps = envelope_maps(campaign, statistics_of(campaign, rows))
    assert [chart.title for chart in maps] == [
        "Landed, variant ours, scenario line",
        "Landed, variant ours, scenario circle",
    ]
    assert (maps[0].x_label, maps[0].y_label) == ("path.speed_m_s", "wind.mean_m_s")
    assert len(maps[0].squares) == 6
    assert maps[0].squares[1, 2].text == "75%"
    assert maps[0].squares[1, 2].detail == "30.1 to 95.4 %, 4"
    assert maps[0].squares[1, 1].fraction == 1.0


def test_worst_runs_stand_first_with_the_command_that_repeats_them(campaign_path: Path) -> None:
    campaign = load_campaign(campaign_path)
    rows = {one.index: row(one.index, one.cell, one.seed) for one in samples(campaign)}
    page = campaign_report(campaign, campaign_path, rows, statistics_of(campaign, rows))
    commands = re.findall(r"companion campaign rerun (\S+) --sample (\d+)", page)
    assert len(commands) == 20
    first = sample_of(Path(commands[0][0]), int(commands[0][1]))
    assert (first.seed, first.world["wind.mean_m_s"]) == (4, 12.0)
    assert "44 of 48 flights landed" in page


def test_the_page_needs_nothing_from_elsewhere(campaign_path: Path) -> None:
    campaign = load_campaign(campaign_path)
    some = {one.index: row(one.index, one.cell, one.seed) for one in list(samples(campaign))[:5]}
    page = campaign_report(campaign, campaign_path, some, statistics_of(campaign, some))
    assert not re.search(r"(src|href)=|https?://|<script", page)


def test_a_campaign_without_a_single_flight_has_a_report_too(campaign_path: Path) -> None:
    assert "0 of 0 flights" in campaign_report(load_campaign(campaign_path), campaign_path, {}, [])


def test_red_is_bad_and_green_is_good() -> None:
    assert (colour(0.2), colour(1.0)) == ("#dc2626", "#16a34a")


def test_a_repeated_flight_is_compared_figure_by_figure() -> None:
    before = row(0, "line", 1)
    assert compared(before, {**before, "real_time_factor": 9.0}).startswith("the same")
    assert "touchdown_error_m 0.1 -> 0.2" in compared(before, {**before, "touchdown_error_m": 0.2})
