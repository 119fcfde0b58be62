"""report.html: one self-contained page about one flight, without network or scripts. Drawn from a FlightRecord."""

from __future__ import annotations

import math
from collections.abc import Mapping
from html import escape
from typing import Any

from companion.messages import Phase
from companion.telemetry.flight_record import FlightRecord, Series
from companion.telemetry.svg_plot import Band, Chart, Line, svg

BLUE, ORANGE, GREEN, RED, GREY = "#2563eb", "#ea580c", "#16a34a", "#dc2626", "#94a3b8"

PHASE_COLOURS: dict[Phase, str] = {
    Phase.ENGAGE: "#f1f5f9",
    Phase.SEARCH: "#fef9c3",
    Phase.APPROACH: "#e0f2fe",
    Phase.FOLLOW: "#dbeafe",
    Phase.DESCEND: "#dcfce7",
    Phase.COMMIT: "#bbf7d0",
    Phase.TOUCHDOWN: "#86efac",
    Phase.DONE: "#f8fafc",
    Phase.GO_AROUND: "#fed7aa",
    Phase.ABORT: "#fecaca",
    Phase.HOLD: "#fecaca",
}

STYLE = """
body{font:15px/1.45 system-ui,sans-serif;margin:24px auto;max-width:1180px;color:#0f172a;padding:0 16px}
h1{font-size:22px;margin:0 0 4px}h2{font-size:16px;margin:26px 0 8px}
.verdict{font-size:17px;padding:10px 14px;border-radius:8px;background:#dcfce7;margin:10px 0}.verdict.bad{background:#fee2e2}
.grid2{display:grid;grid-template-columns:1fr 1fr;gap:16px}@media(max-width:900px){.grid2{grid-template-columns:1fr}}
svg{width:100%;height:auto;background:#fff;border:1px solid #e2e8f0;border-radius:8px}
svg text{font:11px system-ui,sans-serif;fill:#475569}svg .title{font-weight:600;font-size:13px;fill:#0f172a}
svg .legend{font-weight:600}svg .band{fill:#64748b;font-size:10px}svg .grid{stroke:#e2e8f0;stroke-width:1}
table{border-collapse:collapse;font-size:14px}td,th{padding:3px 14px 3px 0;text-align:left;vertical-align:top}
th{color:#64748b;font-weight:500}code{font-size:13px}
"""

SVG_STYLE = (
    "text{fill:#475569}.title{font-weight:600}.legend{font-weight:600}.band{font-size:10px}.grid{stroke:#e2e8f0}"
)


def report_html(record: FlightRecord, figures: Mapping[str, Any], *, title: str, line: str) -> str:
    """The whole page."""
    good = figures.get("outcome") == "landed"
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title><style>{STYLE}</style></head><body>
<h1>{escape(title)}</h1>
<p class="verdict{"" if good else " bad"}">{escape(line)}</p>
<h2>Path</h2><div class="grid2">{svg(_plan_view(record))}{svg(_side_view(record))}</div>
<h2>Against the pad</h2><div class="grid2">{"".join(svg(chart) for chart in _relative_charts(record))}</div>
<h2>Phases</h2>{_phase_table(record)}
<h2>Requests to the autopilot</h2>{_request_table(record)}
<h2>Figures</h2>{_figure_table(figures)}
</body></html>
"""


def _bands(record: FlightRecord) -> tuple[Band, ...]:
    ends = [start for start, _, _ in record.phases[1:]] + [record.end_s]
    return tuple(
        Band(start, end, str(phase), PHASE_COLOURS.get(phase, "#ffffff"))
        for (start, phase, _), end in zip(record.phases, ends, strict=True)
    )


def _plan_view(record: FlightRecord) -> Chart:
    """From above: east to the right, north up."""
    return Chart(
        title="From above (true)",
        x_label="east, m",
        y_label="north, m",
        equal=True,
        lines=(
            Line("pad", ORANGE, record.true_pad.axis(1), record.true_pad.axis(0)),
            Line("vehicle", BLUE, record.true_vehicle.axis(1), record.true_vehicle.axis(0)),
            Line("touchdown", RED, record.true_vehicle.axis(1)[-1:], record.true_vehicle.axis(0)[-1:], dots=True),
        ),
    )


def _side_view(record: FlightRecord) -> Chart:
    """From the side: height over time."""
    return Chart(
        title="From the side (true)",
        x_label="time, s",
        y_label="height, m",
        bands=_bands(record),
        lines=(
            Line("pad", ORANGE, record.true_pad.t_s, [-z for z in record.true_pad.axis(2)]),
            Line("vehicle", BLUE, record.true_vehicle.t_s, [-z for z in record.true_vehicle.axis(2)]),
        ),
    )


def _relative_charts(record: FlightRecord) -> list[Chart]:
    bands = _bands(record)
    true_error = [
        math.hypot(v[0] - p[0], v[1] - p[1])
        for v, p in zip(record.true_vehicle.values, record.true_pad.values, strict=True)
    ]
    return [
        Chart(
            "Horizontal distance from the pad",
            "time, s",
            "m",
            (
                Line("true", GREY, record.true_vehicle.t_s, list(true_error)),
                Line("believed", BLUE, record.relative.t_s, _horizontal(record.relative)),
            ),
            bands,
            y_range=(0.0, 5.0),
        ),
        Chart(
            "Horizontal speed against the pad",
            "time, s",
            "m/s",
            (Line("believed", BLUE, record.relative_velocity.t_s, _horizontal(record.relative_velocity)),),
            bands,
            y_range=(0.0, 3.0),
        ),
        *(
            Chart(
                f"Velocity {name}: asked and flown",
                "time, s",
                "m/s",
                (
                    Line("flown", GREY, record.vehicle_velocity.t_s, list(record.vehicle_velocity.axis(axis))),
                    Line("asked", BLUE, record.setpoint.t_s, list(record.setpoint.axis(axis))),
                ),
                bands,
            )
            for axis, name in enumerate(("north", "east", "down"))
        ),
        Chart(
            "Detection",
            "time, s",
            "",
            (
                Line("seen", GREEN, record.seen_s, [1.0] * len(record.seen_s), dots=True),
                Line("not seen", GREY, record.not_seen_s, [0.0] * len(record.not_seen_s), dots=True),
                Line("rejected", RED, record.rejected_s, [0.5] * len(record.rejected_s), dots=True),
            ),
            bands,
            y_range=(-0.5, 1.5),
        ),
    ]


def _horizontal(series: Series) -> list[float | None]:
    return [math.hypot(value[0], value[1]) for value in series.values]


def _phase_table(record: FlightRecord) -> str:
    rows = "".join(
        f"<tr><td>{t_s:.2f} s</td><td>{escape(str(phase))}</td><td>{escape(reason)}</td></tr>"
        for t_s, phase, reason in record.phases
    )
    return f"<table><tr><th>time</th><th>phase</th><th>why</th></tr>{rows}</table>"


def _request_table(record: FlightRecord) -> str:
    rows = "".join(f"<tr><td>{t_s:.2f} s</td><td>{escape(text)}</td></tr>" for t_s, text in record.requests)
    return f"<table>{rows}</table>"


def _figure_table(figures: Mapping[str, Any]) -> str:
    rows = "".join(
        f"<tr><th>{escape(str(key))}</th><td><code>{escape(str(value))}</code></td></tr>"
        for key, value in figures.items()
        if not isinstance(value, Mapping)
    )
    return f"<table>{rows}</table>"


def picture(record: FlightRecord) -> str:
    """Plan and side view beside each other as one SVG file."""
    charts = (_plan_view(record), _side_view(record))
    inner = "".join(
        f'<svg x="{index * 570}" y="0" width="560" height="300" viewBox="0 0 560 300">{svg(chart)}</svg>'
        for index, chart in enumerate(charts)
    )
    style = SVG_STYLE + "text{font:11px sans-serif}.title{font-size:13px}"
    return (
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 1130 300" width="1130" height="300">'
        f'<style>{style}</style><rect width="1130" height="300" fill="#fff"/>{inner}</svg>\n'
    )
