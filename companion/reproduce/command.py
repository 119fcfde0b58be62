"""`companion reproduce`: print what a paper printed beside what we measure, and write it as a page.

Returns plain dictionaries for `--json`. Everything measured here is measured in this project's simulator, or computed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from companion.reproduce.page import PRINT, VERSUS, Wording, cells, tables, write_page
from companion.reproduce.papers import NotReproduced, chosen, with_preset
from companion.reproduce.row import Reproduction, Row

COLOURS = {"same": "green", "better": "cyan", "differs": "red", "not printed": "dim"}


def run_reproduce(key: str | None, out: Path, *, quick: bool, console: Console) -> dict[str, Any]:
    """One paper, or all that have a reproduction; the figures of `--json`."""
    done = {}
    for name, reproduce in chosen(key).items():
        try:
            with console.status(f"{name}: computing and flying ({'seconds' if quick else 'minutes'})"):
                made = reproduce(quick)
        except NotReproduced as error:
            if key is not None:
                raise
            console.print(f"[yellow]{error}")
            continue
        done[name] = _publish(made, out, _how(name, quick), console)
    return {"papers": done}


def run_versus(key: str | None, out: Path, *, seeds: int | None, quick: bool, console: Console) -> dict[str, Any]:
    """Each paper's own scenarios, flown by its preset and by the default pipeline."""
    from companion.reproduce.versus import fly_versus

    keys = list(chosen(key)) if key else with_preset()
    with console.status("flying") as status:
        made = fly_versus(
            keys,
            seeds=seeds or (1 if quick else 5),
            done=lambda count, of: status.update(f"{count} of {of} flights"),
        )
    command = f"companion reproduce{f' {key}' if key else ''} --versus{f' --seeds {seeds}' if seeds else ''}"
    return {"versus": _publish(made, out, (f"Made by `{command}{' --quick' * quick}`.",), console, VERSUS)}


def _how(key: str, quick: bool) -> Sequence[str]:
    return (f"Made by `companion reproduce {key}{' --quick' if quick else ''}`. Flights are simulated.",)


def _publish(
    made: Reproduction, out: Path, how: Sequence[str], console: Console, wording: Wording = PRINT
) -> dict[str, Any]:
    for name, rows in tables(made):
        console.print(_table(f"{made.key}: {name}", rows, wording))
    for heading, lines in (("errata", made.errata), ("notes", made.notes)):
        for line in lines:
            console.print(f"[dim]{heading}:[/] {line}", highlight=False)
    written = write_page(made, out, how, wording)
    counted = Counter(wording.verdicts[row.verdict] for row in made.rows)
    console.print(f"{made.key}: " + ", ".join(f"{n} {verdict}" for verdict, n in counted.items()) + f"; {written[0]}")
    return {"verdicts": dict(counted), "rows": [asdict(row) for row in made.rows], "page": str(written[0])}


def _table(title: str, rows: Sequence[Row], wording: Wording) -> Table:
    table = Table(title=title, title_justify="left")
    for heading in wording.headings:
        table.add_column(heading)
    for row in rows:
        table.add_row(*cells(row, wording), style=COLOURS[row.verdict])
    return table
