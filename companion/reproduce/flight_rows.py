"""What the pages of several papers say and draw of one flight: whether it landed, how far off, its phases in the charts."""

from __future__ import annotations

import math

from companion.messages import Phase
from companion.reproduce.row import Row, number_row, said_row
from companion.reproduce.watched_flight import WatchedFlight
from companion.telemetry.svg_plot import Band

COLOURS = {
    Phase.SEARCH: "#f1f1f1",
    Phase.FOLLOW: "#eef6ff",
    Phase.DESCEND: "#e9f9ee",
    Phase.HOLD: "#fdeaea",
    Phase.COMMIT: "#fff5dc",
}


def landed_row(table: str, flight: WatchedFlight, name: str = "landed") -> Row:
    """The paper's vehicle did."""
    return said_row(table, name, "yes", flight.result.outcome, holds=flight.landed)


def error_row(table: str, flight: WatchedFlight) -> Row:
    """Horizontal, at the first contact; no paper prints it."""
    error = flight.result.verdict.touchdown_error_m
    return number_row(table, "touchdown error", None, math.nan if error is None else round(error, 3), "m", 0.0)


def phase_bands(flight: WatchedFlight) -> tuple[Band, ...]:
    """The phases that have a colour, as bands of a chart over time."""
    changes = flight.watch.changes
    ends = [*(t_s for t_s, _ in changes[1:]), flight.result.simulated_s]
    return tuple(
        Band(begin, end, change.after.value, COLOURS[change.after])
        for (begin, change), end in zip(changes, ends, strict=True)
        if change.after in COLOURS
    )
