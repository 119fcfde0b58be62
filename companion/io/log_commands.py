"""What `companion log` does: info, export to CSV or Parquet, plot to one HTML page."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

from companion.io.frame_folder import TIMES
from companion.io.log_tables import LogContent, LogError, Table, read_log
from companion.io.mcap_log import McapLog
from companion.telemetry.svg_plot import Chart, Line, svg

COLOURS = ("#1f6feb", "#d1242f", "#1a7f37", "#9a6700", "#8250df", "#0a7ea4")
LARGEST_DRAWN = 1e12
_PAGE = """<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{title}</title><style>
body{{font:15px/1.4 system-ui,sans-serif;max-width:1100px;margin:1.5rem auto;padding:0 1rem;color:#222}}
svg{{width:100%;height:auto;margin:.6rem 0}} .grid{{stroke:#ddd;stroke-width:1}} .tick,.legend{{font-size:11px;fill:#555}}
.title{{font-size:13px;font-weight:600}} .legend{{fill:currentColor}}</style></head><body><h1>{title}</h1>{charts}</body></html>
"""


def info(path: Path) -> dict[str, Any]:
    """What is in a log, as a dictionary for --json and for people."""
    log = read_log(path)
    rate = {
        name: round(count / log.duration_s, 2) if log.duration_s > 0.0 else None for name, count in log.counts.items()
    }
    return {
        "file": str(path),
        "kind": log.kind,
        "bytes": path.stat().st_size,
        "duration_s": round(log.duration_s, 3),
        "messages": log.messages,
        "damage": log.damage,
        "about": log.about,
        "topics": {name: {"count": count, "rate_hz": rate[name]} for name, count in log.counts.items()},
    }


def info_lines(found: dict[str, Any]) -> list[str]:
    """The same for people."""
    lines = [
        f"{found['file']}: {found['kind']}, {found['bytes'] / 1e6:.2f} MB, {found['duration_s']:.1f} s, "
        f"{found['messages']} messages; damage: {found['damage']}",
        *(f"  {key}: {value}" for key, value in found["about"].items()),
    ]
    width = max((len(name) for name in found["topics"]), default=0)
    for name, topic in found["topics"].items():
        rate = "" if topic["rate_hz"] is None else f"{topic['rate_hz']:9.2f} Hz"
        lines.append(f"  {name:{width}} {topic['count']:8d} {rate}")
    return lines


# -------------------------------------------------------------------------------------------------------------- export


def export(path: Path, folder: Path, *, topics: Sequence[str] = (), form: str = "csv") -> list[Path]:
    """One file for each message type; LogError where a topic is not in the log or the form cannot be written."""
    log = read_log(path)
    names = [_topic(log, name) for name in topics] or list(log.counts)
    write = _FORMS.get(form)
    if write is None:
        raise LogError(f"{form!r}: not a form that can be written ({', '.join(_FORMS)})")
    if form == "parquet":
        _parquet()
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for name in names:
        target = folder / f"{re.sub(r'[^A-Za-z0-9_.-]+', '_', name).strip('_')}.{form}"
        write(target, log.table(name))
        written.append(target)
    return written


def export_frames(path: Path, folder: Path) -> int:
    """The frames in one of our .mcap files as pictures, with times.csv for `companion replay --frames`."""
    if path.suffix.lower() != ".mcap":
        raise LogError(f"{path}: only .mcap files hold frames")
    log = McapLog.read(path)
    start_ns = next((entry.arrived_ns for entry in log.entries()), 0) + log.log_minus_companion_ns
    folder.mkdir(parents=True, exist_ok=True)
    rows = []
    for index, (camera, t_ns, jpeg) in enumerate(log.frames()):
        name = f"{re.sub(r'[^A-Za-z0-9_-]+', '_', camera)}-{index:05d}.jpg"
        (folder / name).write_bytes(jpeg)
        rows.append((name, f"{(t_ns - start_ns) / 1e9:.9f}"))
    with (folder / TIMES).open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([("file", "t_s"), *rows])
    return len(rows)


def _write_csv(path: Path, table: Table) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["t_s", *table.columns])
        writer.writerows(zip((f"{t:.6f}" for t in table.t_s), *table.columns.values(), strict=True))


def _write_parquet(path: Path, table: Table) -> None:
    arrow, parquet = _parquet()
    parquet.write_table(arrow.table({"t_s": table.t_s, **table.columns}), path)


def _parquet() -> tuple[Any, Any]:
    try:
        import pyarrow  # type: ignore[import-not-found,unused-ignore]
        import pyarrow.parquet  # type: ignore[import-not-found,unused-ignore]
    except ImportError as error:
        raise LogError(
            "Parquet needs pyarrow, which is not installed: pip install 'companion[parquet]', or --format csv"
        ) from error
    return pyarrow, pyarrow.parquet


_FORMS = {"csv": _write_csv, "parquet": _write_parquet}


def _topic(log: LogContent, name: str) -> str:
    """Names may be given without the leading slash and in any case."""
    for known in log.counts:
        if known.lower().lstrip("/") == name.lower().lstrip("/"):
            return known
    raise LogError(f"{name!r} is not in this log; it holds {', '.join(log.counts)}")


# ---------------------------------------------------------------------------------------------------------------- plot


def plot(path: Path, fields: Sequence[str], target: Path) -> Path:
    """One page with a chart for each message type: `pad_estimate.position_ned_m` draws all elements of an array."""
    log = read_log(path)
    by_topic: dict[str, list[str]] = {}
    for text in fields:
        topic, dot, name = text.lstrip("/").partition(".")
        if not dot:
            raise LogError(f"{text!r}: expected MESSAGE.FIELD, as in pad_estimate.position_ned_m")
        by_topic.setdefault(_topic(log, topic), []).append(name)
    charts = "".join(_chart(log.table(topic), names) for topic, names in by_topic.items())
    target.write_text(_PAGE.format(title=escape(path.name), charts=charts), encoding="utf-8")
    return target


def _chart(table: Table, names: Sequence[str]) -> str:
    columns = [column for name in names for column in _columns(table, name)]
    lines = tuple(
        Line(name, COLOURS[i % len(COLOURS)], table.t_s, [_drawable(value) for value in table.columns[name]])
        for i, name in enumerate(columns)
    )
    return svg(Chart(table.name, "time, s", ", ".join(names), lines, y_range=_flat_range(lines), width=1000.0))


def _columns(table: Table, name: str) -> list[str]:
    """The column of this name, or the elements of the array of this name."""
    found = [column for column in table.columns if column == name or column.startswith((f"{name}[", f"{name}."))]
    if not found:
        raise LogError(f"{table.name} has no field {name!r}; it has {', '.join(table.columns)}")
    return found


def _drawable(value: Any) -> float | None:
    if not isinstance(value, int | float) or not math.isfinite(value) or abs(value) > LARGEST_DRAWN:
        return None
    return float(value)


def _flat_range(lines: Sequence[Line]) -> tuple[float, float] | None:
    """A range for lines that do not move: the chart's own margin vanishes in large numbers."""
    values = [value for line in lines for value in line.y if value is not None]
    if not values or max(values) - min(values) > 1e-9 * max(map(abs, values)):
        return None
    spare = 0.5 + 0.01 * abs(values[0])
    return values[0] - spare, values[0] + spare
