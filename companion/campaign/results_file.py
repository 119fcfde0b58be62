"""samples.jsonl: a header line, then one line per flight in the order in which they ended. The file is the campaign's state.

Append only. After Ctrl-C or a crash the same command goes on with what is missing; a line that a killed process left half
written is cut off. One process at a time may hold it open.
"""

from __future__ import annotations

import fcntl
import json
from pathlib import Path
from typing import Any

Row = dict[str, Any]


class ResultsFile:
    """`rows` by sample number. ValueError where the file belongs to another campaign, or another process writes it."""

    def __init__(self, path: Path, fingerprint: str) -> None:
        self._path = path
        self.rows: dict[int, Row] = {}
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = path.open("a+", encoding="utf-8")
        try:
            self._lock()
            self._read(fingerprint)
        except ValueError:
            self._file.close()
            raise

    def add(self, row: Row) -> None:
        """Written through before it counts."""
        self._write(row)
        self.rows[row["sample"]] = row

    def close(self) -> None:
        self._file.close()

    def _lock(self) -> None:
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise ValueError(f"{self._path}: another campaign process writes it") from error

    def _read(self, fingerprint: str) -> None:
        self._file.seek(0)
        text = self._file.read()
        whole = text[: text.rfind("\n") + 1]
        if whole != text:
            self._file.truncate(len(whole.encode("utf-8")))
        lines = whole.splitlines()
        if not lines:
            self._write({"campaign": fingerprint})
            return
        if len(lines) == 1:
            self._file.truncate(0)  # nothing was flown: the campaign file may change freely
            self._write({"campaign": fingerprint})
            return
        if json.loads(lines[0]).get("campaign") != fingerprint:
            raise ValueError(f"{self._path}: holds results of another campaign file; choose another --out or remove it")
        self.rows = {row["sample"]: row for row in map(json.loads, lines[1:])}

    def _write(self, content: Row) -> None:
        self._file.write(json.dumps(content) + "\n")
        self._file.flush()


def stored_rows(path: Path, fingerprint: str | None = None) -> dict[int, Row]:
    """The rows of a finished or unfinished campaign, only to look at; empty where there is no such file, or where it belongs
    to another `fingerprint` than the one given."""
    if not path.is_file():
        return {}
    whole, _, _ = path.read_text(encoding="utf-8").rpartition("\n")
    header, *lines = whole.splitlines() or ["{}"]
    if fingerprint is not None and json.loads(header).get("campaign") != fingerprint:
        return {}
    return {row["sample"]: row for row in map(json.loads, lines)}
