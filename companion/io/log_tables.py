"""Any log as tables: one for each message type, a column for each number or text. For info, export and plots.

.tlog anybody's, .mcap ours (or any with JSON messages), .ulg PX4's with the extra `ulog`. Times are seconds since the first
message of the log. Arrays become columns `name[i]`. Damaged places are stepped over and counted in `damage`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from companion.io.log_inputs import LogInputsError, read_ulog
from companion.io.mcap_log import FRAME_TOPIC, McapLog, McapLogError
from companion.io.tlog_columns import MessageColumns, TlogColumns

Columns = dict[str, list[Any]]


class LogError(ValueError):
    """This log, or this part of it, cannot be read; the text says why."""


@dataclass(frozen=True, slots=True)
class Table:
    """All messages of one type. Columns have the length of `t_s`; None where a message lacks the field."""

    name: str
    t_s: list[float]
    columns: Columns


@dataclass(slots=True)
class LogContent:
    """What is in a log. `table` makes one table when it is asked for."""

    kind: str
    counts: dict[str, int]
    duration_s: float
    table: Callable[[str], Table]
    damage: str = "none"
    about: dict[str, str] = field(default_factory=dict)

    @property
    def messages(self) -> int:
        return sum(self.counts.values())


def read_log(path: Path) -> LogContent:
    """Open a log by what its name ends with; LogError where that does not work."""
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise LogError(f"{path}: not a log that is known here ({', '.join(READERS)})")
    try:
        return reader(path)
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror}") from error
    except (McapLogError, LogInputsError) as error:
        raise LogError(f"{path}: {error}") from error


# ---------------------------------------------------------------------------------------------------------------- tlog


def _read_tlog(path: Path) -> LogContent:
    log = TlogColumns.read(path)
    counts = {name: log.count(name) for name in log}
    start_us, end_us = _extent_us(log)
    unknown = sum(log.unknown_ids.values())
    damage = [f"{log.bytes_skipped} bytes unreadable"] if log.bytes_skipped else []
    damage += [f"{unknown} messages of unknown type"] if unknown else []
    return LogContent(
        kind="MAVLink telemetry log",
        counts=counts,
        duration_s=(end_us - start_us) / 1e6,
        table=lambda name: _tlog_table(log[name], start_us),
        damage=", ".join(damage) or "none",
        about={"senders": _senders(log)},
    )


def _extent_us(log: TlogColumns) -> tuple[int, int]:
    """First and last time; the middle 98 % say which damaged stamps stand far out."""
    stamps = [log[name].t_us for name in log]
    if not stamps:
        return 0, 0
    t_us = np.sort(np.concatenate(stamps))
    spare = len(t_us) // 100
    low, high = int(t_us[spare]), int(t_us[-1 - spare])
    margin = 60_000_000 + (high - low) // 30
    near = t_us[(t_us >= low - margin) & (t_us <= high + margin)]
    return int(near[0]), int(near[-1])


def _senders(log: TlogColumns) -> str:
    found = {pair for name in log for pair in zip(log[name].system.tolist(), log[name].component.tolist(), strict=True)}
    return " ".join(f"{system}/{component}" for system, component in sorted(found)[:20])


def _tlog_table(found: MessageColumns, start_us: int) -> Table:
    columns: Columns = {"system": found.system.tolist(), "component": found.component.tolist()}
    for name in found.fields:
        columns |= dict(_spread(name, found[name]))
    return Table(found.name, ((found.t_us - start_us) / 1e6).tolist(), columns)


def _spread(name: str, values: Any) -> Iterator[tuple[str, list[Any]]]:
    """One column, or one for each element of an array; bytes as text."""
    if values.dtype.kind == "S":
        yield name, [value.split(b"\0")[0].decode("utf-8", "replace") for value in values.tolist()]
    elif values.ndim == 1:
        yield name, values.tolist()
    else:
        for index in range(values.shape[1]):
            yield f"{name}[{index}]", values[:, index].tolist()


# ---------------------------------------------------------------------------------------------------------------- mcap


def _read_mcap(path: Path) -> LogContent:
    log = McapLog.read(path)
    times = [record.log_ns for record in log.records()]
    start_ns = times[0] if times else 0
    about = {key: value for key, value in log.about.items() if key != "config"}
    return LogContent(
        kind="MCAP log of Companion" if log.is_ours else "MCAP log",
        counts=dict(sorted(log.counts().items())),
        duration_s=(max(times) - min(times)) / 1e9 if times else 0.0,
        table=lambda name: _mcap_table(log, name, start_ns),
        damage=str(log.damage),
        about=about,
    )


def _mcap_table(log: McapLog, topic: str, start_ns: int) -> Table:
    rows: list[dict[str, Any]] = []
    t_s: list[float] = []
    for record in log.records():
        if record.topic != topic:
            continue
        try:
            content = msgspec.json.decode(record.data)
        except msgspec.DecodeError:
            log.damage.messages += 1
            continue
        if topic.startswith(FRAME_TOPIC) and isinstance(content, dict):
            content.pop("data", None)
        rows.append(dict(flattened(content)))
        t_s.append((record.log_ns - start_ns) / 1e9)
    found = dict.fromkeys(name for row in rows for name in row)
    names = [name for name in found if f"{name}[0]" not in found]  # where an array is null in some rows
    return Table(topic, t_s, {name: [row.get(name) for row in rows] for name in names})


def flattened(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Leaves of nested JSON: `covariance[0][3]`, `timestamp.sec`."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from flattened(inner, f"{path}.{key}" if path else str(key))
    elif isinstance(value, list):
        for index, inner in enumerate(value):
            yield from flattened(inner, f"{path}[{index}]")
    else:
        yield path or "value", value


# ---------------------------------------------------------------------------------------------------------------- ulog


def _read_ulog(path: Path) -> LogContent:
    log = read_ulog(path)
    names = {(f"{data.name}[{data.multi_id}]" if data.multi_id else data.name): data for data in log.data_list}
    start_us = int(log.start_timestamp)

    def table(name: str) -> Table:
        data = names[name].data
        columns = {key: values.tolist() for key, values in data.items() if key != "timestamp"}
        return Table(name, ((data["timestamp"].astype(np.int64) - start_us) / 1e6).tolist(), columns)

    return LogContent(
        kind="PX4 flight log",
        counts={name: len(data.data["timestamp"]) for name, data in sorted(names.items())},
        duration_s=(log.last_timestamp - log.start_timestamp) / 1e6,
        table=table,
        damage="some of it is corrupt" if log.file_corruption else "none",
        about={
            key: str(value)
            for key, value in log.msg_info_dict.items()
            if key in ("ver_sw_release", "ver_hw", "sys_name")
        },
    )


READERS: dict[str, Callable[[Path], LogContent]] = {".tlog": _read_tlog, ".mcap": _read_mcap, ".ulg": _read_ulog}
