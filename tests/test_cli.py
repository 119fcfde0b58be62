"""The commands as a user types them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator
from mcap.reader import make_reader
from typer.testing import CliRunner, Result

from companion.campaign.runner import OUTCOMES
from companion.campaign.summary import WALL_KEYS
from companion.cli import app
from companion.reproduce.papers import PAPERS
from companion.reproduce.row import Reproduction, number_row

DOCUMENTED_KEYS = {
    "outcome",
    "seed",
    "scenario",
    "touchdown_error_m",
    "touchdown_relative_speed_horizontal_m_s",
    "touchdown_relative_speed_vertical_m_s",
    "time_to_touchdown_s",
    "simulated_s",
    "wall_s",
    "forced_disarm_in_air",
}
SHORT = ("--world", "duration_limit_s=5")


def invoked(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments))


def demo(runs: Path, *arguments: str) -> tuple[dict[str, Any], Path, int]:
    result = invoked("demo", "--json", "--runs", str(runs), *arguments)
    figures = json.loads(result.stdout.strip().splitlines()[-1])
    return figures, Path(figures["run"]), result.exit_code


def test_demo_lands_ends_with_one_json_line_and_keeps_a_run_folder(tmp_path: Path) -> None:
    figures, folder, status = demo(tmp_path, "--scenario", "line", "--seed", "4")
    assert status == 0
    assert figures["outcome"] == "landed"
    assert set(figures) >= DOCUMENTED_KEYS
    kept = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    assert {key: kept[key] for key in figures} == figures
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "http" not in page.replace("http://www.w3.org", "")
    assert len(page) < 3_000_000
    assert (folder / "flight.tlog").stat().st_size > 100_000
    with (folder / "flight.mcap").open("rb") as file:
        messages = [*make_reader(file, validate_crcs=True).iter_messages()]
    validators = {schema.id: Draft202012Validator(json.loads(schema.data)) for schema, _, _ in messages if schema}
    assert len(messages) > 5000
    assert {channel.topic for _, channel, _ in messages} > {"/pad_estimate", "/camera/down", "/truth", "/plan_made"}
    for schema, channel, message in messages:
        assert schema is not None
        assert validators[schema.id].is_valid(json.loads(message.data)), channel.topic


def test_same_seed_same_bytes(tmp_path: Path) -> None:
    first, first_folder, _ = demo(tmp_path, "line", "--seed", "9", *SHORT)
    second, second_folder, _ = demo(tmp_path, "line", "--seed", "9", *SHORT)
    assert (first_folder / "flight.tlog").read_bytes() == (second_folder / "flight.tlog").read_bytes()
    ignored = {*WALL_KEYS, "run"}
    assert {k: v for k, v in first.items() if k not in ignored} == {k: v for k, v in second.items() if k not in ignored}


def test_another_seed_is_another_flight(tmp_path: Path) -> None:
    _, first, _ = demo(tmp_path, "line", "--seed", "9", *SHORT)
    _, second, _ = demo(tmp_path, "line", "--seed", "10", *SHORT)
    assert (first / "flight.tlog").read_bytes() != (second / "flight.tlog").read_bytes()


def test_a_flight_that_does_not_land_has_another_exit_status_and_a_documented_outcome(tmp_path: Path) -> None:
    figures, _, status = demo(tmp_path, "line", *SHORT)
    assert status == 1
    assert figures["outcome"] in OUTCOMES
    assert figures["touchdown_error_m"] is None


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("demo", "nowhere"), ["nowhere", "line"]),
        (("demo", "--set", "control.gain=1"), ["[control] gain", "allowed"]),
        (("demo", "--set", "control.rate_hz"), ["KEY=VALUE"]),
        (("demo", "--world", "wind.mean=1"), ["wind", "mean"]),
        (("check-config", "-c", "nothing.toml"), ["nothing.toml", "cannot be read"]),
        (("campaign", "rerun"), ["--sample"]),
    ],
)
def test_a_wrong_argument_is_explained_on_one_screen_with_status_2(
    arguments: tuple[str, ...], words: list[str]
) -> None:
    result = invoked(*arguments)
    assert result.exit_code == 2
    assert not [word for word in words if word not in result.stderr], result.stderr
    assert "Traceback" not in result.output


def test_check_config_prints_the_whole_configuration() -> None:
    result = invoked("check-config", "--set", "mission.commit_height_m=0.6")
    assert json.loads(result.stdout)["mission"]["commit_height_m"] == 0.6


def test_every_outcome_is_documented() -> None:
    text = (Path(__file__).parents[1] / "docs" / "running.md").read_text(encoding="utf-8")
    assert not [outcome for outcome in OUTCOMES if f"`{outcome}`" not in text]


def test_reproduce_prints_a_table_and_writes_its_pages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = (number_row("Table I", "length", 17.114, 17.1139, "m", 0.001),)
    made = Reproduction("shivam", "A paper", rows, (), ("A misprint.",), ("One flight.",))
    asked: list[bool] = []
    monkeypatch.setitem(PAPERS, "shivam", lambda quick: asked.append(quick) or made)  # type: ignore[func-returns-value]
    result = invoked("reproduce", "shivam", "--quick", "--json", "--out", str(tmp_path))
    assert result.exit_code == 0, result.output
    assert asked == [True]
    figures = json.loads(result.stdout.strip().splitlines()[-1])["papers"]["shivam"]
    assert figures["verdicts"] == {"same": 1}
    assert figures["rows"][0]["printed"] == 17.114
    assert "Table I" in result.output
    assert "A misprint." in (tmp_path / "shivam.md").read_text(encoding="utf-8")
    assert "companion reproduce shivam --quick" in (tmp_path / "shivam.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("reproduce", "newton"), "allowed: shivam, falanga, guo, kim, dalang"),
        (("reproduce", "newton", "--versus"), "allowed: shivam, falanga, guo, kim, dalang"),
        (("demo", "--preset", "newton"), "shivam"),
        (("run", "--preset", "newton"), "shivam"),
    ],
)
def test_a_paper_that_is_none_is_refused_with_those_that_are(arguments: tuple[str, ...], told: str) -> None:
    result = invoked(*arguments)
    assert result.exit_code == 2
    assert told in result.output


def test_demo_flies_a_preset_in_its_own_scenario_and_a_setting_still_counts(tmp_path: Path) -> None:
    arguments = ("--preset", "shivam", "--set", "planning.bezier_ratio=0.3", *SHORT)
    figures, folder, _ = demo(tmp_path, *arguments)
    assert figures["scenario"] == "shivam"
    kept = json.loads((folder / "config.json").read_text(encoding="utf-8"))
    assert kept["planning"]["planner"] == "bezier"
    assert kept["planning"]["bezier_ratio"] == 0.3
