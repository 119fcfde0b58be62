"""`companion report`: the page of a run folder or of any log, made from the log alone.

Our .mcap holds what was believed, asked and (in simulation) true: it is drawn as it was. Anybody's .tlog or .ulg, and a
.mcap with inputs only, goes through a replay, and the page shows what our estimator and controller make of it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from companion.io.mcap_log import McapLog, McapLogError
from companion.messages import PhaseChanged
from companion.replay import ReplayError, ReplayOptions, replay
from companion.telemetry.flight_record import FlightRecord
from companion.telemetry.report import report_html

RUN_FILES = ("flight.mcap", "flight.tlog")


class ReportError(ValueError):
    """No report can be made of this; the text says why."""


def write_report(path: Path, out: Path | None, options: ReplayOptions) -> Path:
    """Make the page of a log or a run folder; returns where it is. ReportErrors and ReplayErrors say what is wrong."""
    log = _log_of(path)
    figures = _figures_beside(log)
    record = _recorded(log)
    if record is None:
        record, figures = replayed(log, options)
    title = f"{log.parent.name}/{log.name}" if log.name in RUN_FILES else log.name
    ended = record.phases[-1] if record.phases else None
    line = f"{figures.get('outcome', 'a log')}: {'nothing was flown' if ended is None else f'{ended[1]}: {ended[2]}'}"
    target = out or (log.parent / "report.html" if log.name in RUN_FILES else Path(f"{log.stem}.html"))
    try:
        target.write_text(report_html(record, figures, title=title, line=line), encoding="utf-8")
    except OSError as error:
        raise ReportError(f"{target}: cannot be written: {error.strerror}") from error
    return target


def replayed(log: Path, options: ReplayOptions) -> tuple[FlightRecord, dict[str, Any]]:
    """What a replay makes of the log, message by message."""
    record = FlightRecord()
    result = replay(log, options.watched_by(record.add))
    return record, {"outcome": "replayed", "mode": result.mode, "damage": result.damage, **result.figures}


def _log_of(path: Path) -> Path:
    if not path.is_dir():
        return path
    for name in RUN_FILES:
        if (path / name).is_file():
            return path / name
    raise ReportError(f"{path}: neither {' nor '.join(RUN_FILES)} in this folder")


def _figures_beside(log: Path) -> dict[str, Any]:
    """run.json of the folder, where there is one."""
    try:
        content = json.loads((log.parent / "run.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return dict(content) if isinstance(content, Mapping) and log.name in RUN_FILES else {}


def _recorded(path: Path) -> FlightRecord | None:
    """The flight as the log tells it; None where the log holds no answers of ours."""
    if path.suffix.lower() != ".mcap":
        return None
    try:
        log = McapLog.read(path)
    except (OSError, McapLogError) as error:
        raise ReplayError(f"{path}: {error}") from error
    record = FlightRecord()
    entries = list(log.entries())
    if not any(isinstance(entry.message, PhaseChanged) or entry.cause is not None for entry in entries):
        return None
    record.seconds(entries[0].message.t_ns)
    shift_ns = log.log_minus_companion_ns
    for _, t_ns, jpeg in log.frames():
        record.add_frame(t_ns - shift_ns, jpeg)
    record.add_entries(entries)
    for t_ns, vehicle, pad in log.truths():
        record.add_truth(t_ns, vehicle, pad)
    return record
