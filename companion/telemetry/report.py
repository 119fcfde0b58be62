"""report.html: one self-contained page about one flight or replay, without network. Drawn from a FlightRecord.

First what it came to and what to look at, then paths (3-D, from above, from the side), errors with their bounds, detection with
sample frames, asked against flown, delays, health. Where the truth is not known, paths are as Companion believed them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from html import escape
from typing import Any

from companion.messages import Phase
from companion.telemetry.filmstrip import filmstrip_html
from companion.telemetry.findings import NIS_95, look_first, phase_spans
from companion.telemetry.flight_record import FlightRecord, Series, Values
from companion.telemetry.scene3d import paths, scene_html
from companion.telemetry.svg_plot import Band, Chart, Line, svg

BLUE, ORANGE, GREEN, RED, GREY = "#2563eb", "#ea580c", "#16a34a", "#dc2626", "#94a3b8"
AXES = (("north", BLUE), ("east", ORANGE), ("down", GREEN))

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
.verdict{font-size:17px;padding:10px 14px;border-radius:8px;background:#dcfce7;margin:10px 0}.verdict.bad{background:#fee2e2}.verdict.open{background:#e2e8f0}
.grid2{display:grid;grid-template-columns:1fr 1fr;gap:16px}@media(max-width:900px){.grid2{grid-template-columns:1fr}}
svg{width:100%;height:auto;background:#fff;border:1px solid #e2e8f0;border-radius:8px}
svg text{font:11px system-ui,sans-serif;fill:#475569}svg .title{font-weight:600;font-size:13px;fill:#0f172a}
svg .legend{font-weight:600}svg .band{fill:#64748b;font-size:10px}svg .grid{stroke:#e2e8f0;stroke-width:1}
table{border-collapse:collapse;font-size:14px}td,th{padding:3px 14px 3px 0;text-align:left;vertical-align:top}td:first-child{white-space:nowrap}
th{color:#64748b;font-weight:500}code{font-size:13px}
.scene canvas{border:1px solid #e2e8f0;border-radius:8px;cursor:grab}.row{display:flex;gap:12px;align-items:center}
.note{color:#64748b;font-size:13px;margin:2px 0}.strip{display:flex;flex-wrap:wrap;gap:6px}figure{margin:0}
figcaption{font-size:11px;color:#64748b}img{border:2px solid #cbd5e1;border-radius:4px;display:block}img.seen{border-color:#16a34a}
.level2{color:#b91c1c;font-weight:600}
"""

SVG_STYLE = (
    "text{fill:#475569}.title{font-weight:600}.legend{font-weight:600}.band{font-size:10px}.grid{stroke:#e2e8f0}"
)


MOST_ROWS = 200


def report_html(record: FlightRecord, figures: Mapping[str, Any], *, title: str, line: str) -> str:
    """The whole page."""
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title><style>{STYLE}</style></head><body>
<h1>{escape(title)}</h1>
<p class="verdict{_verdict(figures)}">{escape(line)}</p>
<h2>What to look at first</h2>{_looks(record, figures)}
<h2>Path</h2>{scene_html(record)}<div class="grid2">{svg(_plan_view(record))}{_charts(record, [_side_view(record)])}</div>
<h2>Against the pad</h2><div class="grid2">{_charts(record, _relative_charts(record))}</div>
<h2>Estimate: errors and innovations with their bounds</h2><div class="grid2">{_charts(record, _estimate_charts(record))}</div>{_judged_table(record)}
<h2>Detection</h2><div class="grid2">{_charts(record, [_detection_chart(record)])}</div>{filmstrip_html(record)}
<h2>Setpoints against response</h2><div class="grid2">{_charts(record, _response_charts(record))}</div>
<h2>Delays</h2><div class="grid2">{_charts(record, _delay_charts(record))}</div>
<h2>Health</h2>{_health_table(record)}
<h2>Phases</h2>{_phase_table(record)}
<h2>Requests to the autopilot</h2>{_request_table(record)}
<h2>Figures</h2>{_figure_table(figures)}
</body></html>
"""


def _verdict(figures: Mapping[str, Any]) -> str:
    """Green for a landing, red for another end of a flight, grey where nobody judged: a replay, a log of a killed process."""
    outcome = figures.get("outcome", "replayed")
    return {"landed": "", "guided": "", "replayed": " open"}.get(outcome, " bad")


def _bands(record: FlightRecord) -> tuple[Band, ...]:
    return tuple(
        Band(start, end, str(phase), PHASE_COLOURS.get(phase, "#ffffff")) for start, end, phase in phase_spans(record)
    )


def _charts(record: FlightRecord, charts: list[Chart]) -> str:
    """All over the whole flight, so that they can be compared by eye."""
    return "".join(svg(replace(chart, x_range=(0.0, max(record.end_s, 1.0)), bands=_bands(record))) for chart in charts)


def _looks(record: FlightRecord, figures: Mapping[str, Any]) -> str:
    looks = look_first(record, figures)
    if not looks:
        return "<p>Nothing stands out.</p>"
    items = (f"<li{_emphasis(look.weight >= 3)}>{escape(look.text)}</li>" for look in looks)
    return f"<ol>{''.join(items)}</ol>"


def _emphasis(wanted: bool) -> str:
    return ' class="level2"' if wanted else ""


def _plan_view(record: FlightRecord) -> Chart:
    """From above: east to the right, north up."""
    vehicle, pad = paths(record)
    return Chart(
        title=f"From above ({_known(record)})",
        x_label="east, m",
        y_label="north, m",
        equal=True,
        lines=(
            Line("pad", ORANGE, pad.axis(1), list(pad.axis(0))),
            Line("vehicle", BLUE, vehicle.axis(1), list(vehicle.axis(0))),
            Line("end", RED, vehicle.axis(1)[-1:], list(vehicle.axis(0)[-1:]), dots=True),
        ),
    )


def _side_view(record: FlightRecord) -> Chart:
    """From the side: height over time."""
    vehicle, pad = paths(record)
    return Chart(
        title=f"From the side ({_known(record)})",
        x_label="time, s",
        y_label="height, m",
        bands=_bands(record),
        lines=(
            Line("pad", ORANGE, pad.t_s, [-z for z in pad.axis(2)]),
            Line("vehicle", BLUE, vehicle.t_s, [-z for z in vehicle.axis(2)]),
        ),
    )


def _known(record: FlightRecord) -> str:
    return "true" if record.true_vehicle.t_s else "as believed"


def _relative_charts(record: FlightRecord) -> list[Chart]:
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
            y_range=(0.0, 5.0),
        ),
        Chart(
            "Horizontal speed against the pad",
            "time, s",
            "m/s",
            (Line("believed", BLUE, record.relative_velocity.t_s, _horizontal(record.relative_velocity)),),
            y_range=(0.0, 3.0),
        ),
    ]


def _response_charts(record: FlightRecord) -> list[Chart]:
    return [
        *(
            Chart(
                f"Velocity {name}: asked and flown",
                "time, s",
                "m/s",
                (
                    Line("flown", GREY, record.vehicle_velocity.t_s, list(record.vehicle_velocity.axis(axis))),
                    Line("asked", BLUE, record.setpoint.t_s, list(record.setpoint.axis(axis))),
                ),
            )
            for axis, name in enumerate(("north", "east", "down"))
        ),
    ]


def _estimate_charts(record: FlightRecord) -> list[Chart]:
    """Errors of what is believed, where the truth is known, with three sigma; what each model of the bank is believed; innovations,
    and their squares with the 95 % bound."""
    sigma = record.pad_sigma_m
    t_s, errors = estimate_errors(record)
    bound = Line("3 sigma", ORANGE, sigma.t_s, [3.0 * value for value in sigma.values])
    error = Chart(
        "Error of the pad's place against the vehicle" if errors else "Uncertainty of the pad's place",
        "time, s",
        "m",
        (Line("true error", BLUE, t_s, list(errors)), bound) if errors else (bound,),
        y_range=(0.0, 3.0),
    )
    charts = [error, _model_chart(record)] if record.model_probabilities else [error]
    for key in sorted(record.nis):
        charts += [_innovation_chart(key, record.innovations[key]), _nis_chart(key, record.nis[key])]
    return charts


def _model_chart(record: FlightRecord) -> Chart:
    colours = (BLUE, ORANGE, GREEN, RED, GREY)
    lines = tuple(
        Line(model.replace("_", " "), colours[k % len(colours)], series.t_s, list(series.values))
        for k, (model, series) in enumerate(record.model_probabilities.items())
    )
    return Chart("Probability of each motion model", "time, s", "", lines, y_range=(0.0, 1.0))


def _innovation_chart(key: tuple[str, int], each: Sequence[Values]) -> Chart:
    """One component alone is the height."""
    axes = AXES[2:] if len(each) == 1 else AXES
    lines = tuple(
        Line(name, colour, series.t_s, list(series.values), dots=True)
        for (name, colour), series in zip(axes, each, strict=False)
    )
    return Chart(f"Innovations: {_named(key)}", "time, s", "m", lines)


def estimate_errors(record: FlightRecord) -> tuple[list[float], list[float]]:
    """Horizontal distance between believed and true relative position at the times of the truth, m."""
    times, errors, index, believed = [], [], 0, record.relative
    for i, t_s in enumerate(record.true_vehicle.t_s):
        while index + 1 < len(believed.t_s) and believed.t_s[index + 1] <= t_s:
            index += 1
        if index < len(believed.t_s) and abs(believed.t_s[index] - t_s) < 0.03:
            vehicle, pad = record.true_vehicle.values[i], record.true_pad.values[i]
            known = believed.values[index]
            times.append(t_s)
            errors.append(math.hypot(vehicle[0] - pad[0] - known[0], vehicle[1] - pad[1] - known[1]))
    return times, errors


def _named(key: tuple[str, int]) -> str:
    source, components = key
    return f"{source.replace('_', ' ')}, {components} component{'s' if components > 1 else ''}"


def _nis_chart(key: tuple[str, int], series: Values) -> Chart:
    bound = NIS_95.get(key[1], 0.0)
    span = (series.t_s[:1] + series.t_s[-1:]) or [0.0, 1.0]
    return Chart(
        f"Innovations squared: {_named(key)}",
        "time, s",
        "squared / variance",
        (
            Line("each", BLUE, series.t_s, list(series.values), dots=True),
            Line("95 %", ORANGE, span, [bound] * len(span), dashed=True),
        ),
        y_range=(0.0, 16.0),
    )


def _detection_chart(record: FlightRecord) -> Chart:
    return Chart(
        "Frames, and measurements rejected",
        "time, s",
        "",
        (
            Line("seen", GREEN, record.seen_s, [1.0] * len(record.seen_s), dots=True),
            Line("not seen", GREY, record.not_seen_s, [0.0] * len(record.not_seen_s), dots=True),
            Line("rejected", RED, record.rejected_s, [0.5] * len(record.rejected_s), dots=True),
        ),
        y_range=(-0.5, 1.5),
    )


def _delay_charts(record: FlightRecord) -> list[Chart]:
    """From when it was true to when it was handled; and from one setpoint to the next."""
    charts = [
        Chart(f"How late: {kind}", "time, s", "ms", (Line("", BLUE, v.t_s, [1e3 * s for s in v.values]),))
        for kind, v in sorted(record.delays_s.items())
    ]
    gaps = Line("", BLUE, record.setpoint_gaps_s.t_s, [1e3 * gap_s for gap_s in record.setpoint_gaps_s.values])
    return [*charts, Chart("From one setpoint to the next", "time, s", "ms", (gaps,), y_range=(0.0, 60.0))]


def _judged_table(record: FlightRecord) -> str:
    """What became of the measurements: how many of each source for each reason."""
    if not record.judged:
        return ""
    rows = "".join(
        f"<tr{_emphasis(not accepted)}><td>{escape(source.replace('_', ' '))}</td><td>{escape(reason)}</td><td>{count}</td></tr>"
        for (source, accepted, reason), count in sorted(record.judged.items())
    )
    return f"<table><tr><th>source</th><th>what became of it</th><th>measurements</th></tr>{rows}</table>"


def _health_table(record: FlightRecord) -> str:
    if not record.health:
        return "<p>No warning.</p>"
    rows = "".join(
        f"<tr{_emphasis(health.level >= 2)}><td>{t_s:.2f} s</td><td>{escape(health.subject)}</td><td>{escape(health.text)}</td></tr>"
        for t_s, health in record.health[:MOST_ROWS]
    )
    return f"<table>{rows}</table>"


def _horizontal(series: Series) -> list[float | None]:
    return [math.hypot(value[0], value[1]) for value in series.values]


def _phase_table(record: FlightRecord) -> str:
    rows = "".join(
        f"<tr><td>{t_s:.2f} s</td><td>{escape(str(phase))}</td><td>{escape(reason)}</td></tr>"
        for t_s, phase, reason in record.phases
    )
    return f"<table><tr><th>time</th><th>phase</th><th>why</th></tr>{rows}</table>"


def _request_table(record: FlightRecord) -> str:
    if not record.requests:
        return "<p>None.</p>"
    rows = "".join(f"<tr><td>{t_s:.2f} s</td><td>{escape(text)}</td></tr>" for t_s, text in record.requests)
    return f"<table>{rows}</table>"


def _figure_table(figures: Mapping[str, Any]) -> str:
    rows = "".join(
        f"<tr><th>{escape(str(key))}</th><td><code>{escape(str(value))}</code></td></tr>"
        for key, value in figures.items()
        if not isinstance(value, Mapping) and not key.startswith("phase_")  # those have a table of their own
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
