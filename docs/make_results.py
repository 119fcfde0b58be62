"""Writes the results table of the README and docs/results.md from finished campaigns.

    companion campaign configs/campaigns/first-landing.toml        # flies what is missing
    python docs/make_results.py COMMIT configs/campaigns/first-landing.toml [more.toml ...]

COMMIT is the one that was checked out when the flights were flown.

Each file's results are read from runs/campaign-<name>. Nothing here is typed by hand; a campaign that is not complete is refused.
"""

from __future__ import annotations

import os
import platform
import sys
from pathlib import Path

from companion.campaign.campaign_file import load_campaign, samples
from companion.campaign.command import results_folder, statistics_of
from companion.campaign.results_file import stored_rows
from companion.campaign.statistics import CellStatistics

ROOT = Path(__file__).resolve().parents[1]
BEGIN, END = "<!-- results:begin -->", "<!-- results:end -->"
HEAD = (
    "| flight | n | landed | 95 % interval | touchdown error p50 / p95 | across p95 | down p95 | in the air |\n"
    "| --- | --- | --- | --- | --- | --- | --- | --- |\n"
)


def main(commit: str, files: list[str]) -> None:
    sections, first = [], None
    for name in files:
        path = Path(name)
        campaign = load_campaign(path)
        rows = stored_rows(results_folder(campaign) / "samples.jsonl")
        missing = sum(1 for sample in samples(campaign) if sample.index not in rows)
        if missing:
            raise SystemExit(f"{name}: {missing} flights are missing; fly them first")
        table = HEAD + "".join(_row(cell) for cell in statistics_of(campaign, rows))
        command = f"`companion campaign {path.as_posix()}`, seeds {campaign.first_seed} to {campaign.first_seed + campaign.seeds - 1}"
        sections.append(f"## {campaign.name}\n\n{command}.\n\n{table}")
        first = (
            first
            or f'{table}\nMade by {command}; commit {commit}, {_machine()}. "In the air" counts disarms in the air.\n'
        )
    results_page = (
        "# Results\n\nAll simulated. Made by `python docs/make_results.py` from the campaigns named below; machine: "
        f"{_machine()}; commit {commit}. Intervals are Wilson's. Errors are over all flights that touched the pad, landed or not.\n\n"
    )
    (ROOT / "docs" / "results.md").write_text(results_page + "\n".join(sections), encoding="utf-8")
    readme = ROOT / "README.md"
    text = readme.read_text(encoding="utf-8")
    before, after = text.split(BEGIN)[0], text.split(END)[1]
    readme.write_text(f"{before}{BEGIN}\n{first}{END}{after}", encoding="utf-8")


def _row(cell: CellStatistics) -> str:
    return (
        f"| {cell.cell} | {cell.n} | {cell.landed} ({cell.landed / cell.n:.1%}) "
        f"| {cell.wilson_low:.1%} to {cell.wilson_high:.1%} | {_m(cell.error_p50_m)} / {_m(cell.error_p95_m)} m "
        f"| {_m(cell.speed_horizontal_p95_m_s)} m/s | {_m(cell.speed_vertical_p95_m_s)} m/s | {cell.forced_disarms_in_air} |\n"
    )


def _m(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"


def _machine() -> str:
    return f"{os.cpu_count()} cores {platform.machine()}, {platform.system()}, Python {platform.python_version()}"


if __name__ == "__main__":
    if len(sys.argv) < 3:
        raise SystemExit(__doc__)
    main(sys.argv[1], sys.argv[2:])
