"""A Reproduction as a page: HTML that needs nothing else, or markdown with its figures as files beside it.

`how` are lines about where the numbers come from (command, machine-independent). Called by command.py.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from itertools import groupby
from pathlib import Path

from companion.reproduce.row import Reproduction, Row, Verdict
from companion.telemetry.report import STYLE, SVG_STYLE
from companion.telemetry.svg_plot import Chart, svg


@dataclass(frozen=True, slots=True)
class Wording:
    """What the columns are called, and the verdicts."""

    headings: tuple[str, ...]
    verdicts: Mapping[Verdict, str]


PRINT = Wording(
    ("", "printed", "ours", "difference", "tolerance", "verdict"),
    {verdict: verdict for verdict in ("same", "better", "differs", "not printed")},
)
VERSUS = Wording(
    ("", "the paper's preset", "the default pipeline", "difference", "tie within", "the default"),
    {"better": "wins", "same": "ties", "differs": "loses", "not printed": ""},
)
"""Two pipelines instead of print and measurement."""

FIGURES = "Figures, redrawn from our runs"
VERDICT_STYLE = ".same{color:#15803d}.better{color:#0369a1}.differs{color:#b91c1c;font-weight:600}"


def value_text(value: float | str | None, unit: str = "") -> str:
    """A number with as many digits as its size asks for; a dash where there is none."""
    if value is None:
        return "-"
    if isinstance(value, str):
        return value
    return f"{number_text(value)} {unit}".rstrip()


def number_text(value: float) -> str:
    """Five significant digits, without an exponent where that is readable."""
    return f"{value:.0f}" if value.is_integer() and abs(value) < 1e7 else f"{value:.5g}"


def difference_text(row: Row) -> str:
    """Ours minus printed, where both are numbers."""
    if isinstance(row.printed, str) or row.printed is None or isinstance(row.ours, str):
        return ""
    difference = row.ours - row.printed
    return f"{0.0 if abs(difference) < 1e-12 else difference:+.3g}"


def cells(row: Row, wording: Wording = PRINT) -> tuple[str, ...]:
    """The row as texts in the order of the headings."""
    return (
        row.name,
        value_text(row.printed, row.unit),
        value_text(row.ours, row.unit),
        difference_text(row),
        row.tolerance,
        wording.verdicts[row.verdict],
    )


def tables(made: Reproduction) -> list[tuple[str, list[Row]]]:
    """Rows by their table, in the paper's order."""
    return [(name, list(rows)) for name, rows in groupby(made.rows, key=lambda row: row.table)]


def figure_names(made: Reproduction) -> list[str]:
    """File names of the figures, by number and title."""
    return [f"{made.key}-{i:02d}-{_slug(chart.title)}.svg" for i, chart in enumerate(made.figures, start=1)]


def _slug(title: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")[:48]


def figure_file(chart: Chart) -> str:
    """The chart as an SVG file of its own."""
    size = f'width="{chart.width:.0f}" height="{chart.height:.0f}"'
    inner = svg(chart).replace("<svg ", f'<svg xmlns="http://www.w3.org/2000/svg" {size} ', 1)
    style = f"<style>{SVG_STYLE}text{{font:11px sans-serif}}.title{{font-size:13px}}</style>"
    ground = '<rect width="100%" height="100%" fill="#fff"/>'
    return inner.replace(">", f">{style}{ground}", 1) + "\n"


def as_html(made: Reproduction, how: Sequence[str], wording: Wording = PRINT) -> str:
    """One self-contained page."""
    parts = [
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{escape(made.title)}</title>',
        f"<style>{STYLE}{VERDICT_STYLE}</style></head><body><h1>{escape(made.title)}</h1>",
        _html_list("Where the numbers come from", (*how, *made.notes)),
        *(_html_table(name, rows, wording) for name, rows in tables(made)),
        _html_list("Errata of the print", made.errata),
        _html_figures(made.figures),
        "</body></html>\n",
    ]
    return "\n".join(parts)


def _html_table(name: str, rows: Sequence[Row], wording: Wording) -> str:
    head = "".join(f"<th>{heading}</th>" for heading in wording.headings)
    body = "".join(
        f'<tr class="{row.verdict}">' + "".join(f"<td>{escape(cell)}</td>" for cell in cells(row, wording)) + "</tr>\n"
        for row in rows
    )
    return f"<h2>{escape(name)}</h2><table><tr>{head}</tr>\n{body}</table>"


def _html_figures(figures: Sequence[Chart]) -> str:
    if not figures:
        return ""
    return f'<h2>{FIGURES}</h2><div class="grid2">' + "".join(svg(chart) for chart in figures) + "</div>"


def _html_list(heading: str, lines: Sequence[str]) -> str:
    if not lines:
        return ""
    return f"<h2>{escape(heading)}</h2><ul>" + "".join(f"<li>{escape(line)}</li>\n" for line in lines) + "</ul>"


def as_markdown(made: Reproduction, how: Sequence[str], wording: Wording = PRINT) -> str:
    """The same for docs/papers; figures are files beside it."""
    parts = [f"# {made.title}\n"]
    parts += [_markdown_list("Where the numbers come from", (*how, *made.notes))]
    parts += [_markdown_table(name, rows, wording) for name, rows in tables(made)]
    parts += [_markdown_list("Errata of the print", made.errata)]
    parts += [f"## {FIGURES}\n"] if made.figures else []
    parts += [f"![{chart.title}]({name})\n" for chart, name in zip(made.figures, figure_names(made), strict=True)]
    return "\n".join(part for part in parts if part)


def _markdown_table(name: str, rows: Sequence[Row], wording: Wording) -> str:
    lines = [f"## {name}\n", _markdown_row(wording.headings), "| --- | --- | --- | --- | --- | --- |"]
    lines += [_markdown_row(cells(row, wording)) for row in rows]
    return "\n".join(lines) + "\n"


def _markdown_row(texts: Sequence[str]) -> str:
    return "| " + " | ".join(text.replace("|", "\\|") for text in texts) + " |"


def _markdown_list(heading: str, lines: Sequence[str]) -> str:
    if not lines:
        return ""
    return f"## {heading}\n\n" + "".join(f"- {line}\n" for line in lines)


def write_page(made: Reproduction, out: Path, how: Sequence[str], wording: Wording = PRINT) -> list[Path]:
    """KEY.html, KEY.md and its figures in `out`; their paths."""
    out.mkdir(parents=True, exist_ok=True)
    texts = {f"{made.key}.html": as_html(made, how, wording), f"{made.key}.md": as_markdown(made, how, wording)}
    texts |= {name: figure_file(chart) for name, chart in zip(figure_names(made), made.figures, strict=True)}
    for name, text in texts.items():
        (out / name).write_text(text, encoding="utf-8")
    return [out / name for name in texts]
