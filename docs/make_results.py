"""Writes docs/results.md and the results table of the README from flown campaigns.

    companion campaign configs/campaigns/first-landing.toml [--seeds 100]        # flies what is missing
    python docs/make_results.py COMMIT configs/campaigns/first-landing.toml [more.toml ...]
    python docs/make_results.py COMMIT --add configs/campaigns/faults.toml     # these sections alone; the rest stays

COMMIT is the one that was checked out when the flights were flown. Each file's results are read from runs/campaign-<name>; what
counts is the first so many seeds that every combination of the file has flown, and how many that is stands in the tables.
Nothing here is typed by hand but what is wanted.
"""

from __future__ import annotations

import os
import platform
import sys
from dataclasses import dataclass
from pathlib import Path

from companion.campaign.campaign_file import Campaign, load_campaign, samples
from companion.campaign.command import results_folder, statistics_of
from companion.campaign.results_file import stored_rows
from companion.campaign.statistics import CellStatistics

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "docs" / "results.md"
BEGIN, END = "<!-- results:begin -->", "<!-- results:end -->"
HEAD = (
    "| flight | n | landed | 95 % interval | error mean / p50 / p95 m | across p95 m/s | down p95 m/s | tilt p95 deg "
    "| sight to touchdown p50 s | in the air | down in no-land zone |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n"
)
SHORT_HEAD = (
    "| flight | wanted | landed of n | 95 % interval | error mean / p95 m | across / down p95 m/s |\n"
    "| --- | --- | --- | --- | --- | --- |\n"
)


@dataclass(frozen=True)
class Headline:
    """A cell of a campaign that the README shows: what it is for people, and what is wanted of it."""

    campaign: str
    cell: str
    text: str
    wanted: str


HEADLINES = (
    Headline("first-landing", "line", "line, 1.5 m/s", ""),
    Headline("first-landing", "circle", "circle of 6 m radius, 1.5 m/s", ""),
    Headline("first-landing", "figure8", "figure-8, 1.5 m/s", ""),
    Headline("line_speeds", "line path.speed_m_s=4.2", "line, 4.2 m/s", "p95 <= 0.12 m"),
    Headline("line_fast", "truck path.speed_m_s=8.0", "truck, 8 m/s", ""),
    Headline("line_fast", "truck path.speed_m_s=15.0", "truck, 15 m/s (54 km/h)", ">= 99 %, p95 <= 0.20 m"),
    Headline("figure8", "figure8_4_2", "figure-8 of 50 x 16 m, 4.2 m/s", ">= 99.5 %"),
    Headline("circle_fast", "circle", "circle of 20 m radius, 8 m/s", "lands"),
    Headline("town", "stop_and_go", "stop-and-go up to 3 m/s", ""),
    Headline("town", "random_turns", "random turns, 3 m/s", ""),
    Headline("wind", "line path.speed_m_s=4.2 wind.mean_m_s=12.0", "line, 4.2 m/s, wind 12 m/s and gusts", ">= 99 %"),
    Headline("waves", "boat_2m", "boat in waves of 2 m", ""),
    Headline("waves", "boat_4m", "boat in waves of 4 m", "tilt p95 <= 5 deg"),
    Headline(
        "delay", "delay_random cameras.down.delay_s=0.2", "line, 4.2 m/s, camera 0.2 to 0.5 s late", "+ <= 0.02 m"
    ),
    Headline(
        "blind_end",
        "blind_end estimate.error_scale=1.0 app:mission.vision_hold_s=0.4",
        "line, 4.2 m/s, markers gone below 1.6 m",
        "<= 0.15 m",
    ),
    Headline("pad_large", "line_4_2", "deck of 1.5 x 1.5 m, line, 4.2 m/s", ""),
    Headline("pad_small", "line_4_2", "deck of 1.2 x 0.7 m, line, 4.2 m/s", ""),
)


@dataclass(frozen=True)
class Flown:
    """A campaign and the statistics of its first `seeds` seeds."""

    path: Path
    campaign: Campaign
    seeds: int
    cells: list[CellStatistics]

    @property
    def command(self) -> str:
        first = self.campaign.first_seed
        return f"`companion campaign {self.path.as_posix()} --seeds {self.seeds}` (seeds {first} to {first + self.seeds - 1})"


def flown(path: Path) -> Flown:
    campaign = load_campaign(path)
    rows = stored_rows(results_folder(campaign) / "samples.jsonl")
    missing = [sample for sample in samples(campaign) if sample.index not in rows]
    seeds = min((sample.seed - campaign.first_seed for sample in missing), default=campaign.seeds)
    if seeds == 0:
        raise SystemExit(f"{path}: not one seed has been flown in all combinations; fly them first")
    chosen = {sample.index: rows[sample.index] for sample in samples(campaign, seeds)}
    return Flown(path, campaign, seeds, statistics_of(campaign, chosen))


def main(commit: str, files: list[str]) -> None:
    campaigns = [flown(Path(name)) for name in files]
    made = f"machine: {_machine()}; commit {commit}"
    page = (
        "# Results\n\nAll **simulated**. Made by `python docs/make_results.py` from the campaigns named below; "
        f"{made}. Intervals are Wilson's, 95 %. Errors are over all flights that touched the pad, landed or not; "
        '"in the air" counts disarms in the air, "down in no-land zone" touches in a zone in which Companion must not land.\n\n'
    )
    sections = [_section(one, f"{one.command}.") for one in campaigns]
    RESULTS.write_text(page + "\n".join(sections), encoding="utf-8")
    _into_readme(
        _short(campaigns)
        + f"\nEvery row is a campaign that anyone can fly again: [results](docs/results.md); {made}.\n"
    )


def add(commit: str, files: list[str]) -> None:
    """Only the sections of these campaigns, in the place of their old ones or at the end, with their own commit."""
    first, *old = RESULTS.read_text(encoding="utf-8").split("\n## ")
    sections = {text.split("\n", 1)[0]: f"## {text}".rstrip("\n") + "\n" for text in old}
    for one in map(flown, map(Path, files)):
        sections[one.campaign.name] = _section(one, f"{one.command}; {_machine()}; commit {commit}.")
    RESULTS.write_text("\n".join([first.rstrip("\n") + "\n", *sections.values()]), encoding="utf-8")


def _section(one: Flown, how: str) -> str:
    return f"## {one.campaign.name}\n\n{how}\n\n{HEAD}{''.join(map(_row, one.cells))}"


def _short(campaigns: list[Flown]) -> str:
    cells = {(one.campaign.name, cell.cell): cell for one in campaigns for cell in one.cells}
    rows = [_headline(headline, cells.get((headline.campaign, headline.cell))) for headline in HEADLINES]
    return SHORT_HEAD + "".join(rows)


def _headline(headline: Headline, cell: CellStatistics | None) -> str:
    if cell is None:
        return ""
    return (
        f"| {headline.text} | {headline.wanted} | {cell.landed} of {cell.n} | {_interval(cell)} "
        f"| {_m(cell.error_mean_m)} / {_m(cell.error_p95_m)} "
        f"| {_m(cell.speed_horizontal_p95_m_s)} / {_m(cell.speed_vertical_p95_m_s)} |\n"
    )


def _row(cell: CellStatistics) -> str:
    return (
        f"| {cell.cell} | {cell.n} | {cell.landed} ({cell.landed / cell.n:.1%}) | {_interval(cell)} "
        f"| {_m(cell.error_mean_m)} / {_m(cell.error_p50_m)} / {_m(cell.error_p95_m)} "
        f"| {_m(cell.speed_horizontal_p95_m_s)} | {_m(cell.speed_vertical_p95_m_s)} | {_m(cell.tilt_p95_deg, 1)} "
        f"| {_m(cell.first_sight_to_touchdown_p50_s, 1)} | {cell.forced_disarms_in_air} | {cell.down_in_no_land_zone} |\n"
    )


def _interval(cell: CellStatistics) -> str:
    return f"{cell.wilson_low:.1%} to {cell.wilson_high:.1%}"


def _m(value: float | None, digits: int = 2) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def _into_readme(text: str) -> None:
    readme = ROOT / "README.md"
    old = readme.read_text(encoding="utf-8")
    readme.write_text(f"{old.split(BEGIN)[0]}{BEGIN}\n{text}{END}{old.split(END)[1]}", encoding="utf-8")


def _machine() -> str:
    return f"{os.cpu_count()} cores {platform.machine()}, {platform.system()}, Python {platform.python_version()}"


if __name__ == "__main__":
    if len(sys.argv) < 3:
        raise SystemExit(__doc__)
    if sys.argv[2] == "--add":
        add(sys.argv[1], sys.argv[3:])
    else:
        main(sys.argv[1], sys.argv[2:])
