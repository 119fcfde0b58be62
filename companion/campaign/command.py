"""`companion campaign`: fly what is missing, show progress, print the table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from companion.campaign.campaign_file import Campaign, Sample, cells, fingerprint, load_campaign, samples
from companion.campaign.engine import Row, default_workers, fly_all
from companion.campaign.fly_sample import fly_sample, prepared
from companion.campaign.report import campaign_report
from companion.campaign.results_file import ResultsFile, stored_rows
from companion.campaign.statistics import CellStatistics, cell_statistics
from companion.campaign.summary import repeatable
from companion.config import ConfigError


def run_campaign(
    path: Path,
    *,
    out: Path | None,
    workers: int | None,
    scheduler: str | None,
    console: Console,
    seeds: int | None = None,
) -> dict[str, Any]:
    """The whole campaign; interrupted, it goes on at the next call. The result as for --json.

    `seeds` flies only the first so many of each combination; a later call without it flies the others.
    """
    campaign = load_campaign(path)
    check_cells(campaign, path)
    folder = out or results_folder(campaign)
    results = ResultsFile(folder / "samples.jsonl", fingerprint(campaign))
    wanted = list(samples(campaign, seeds))
    todo = [sample for sample in wanted if sample.index not in results.rows]
    console.print(f"campaign {campaign.name}: {len(todo)} of {len(wanted)} flights to fly, kept in {folder}")
    try:
        _fly(todo, results, workers=workers or default_workers(), scheduler=scheduler, console=console)
    finally:
        results.close()
        by_cell = statistics_of(campaign, results.rows)
        report = write_report(campaign, path, folder, results.rows, by_cell)
        console.print(table(campaign.name, by_cell))
        console.print(f"report: {report}")
    return {
        "campaign": campaign.name,
        "results": str(folder),
        "report": str(report),
        "cells": [asdict(cell) for cell in by_cell],
    }


def check_cells(campaign: Campaign, path: Path) -> None:
    """ConfigError before anything is flown or written, where a combination names a key or value that does not exist."""
    for sample in cells(campaign):
        try:
            prepared(sample)
        except ValueError as error:
            raise ConfigError(f"{path}: {sample.cell}: {error}") from error


def write_report(
    campaign: Campaign, path: Path, folder: Path, rows: Mapping[int, Row], by_cell: Sequence[CellStatistics]
) -> Path:
    """report.html of all rows so far, with links to the run folders of flights that were flown again."""
    report = folder / "report.html"
    page = campaign_report(campaign, path, rows, by_cell, kept_runs(folder))
    report.write_text(page, encoding="utf-8")
    return report


def kept_runs(folder: Path) -> dict[int, str]:
    """Reports of samples flown again, seen from `folder`; the latest of each sample."""
    pages = sorted(folder.glob("sample-*/report.html"), key=lambda page: page.stat().st_mtime_ns)
    return {int(page.parent.name.split("-")[1]): f"{page.parent.name}/{page.name}" for page in pages}


def results_folder(campaign: Campaign) -> Path:
    """Where the rows are kept unless somebody says otherwise."""
    return Path("runs") / f"campaign-{campaign.name}"


def _fly(
    todo: Sequence[Sample], results: ResultsFile, *, workers: int, scheduler: str | None, console: Console
) -> None:
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[landed]} landed"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    landed = 0
    with Progress(*columns, console=console, disable=not console.is_terminal, speed_estimate_period=600.0) as progress:
        task = progress.add_task("flights", total=len(todo), landed=0)
        for row in fly_all(todo, workers=workers, scheduler=scheduler):
            results.add(row)
            landed += row["outcome"] == "landed"
            progress.update(task, advance=1, landed=landed)


def statistics_of(campaign: Campaign, rows: Mapping[int, Row]) -> list[CellStatistics]:
    """One per cell, in the order of the file."""
    by_cell: dict[str, list[dict[str, Any]]] = {}
    for sample in samples(campaign):
        row = rows.get(sample.index)
        if row is not None:
            by_cell.setdefault(sample.cell, []).append(row)
    return [cell_statistics(cell, rows) for cell, rows in by_cell.items()]


def table(title: str, cells: list[CellStatistics]) -> Table:
    """For people. All figures are simulated."""
    view = Table(title=f"{title} (simulated)", title_justify="left")
    for name in (
        "cell",
        "n",
        "landed",
        "95 % interval",
        "error p50 / p95 m",
        "across p95 m/s",
        "down p95 m/s",
        "time s",
        "other",
    ):
        view.add_column(name, justify="left" if name in ("cell", "other") else "right")
    for cell in cells:
        others = ", ".join(f"{name} {count}" for name, count in sorted(cell.outcomes.items()) if name != "landed")
        view.add_row(
            cell.cell,
            str(cell.n),
            f"{cell.landed / cell.n:.1%}",
            f"{cell.wilson_low:.1%} .. {cell.wilson_high:.1%}",
            f"{_text(cell.error_p50_m)} / {_text(cell.error_p95_m)}",
            _text(cell.speed_horizontal_p95_m_s),
            _text(cell.speed_vertical_p95_m_s),
            _text(cell.time_p50_s, 1),
            others,
        )
    return view


def sample_of(path: Path, index: int) -> Sample:
    """Sample number `index` of the campaign; ConfigError where there is none."""
    for sample in samples(load_campaign(path)):
        if sample.index == index:
            return sample
    raise ConfigError(f"{path}: has no sample {index}")


def rerun(path: Path, index: int, console: Console, *, out: Path | None, runs: Path | None) -> dict[str, Any]:
    """Fly one sample again, exactly, with everything recorded; say whether it came out as the campaign's row.

    The run folder is made in `runs`, else beside the campaign's results, whose report then links to it.
    """
    from companion.campaign.recorded_flight import RecordedFlight

    sample, campaign = sample_of(path, index), load_campaign(path)
    results = out or results_folder(campaign)
    about = {"campaign": campaign.name, "sample": str(index), "scenario": sample.scenario, "seed": str(sample.seed)}
    _, config = prepared(sample)
    recorded = RecordedFlight(runs or results, f"sample-{index}", config, about)
    row = fly_sample(sample, recorded.sinks)
    figures = recorded.finish(row, title=f"{path.stem}, sample {index}: {sample.cell}, seed {sample.seed} (simulated)")
    rows = stored_rows(results / "samples.jsonl", fingerprint(campaign))
    if index in rows:
        console.print(compared(rows[index], row))
    if rows and runs is None:
        write_report(campaign, path, results, rows, statistics_of(campaign, rows))
    return figures


def compared(stored: Row, row: Row) -> str:
    """One line: the same as before, or what is different."""
    before, after = repeatable(stored), repeatable(row)
    different = [
        f"{key} {before.get(key)} -> {after.get(key)}" for key in before | after if before.get(key) != after.get(key)
    ]
    if not different:
        return "the same as in the campaign, figure by figure"
    return "not as in the campaign (another version of the program?): " + ", ".join(different)


def _text(value: float | None, digits: int = 2) -> str:
    return "-" if value is None else f"{value:.{digits}f}"
