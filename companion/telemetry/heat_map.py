"""A table of coloured squares as SVG text: success (or any fraction) against two parameters. Used by campaign reports."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

CELL_WIDTH, CELL_HEIGHT, LABEL_WIDTH, TOP, BOTTOM = 104.0, 46.0, 130.0, 30.0, 40.0
EMPTY = "#f1f5f9"
_LOW, _MIDDLE, _HIGH = (220, 38, 38), (250, 204, 21), (22, 163, 74)


@dataclass(frozen=True, slots=True)
class Square:
    """`fraction` 0 to 1 gives the colour; two lines of text."""

    fraction: float
    text: str
    detail: str = ""


@dataclass(frozen=True, slots=True)
class HeatMap:
    """Columns from left to right, rows from top to bottom; `squares` by (column, row), missing ones stay grey."""

    title: str
    x_label: str
    y_label: str
    columns: Sequence[str]
    rows: Sequence[str]
    squares: Mapping[tuple[int, int], Square]


def heat_map_svg(chart: HeatMap) -> str:
    """The map as one <svg> element."""
    width = LABEL_WIDTH + CELL_WIDTH * len(chart.columns) + 12.0
    height = TOP + CELL_HEIGHT * len(chart.rows) + BOTTOM
    parts = [
        f'<svg viewBox="0 0 {width:.0f} {height:.0f}" style="max-width:{1.3 * width:.0f}px" role="img" '
        f'aria-label="{escape(chart.title)}">',
        f'<text class="title" x="8" y="18">{escape(chart.title)}</text>',
        *(_square(chart, column, row) for row in range(len(chart.rows)) for column in range(len(chart.columns))),
        *_labels(chart, width, height),
        "</svg>",
    ]
    return "".join(parts)


def colour(fraction: float) -> str:
    """Red at 0.5 and below, yellow at 0.85, green at 1: the interesting differences are near the top."""
    if fraction < 0.85:
        low, high, share = _LOW, _MIDDLE, max(0.0, (fraction - 0.5) / 0.35)
    else:
        low, high, share = _MIDDLE, _HIGH, min(1.0, (fraction - 0.85) / 0.15)
    mixed = (round(a + share * (b - a)) for a, b in zip(low, high, strict=True))
    return "#" + "".join(f"{channel:02x}" for channel in mixed)


def _square(chart: HeatMap, column: int, row: int) -> str:
    x, y = LABEL_WIDTH + CELL_WIDTH * column, TOP + CELL_HEIGHT * row
    square = chart.squares.get((column, row))
    fill = EMPTY if square is None else colour(square.fraction)
    box = f'<rect x="{x:.0f}" y="{y:.0f}" width="{CELL_WIDTH - 2:.0f}" height="{CELL_HEIGHT - 2:.0f}" rx="4" fill="{fill}"/>'
    if square is None:
        return box
    middle = x + CELL_WIDTH / 2.0 - 1.0
    return (
        f'{box}<text x="{middle:.0f}" y="{y + 19:.0f}" text-anchor="middle" style="font-weight:600;fill:#0f172a">'
        f'{escape(square.text)}</text><text x="{middle:.0f}" y="{y + 34:.0f}" text-anchor="middle" '
        f'style="font-size:9px;fill:#0f172a">{escape(square.detail)}</text>'
    )


def _labels(chart: HeatMap, width: float, height: float) -> list[str]:
    below = height - BOTTOM + 14.0
    columns = [
        f'<text class="tick" x="{LABEL_WIDTH + CELL_WIDTH * (i + 0.5) - 1:.0f}" y="{below:.0f}" text-anchor="middle">'
        f"{escape(name)}</text>"
        for i, name in enumerate(chart.columns)
    ]
    rows = [
        f'<text class="tick" x="{LABEL_WIDTH - 8:.0f}" y="{TOP + CELL_HEIGHT * (i + 0.5) + 3:.0f}" text-anchor="end">'
        f"{escape(name)}</text>"
        for i, name in enumerate(chart.rows)
    ]
    middle = LABEL_WIDTH + CELL_WIDTH * len(chart.columns) / 2.0
    axis = (
        f'<text class="tick" x="{middle:.0f}" y="{height - 6:.0f}" text-anchor="middle">{escape(chart.x_label)}</text>'
    )
    return [*columns, *rows, axis, f'<text class="tick" x="8" y="{below:.0f}">{escape(chart.y_label)}</text>']
