"""Small line charts as SVG text, without a library: axes with round ticks, several lines, shaded phases, equal scale if asked."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from itertools import pairwise

MARGIN_LEFT, MARGIN_RIGHT, MARGIN_TOP, MARGIN_BOTTOM = 56.0, 12.0, 26.0, 34.0
MAX_POINTS = 1500
"""More than a screen has pixels: longer lines are thinned."""


@dataclass(frozen=True, slots=True)
class Line:
    """One polyline. Points whose y is None break it."""

    name: str
    colour: str
    x: Sequence[float]
    y: Sequence[float | None]
    dashed: bool = False
    dots: bool = False


@dataclass(frozen=True, slots=True)
class Band:
    """A stretch of the x axis with a background colour and a name."""

    start: float
    end: float
    name: str
    colour: str


@dataclass(frozen=True, slots=True)
class Chart:
    """`equal` gives both axes one scale (maps). `x_range` and `y_range` fix an axis, else it fits the data.

    A line that leaves the range is cut there; dots outside lie on its edge.
    """

    title: str
    x_label: str
    y_label: str
    lines: tuple[Line, ...]
    bands: tuple[Band, ...] = ()
    equal: bool = False
    x_range: tuple[float, float] | None = None
    y_range: tuple[float, float] | None = None
    width: float = 560.0
    height: float = 300.0


@dataclass(frozen=True, slots=True)
class _Scale:
    low: float
    high: float
    start_px: float
    end_px: float

    def px(self, value: float) -> float:
        return self.start_px + (value - self.low) / (self.high - self.low) * (self.end_px - self.start_px)


def svg(chart: Chart) -> str:
    """The chart as one <svg> element."""
    x, y = _scales(chart)
    parts = [
        f'<svg viewBox="0 0 {chart.width:.0f} {chart.height:.0f}" role="img" aria-label="{escape(chart.title)}">',
        f'<text class="title" x="{MARGIN_LEFT}" y="16">{escape(chart.title)}</text>',
        *(_band(band, x, chart) for band in chart.bands),
        *_ticks(chart, x, y),
        *(_line(line, x, y) for line in chart.lines),
        *_says_empty(chart),
        _legend(chart),
        "</svg>",
    ]
    return "".join(parts)


def _scales(chart: Chart) -> tuple[_Scale, _Scale]:
    xs = [v for line in chart.lines for v in line.x]
    ys = [v for line in chart.lines for v in line.y if v is not None]
    x_low, x_high = chart.x_range or _padded(xs)
    y_low, y_high = chart.y_range or _padded(ys)
    width = chart.width - MARGIN_LEFT - MARGIN_RIGHT
    height = chart.height - MARGIN_TOP - MARGIN_BOTTOM
    if chart.equal:
        unit = max((x_high - x_low) / width, (y_high - y_low) / height)
        x_mid, y_mid = (x_low + x_high) / 2.0, (y_low + y_high) / 2.0
        x_low, x_high = x_mid - unit * width / 2.0, x_mid + unit * width / 2.0
        y_low, y_high = y_mid - unit * height / 2.0, y_mid + unit * height / 2.0
    return (
        _Scale(x_low, x_high, MARGIN_LEFT, MARGIN_LEFT + width),
        _Scale(y_low, y_high, MARGIN_TOP + height, MARGIN_TOP),
    )


def _padded(values: Sequence[float]) -> tuple[float, float]:
    low, high = (min(values), max(values)) if values else (0.0, 1.0)
    spare = 0.05 * (high - low) or 0.5
    return low - spare, high + spare


def round_ticks(low: float, high: float, count: int = 6) -> list[float]:
    """About `count` round numbers inside the range."""
    step = 10.0 ** math.floor(math.log10((high - low) / count))
    step *= next(factor for factor in (1.0, 2.0, 5.0, 10.0) if (high - low) / (step * factor) <= count)
    first = math.ceil(low / step)
    return [round(i * step, 10) for i in range(first, math.floor(high / step) + 1)]


def _ticks(chart: Chart, x: _Scale, y: _Scale) -> list[str]:
    bottom, top = y.start_px, y.end_px
    parts = []
    for tick in round_ticks(x.low, x.high):
        px = x.px(tick)
        parts.append(f'<line class="grid" x1="{px:.1f}" x2="{px:.1f}" y1="{top:.1f}" y2="{bottom:.1f}"/>')
        parts.append(f'<text class="tick" x="{px:.1f}" y="{bottom + 14:.1f}" text-anchor="middle">{tick:g}</text>')
    for tick in round_ticks(y.low, y.high):
        py = y.px(tick)
        parts.append(f'<line class="grid" x1="{x.start_px:.1f}" x2="{x.end_px:.1f}" y1="{py:.1f}" y2="{py:.1f}"/>')
        parts.append(f'<text class="tick" x="{x.start_px - 5:.1f}" y="{py + 4:.1f}" text-anchor="end">{tick:g}</text>')
    middle = (x.start_px + x.end_px) / 2.0
    parts.append(
        f'<text class="tick" x="{middle:.0f}" y="{chart.height - 4:.0f}" text-anchor="middle">{escape(chart.x_label)}</text>'
    )
    parts.append(
        f'<text class="tick" transform="translate(12 {(top + bottom) / 2:.0f}) rotate(-90)" text-anchor="middle">'
        f"{escape(chart.y_label)}</text>"
    )
    return parts


def _band(band: Band, x: _Scale, chart: Chart) -> str:
    left, right = max(x.px(band.start), x.start_px), min(x.px(band.end), x.end_px)
    if right <= left:
        return ""
    height = chart.height - MARGIN_TOP - MARGIN_BOTTOM
    name = f'<text class="band" x="{left + 3:.1f}" y="{MARGIN_TOP + 11:.1f}">{escape(band.name)}</text>'
    return (
        f'<rect x="{left:.1f}" y="{MARGIN_TOP}" width="{right - left:.1f}" height="{height:.1f}" fill="{band.colour}">'
        f"<title>{escape(band.name)}</title></rect>" + (name if right - left > 7.0 * len(band.name) else "")
    )


def _says_empty(chart: Chart) -> list[str]:
    """An empty chart says that it is meant to be empty."""
    if any(value is not None for line in chart.lines for value in line.y):
        return []
    across = (MARGIN_LEFT + chart.width - MARGIN_RIGHT) / 2.0
    down = (MARGIN_TOP + chart.height - MARGIN_BOTTOM) / 2.0
    return [f'<text x="{across:.0f}" y="{down:.0f}" text-anchor="middle">nothing of this in the log</text>']


_Point = tuple[float, float]


def _line(line: Line, x: _Scale, y: _Scale) -> str:
    stride = max(1, len(line.x) // MAX_POINTS)
    points = [
        None if value is None else (x.px(at), y.px(value))
        for at, value in list(zip(line.x, line.y, strict=True))[::stride]
    ]
    if line.dots:
        inside = [(p[0], min(max(p[1], y.end_px), y.start_px)) for p in points if p]
        return "".join(f'<circle cx="{a:.1f}" cy="{b:.1f}" r="2.2" fill="{line.colour}"/>' for a, b in inside)
    dash = ' stroke-dasharray="5 3"' if line.dashed else ""
    path = _path(points, y.end_px - 1.0, y.start_px + 1.0)
    return f'<path d="{path}" fill="none" stroke="{line.colour}" stroke-width="1.6"{dash}/>'


def _path(points: Sequence[_Point | None], top: float, bottom: float) -> str:
    """The polyline's commands, cut where it leaves the stretch from `top` to `bottom`."""
    commands: list[str] = []
    pen: _Point | None = None
    for before, after in pairwise(points):
        cut = None if before is None or after is None else _cut(before, after, top, bottom)
        if cut is None:
            continue
        if pen != cut[0]:
            commands.append(f"M{cut[0][0]:.1f} {cut[0][1]:.1f}")
        commands.append(f"L{cut[1][0]:.1f} {cut[1][1]:.1f}")
        pen = cut[1]
    return "".join(commands)


def _cut(a: _Point, b: _Point, top: float, bottom: float) -> tuple[_Point, _Point] | None:
    """The part of a stroke with `top` <= y <= `bottom`; None where it has none."""
    if top <= a[1] <= bottom and top <= b[1] <= bottom:
        return a, b
    if max(a[1], b[1]) < top or min(a[1], b[1]) > bottom:
        return None
    low, high = sorted(((top - a[1]) / (b[1] - a[1]), (bottom - a[1]) / (b[1] - a[1])))

    def at(share: float) -> _Point:
        return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])

    return at(max(low, 0.0)) if low > 0.0 else a, at(high) if high < 1.0 else b


def _legend(chart: Chart) -> str:
    parts, at = [], chart.width - MARGIN_RIGHT
    for line in reversed([line for line in chart.lines if line.name]):
        parts.append(
            f'<text class="legend" x="{at:.0f}" y="16" text-anchor="end" style="fill:{line.colour}">{escape(line.name)}</text>'
        )
        at -= 6.6 * len(line.name) + 14.0
    return "".join(parts)
