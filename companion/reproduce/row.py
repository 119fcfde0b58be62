"""What a reproduction hands to its page: rows of printed against ours, figures, errata.

One module a paper (`companion/reproduce/<key>.py`) makes a Reproduction; `command.py` prints it and writes it as a page.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from companion.telemetry.svg_plot import Chart

Verdict = Literal["same", "better", "differs", "not printed"]
"""`same`: within the tolerance. `better`: outside it, on the good side. `not printed`: the paper has no such number."""


@dataclass(frozen=True, slots=True)
class Row:
    """One line: what the paper printed, what we measured, and whether they agree within `tolerance` (same unit)."""

    table: str
    name: str
    printed: float | str | None
    ours: float | str
    unit: str
    tolerance: str
    verdict: Verdict


@dataclass(frozen=True, slots=True)
class Reproduction:
    """Everything about one paper. `rows` keep the paper's order; `notes` say how what it leaves open was read."""

    key: str
    title: str
    rows: tuple[Row, ...]
    figures: tuple[Chart, ...]
    errata: tuple[str, ...]
    notes: tuple[str, ...]


Reproduce = Callable[[bool], Reproduction]
"""Argument: quick (seconds, for the test suite) or full (minutes, for docs/papers)."""


def number_row(
    table: str, name: str, printed: float | None, ours: float, unit: str, tolerance: float, *, good: int = 0
) -> Row:
    """A row of numbers. `good`: +1 where more is better, -1 where less is, 0 where neither."""
    if printed is None:
        return Row(table, name, None, ours, unit, "", "not printed")
    difference = ours - printed
    verdict: Verdict = "same" if abs(difference) <= tolerance else "better" if difference * good > 0 else "differs"
    return Row(table, name, printed, ours, unit, f"{tolerance:g}", verdict)


def said_row(table: str, name: str, printed: str, ours: str, *, holds: bool) -> Row:
    """A row of words: the same where it holds."""
    return Row(table, name, printed, ours, "", "", "same" if holds else "differs")
