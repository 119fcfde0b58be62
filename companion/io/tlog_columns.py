"""A .tlog as columns: one structured numpy array for each message type, fields named as in the MAVLink XML.

    log = TlogColumns.read(path)
    odometry = log["ODOMETRY"]
    odometry.t_us, odometry["x"], odometry["q"]          # (n,), (n,), (n, 4)

Frames of all senders are there; `system` and `component` tell them apart. Columns are made when they are asked for.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from companion.io.tlog_scan import STAMP, Integers, Scan, compiled, compiler_pays, scan_compiled, scan_plain
from companion.mavlink.codec import Definition, full_dialect

Bytes = npt.NDArray[np.uint8]
Gather = Callable[[Bytes, Integers, Integers, Bytes], None]
_NUMPY = {"b": "i1", "B": "u1", "h": "<i2", "H": "<u2", "i": "<i4", "I": "<u4", "q": "<i8", "Q": "<u8"} | {
    "f": "<f4",
    "d": "<f8",
}


@dataclass(frozen=True, slots=True, eq=False)
class MessageColumns:
    """All messages of one type in the order of the file."""

    name: str
    message_id: int
    t_us: Integers
    system: Bytes
    component: Bytes
    sequence: Bytes
    values: npt.NDArray[Any]

    def __getitem__(self, field: str) -> npt.NDArray[Any]:
        return self.values[field]

    def __len__(self) -> int:
        return len(self.t_us)

    @property
    def fields(self) -> tuple[str, ...]:
        return tuple(self.values.dtype.names or ())


class TlogColumns(Mapping[str, MessageColumns]):
    """Message name to columns. `unknown_ids` counts frames of which no dialect knows the layout."""

    def __init__(self, data: bytes, *, use_compiler: bool | None = None) -> None:
        self._use_compiler = compiler_pays(data) if use_compiler is None else use_compiler
        found = scan_compiled(data) if self._use_compiler else scan_plain(data)
        self._data = np.frombuffer(data, np.uint8)
        self.frames = len(found.starts)
        self.bytes_skipped = found.bytes_skipped
        self._starts_by_id = _grouped(found)
        known = full_dialect()
        self._definitions = {known[i].name: known[i] for i in self._starts_by_id if i in known}
        self.unknown_ids = {i: len(starts) for i, starts in self._starts_by_id.items() if i not in known}
        self._made: dict[str, MessageColumns] = {}

    @classmethod
    def read(cls, path: Path) -> TlogColumns:
        return cls(path.read_bytes())

    def __getitem__(self, name: str) -> MessageColumns:
        if name not in self._made:
            definition = self._definitions[name]
            starts = self._starts_by_id[definition.message_id]
            self._made[name] = _columns(
                self._data, definition, starts, _gather() if self._use_compiler else numpy_gather
            )
        return self._made[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._definitions)

    def __len__(self) -> int:
        return len(self._definitions)

    def count(self, name: str) -> int:
        """How many messages of this name there are, without making their columns."""
        definition = self._definitions.get(name)
        return 0 if definition is None else len(self._starts_by_id[definition.message_id])


def _grouped(found: Scan) -> dict[int, Integers]:
    """Frame starts by message id, each in the order of the file."""
    narrow = found.message_ids.astype(np.uint16) if found.message_ids.max(initial=0) < 65536 else found.message_ids
    order = np.argsort(narrow, kind="stable")
    ids, first = np.unique(found.message_ids[order], return_index=True)
    return dict(zip(ids.tolist(), np.split(found.starts[order], first[1:]), strict=True)) if len(ids) else {}


def _columns(data: Bytes, definition: Definition, starts: Integers, fill: Gather) -> MessageColumns:
    is_v2 = data[starts] == 0xFD
    sender = starts + np.where(is_v2, 4, 2)
    dtype = record_type(definition)
    payloads = starts + np.where(is_v2, 10, 6)
    stamps = _rows(data, starts - STAMP, np.full(len(starts), STAMP), STAMP, fill)
    return MessageColumns(
        name=definition.name,
        message_id=definition.message_id,
        t_us=stamps.view(">u8").ravel().astype(np.int64),
        system=data[sender + 1],
        component=data[sender + 2],
        sequence=data[sender],
        values=_rows(data, payloads, data[starts + 1].astype(np.int64), dtype.itemsize, fill).view(dtype).ravel(),
    )


def _rows(data: Bytes, starts: Integers, lengths: Integers, width: int, fill: Gather) -> Bytes:
    """(n, width): `lengths` bytes from each start, zeros behind them."""
    rows = np.zeros((len(starts), width), np.uint8)
    fill(data, starts, lengths, rows)
    return rows


@functools.cache
def _gather() -> Gather:
    return compiled(gather)


def gather(data: Bytes, starts: Integers, lengths: Integers, rows: Bytes) -> None:
    """Copy byte by byte: for the compiler."""
    width = rows.shape[1]
    for n in range(len(starts)):
        start = starts[n]
        for i in range(min(lengths[n], width)):
            rows[n, i] = data[start + i]


def numpy_gather(data: Bytes, starts: Integers, lengths: Integers, rows: Bytes) -> None:
    width = rows.shape[1]
    if len(starts) and starts[-1] + width > len(data):
        data = np.concatenate([data, np.zeros(width, np.uint8)])
    windows = np.lib.stride_tricks.sliding_window_view(data, width)
    rows[:] = windows[starts]
    short = np.flatnonzero(lengths < width)
    rows[short] *= np.arange(width) < lengths[short, None]


@functools.cache
def _record_type(layout_format: str, fields: tuple[str, ...]) -> np.dtype[Any]:
    parts: list[Any] = []
    digits = ""
    for character in layout_format.lstrip("<"):
        if character.isdigit():
            digits += character
            continue
        name = fields[len(parts)]
        if character == "s":
            parts.append((name, f"S{digits or 1}"))
        elif digits:
            parts.append((name, _NUMPY[character], (int(digits),)))
        else:
            parts.append((name, _NUMPY[character]))
        digits = ""
    return np.dtype(parts)


def record_type(definition: Definition) -> np.dtype[Any]:
    """The packed numpy record of a payload."""
    return _record_type(definition.layout.format, definition.fields)
