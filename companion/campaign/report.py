"""report.html of a campaign: one self-contained page. Envelope maps, touchdowns in the pad's frame, the worst runs.

Made from the campaign file and its rows alone, so that it can be made again at any time, also half way.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

from companion.campaign.campaign_file import Campaign, Sample, samples
from companion.campaign.statistics import CellStatistics, cell_statistics
from companion.telemetry.findings import TOUCHDOWN_LIMITS
from companion.telemetry.heat_map import HeatMap, Square, heat_map_svg
from companion.telemetry.report import BLUE, GREY, RED, STYLE
from companion.telemetry.svg_plot import Chart, Line, svg
from sitl_stub.scenario import load as load_scenario
from sitl_stub.scenario import load_pad, with_overrides

WORST = 20
Row = dict[str, Any]


@dataclass(frozen=True, slots=True)
class _Flown:
    sample: Sample
    row: Row


def campaign_report(
    campaign: Campaign,
    path: Path,
    rows: Mapping[int, Row],
    cells: Sequence[CellStatistics],
    kept: Mapping[int, str] | None = None,
) -> str:
    """The whole page. `kept` holds links to the reports of single flights by sample number, for those that have one."""
    flown = [_Flown(sample, rows[sample.index]) for sample in samples(campaign) if sample.index in rows]
    landed = sum(cell.landed for cell in cells)
    whole = cell_statistics(campaign.name, [one.row for one in flown])
    in_air = sum(cell.forced_disarms_in_air for cell in cells)
    in_zones = sum(cell.down_in_no_land_zone for cell in cells)
    title = f"Campaign {campaign.name}"
    summary = (
        f"{landed} of {len(flown)} flights landed ({_interval(whole)}); seeds {campaign.first_seed} to "
        f"{max((one.row['seed'] for one in flown), default=campaign.first_seed)}; motors stopped in the air: {in_air}; "
        f"down in a no-land zone: {in_zones}. Simulated."
    )
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title><style>{STYLE}
.numbers td,.numbers th{{text-align:right;white-space:nowrap}}.numbers td:first-child,.numbers th:first-child{{text-align:left}}
</style></head><body>
<h1>{escape(title)}</h1>
<p class="verdict{"" if in_air == in_zones == 0 and landed == len(flown) else " bad"}">{escape(summary)}</p>
<h2>What to look at first</h2>{_looks(flown, cells)}
<h2>Where it lands</h2>{"".join(heat_map_svg(chart) for chart in envelope_maps(campaign, cells))}
<p>Colour: part of the flights that landed. Below it the 95 % Wilson interval and the number of flights.</p>
<h2>Where on the pad</h2><div class="grid2">{"".join(svg(chart) for chart in _scatters(flown))}</div>
<p>First contact of each flight, from above, pad's travel upwards. Blue: landed; red: did not end on the pad.</p>
<h2>How hard</h2><div class="grid2">{svg(_contact_speeds(flown))}</div>
<h2>Worst runs</h2>{_worst_table(flown, path, kept or {})}
<h2>Figures</h2>{_cell_table(cells)}
</body></html>
"""


def _looks(flown: Sequence[_Flown], cells: Sequence[CellStatistics]) -> str:
    """Sentences, the worst first; a flight's own report says more of it."""
    rows = [one.row for one in flown]
    ends = Counter(row["outcome"] for row in rows if row["outcome"] != "landed")
    rounds = sum(1 for row in rows if row.get("go_arounds"))
    looks = []
    if ends:
        said = ", ".join(f"{name} {number}" for name, number in ends.most_common())
        looks.append(f"{ends.total()} of {len(rows)} flights did not land: {said}.")
        least = min(cells, key=lambda cell: cell.landed / cell.n)
        looks.append(f"Least often landed: {least.cell}, {least.landed} of {least.n}.")
    for key, most, unit in TOUCHDOWN_LIMITS:
        over = sum(1 for row in rows if (row.get(key) or 0.0) > most)
        if over:
            looks.append(f"{over} touched down at more than {most:g} {unit}.")
    if rounds:
        looks.append(f"{rounds} of {len(rows)} went around at least once.")
    if not looks:
        return "<p>Nothing stands out.</p>"
    return f"<ol>{''.join(f'<li>{escape(text)}</li>' for text in looks)}</ol>"


def _contact_speeds(flown: Sequence[_Flown]) -> Chart:
    """Of all flights that touched the deck."""
    across, down = "touchdown_relative_speed_horizontal_m_s", "touchdown_relative_speed_vertical_m_s"
    touched = [one.row for one in flown if one.row.get(across) is not None and one.row.get(down) is not None]
    groups = (
        ("landed", BLUE, [row for row in touched if row["outcome"] == "landed"]),
        ("not landed", RED, [row for row in touched if row["outcome"] != "landed"]),
    )
    return Chart(
        "Speed against the deck at first contact",
        "across, m/s",
        "down, m/s",
        tuple(
            Line(n, c, [row[across] for row in rows], [row[down] for row in rows], dots=True) for n, c, rows in groups
        ),
        x_range=(0.0, max([1.0, *(1.05 * row[across] for row in touched)])),
        y_range=(0.0, max([1.5, *(1.05 * row[down] for row in touched)])),
    )


def envelope_maps(campaign: Campaign, cells: Sequence[CellStatistics]) -> list[HeatMap]:
    """One map for two axes, one for each value of the further ones. Scenarios are an axis where there is more than one."""
    axes: dict[str, tuple[Any, ...]] = campaign.all_axes
    if len(campaign.scenarios) > 1 or not axes:
        axes["scenario"] = campaign.scenarios
    ordered = sorted(axes, key=lambda name: (not _is_numeric(axes[name]), list(axes).index(name)))
    x = ordered[0]
    y = ordered[1] if len(ordered) > 1 else ""
    further = ordered[2:]
    by_cell = {cell.cell: cell for cell in cells}
    return [
        _envelope(campaign, axes, x, y, dict(zip(further, values, strict=True)), by_cell)
        for values in itertools.product(*(axes[name] for name in further))
    ]


def _envelope(
    campaign: Campaign,
    axes: Mapping[str, tuple[Any, ...]],
    x: str,
    y: str,
    fixed: Mapping[str, Any],
    by_cell: Mapping[str, CellStatistics],
) -> HeatMap:
    rows: tuple[Any, ...] = axes[y] if y else (None,)
    squares = {}
    for column, row in itertools.product(range(len(axes[x])), range(len(rows))):
        chosen = {**fixed, x: axes[x][column], **({y: rows[row]} if y else {})}
        cell = by_cell.get(_cell_name(campaign, chosen))
        if cell is not None:
            squares[column, row] = _square(cell)
    where = ", ".join(f"{_short(name)} {value}" for name, value in fixed.items())
    return HeatMap(
        title=f"Landed, {where}" if where else "Landed",
        x_label=_short(x),
        y_label=_short(y),
        columns=[str(value) for value in axes[x]],
        rows=[str(value) for value in rows] if y else [""],
        squares=squares,
    )


def _cell_name(campaign: Campaign, chosen: Mapping[str, Any]) -> str:
    """As `campaign_file.samples` names it."""
    scenario = chosen.get("scenario", campaign.scenarios[0])
    return " ".join([scenario, *(f"{key}={chosen[key]}" for key in campaign.all_axes)])


def _square(cell: CellStatistics) -> Square:
    return Square(cell.landed / cell.n, f"{cell.landed / cell.n:.0%}", f"{_interval(cell)}, {cell.n}")


def _interval(cell: CellStatistics) -> str:
    return f"{100 * cell.wilson_low:.1f} to {100 * cell.wilson_high:.1f} %"


def _scatters(flown: Sequence[_Flown]) -> list[Chart]:
    """One per scenario."""
    names = list(dict.fromkeys(one.sample.scenario for one in flown))
    return [_scatter(name, [one for one in flown if one.sample.scenario == name]) for name in names]


def _scatter(scenario: str, flown: Sequence[_Flown]) -> Chart:
    touched = [one.row for one in flown if one.row.get("touchdown_error_along_m") is not None]
    return Chart(
        title=f"First contact, {scenario}",
        x_label="right of the travel, m",
        y_label="ahead, m",
        equal=True,
        height=380.0,
        lines=(
            _deck_outline(flown[0].sample),
            _dots("landed", BLUE, [row for row in touched if row["outcome"] == "landed"]),
            _dots("not landed", RED, [row for row in touched if row["outcome"] != "landed"]),
        ),
    )


def _deck_outline(sample: Sample) -> Line:
    layout = load_pad(with_overrides(load_scenario(sample.scenario), sample.world))
    x, y = layout.deck_center_m
    half_x, half_y = layout.length_m / 2.0, layout.width_m / 2.0
    corners = ((1, 1), (1, -1), (-1, -1), (-1, 1), (1, 1))
    return Line("deck", GREY, [y + b * half_y for _, b in corners], [x + a * half_x for a, _ in corners])


def _dots(name: str, colour: str, rows: Sequence[Row]) -> Line:
    across = [row["touchdown_error_across_m"] for row in rows]
    return Line(name, colour, across, [row["touchdown_error_along_m"] for row in rows], dots=True)


def _worst_table(flown: Sequence[_Flown], path: Path, kept: Mapping[int, str]) -> str:
    """Failures first, then the largest errors; each with the command that repeats it exactly, and linked once it was."""
    ranked = sorted(flown, key=lambda one: (one.row["outcome"] == "landed", -(one.row["touchdown_error_m"] or 0.0)))
    lines = [
        f"<tr><td>{escape(one.row['outcome'])}</td><td>{_number(one.row['touchdown_error_m'])}</td>"
        f"<td>{escape(one.sample.cell)}, seed {one.sample.seed}</td><td>{escape(_why(one.row))}</td>"
        f"<td>{_linked(kept.get(one.sample.index))}"
        f"<code>companion campaign rerun {escape(str(path))} --sample {one.sample.index}</code></td></tr>"
        for one in ranked[:WORST]
    ]
    head = "<tr><th>ending</th><th>error m</th><th>flight</th><th></th><th>the same again</th></tr>"
    return f"<table>{head}{''.join(lines)}</table>"


def _linked(page: str | None) -> str:
    return "" if page is None else f'<a href="{escape(page)}">its report</a> '


def _why(row: Row) -> str:
    if "reason" in row:
        return str(row["reason"])
    rounds = f", {row['go_arounds']} go-arounds" if row.get("go_arounds") else ""
    return "" if row["outcome"] == "landed" and not rounds else f"phase {row.get('final_phase', '?')}{rounds}"


def _cell_table(cells: Sequence[CellStatistics]) -> str:
    names = (
        "cell",
        "n",
        "landed",
        "95 %",
        "error p50",
        "p95 m",
        "across p95",
        "down p95 m/s",
        "time p50 s",
        "other endings",
    )
    lines = ["<tr>" + "".join(f"<td>{escape(text)}</td>" for text in _cell_texts(cell)) + "</tr>" for cell in cells]
    return f'<table class="numbers"><tr>{"".join(f"<th>{name}</th>" for name in names)}</tr>{"".join(lines)}</table>'


def _cell_texts(cell: CellStatistics) -> list[str]:
    others = ", ".join(f"{name} {count}" for name, count in sorted(cell.outcomes.items()) if name != "landed")
    figures = (
        cell.error_p50_m,
        cell.error_p95_m,
        cell.speed_horizontal_p95_m_s,
        cell.speed_vertical_p95_m_s,
        cell.time_p50_s,
    )
    return [cell.cell, str(cell.n), str(cell.landed), _interval(cell), *map(_number, figures), others]


def _is_numeric(values: Sequence[Any]) -> bool:
    return all(isinstance(value, int | float) and not isinstance(value, bool) for value in values)


def _short(name: str) -> str:
    return name.removeprefix("app:")


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"
