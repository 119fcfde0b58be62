"""runs/<name>/: everything that is kept of one flight. Written while it happens, so that a killed process leaves it readable.

flight.tlog   every datagram both ways, as ground stations and pymavlink read it
flight.mcap   every message with its schema, some camera frames, the configuration: what `companion replay` reads
run.json      what was flown, with what, and how it ended
config.json   the whole configuration
report.html   one self-contained page
landing.svg   its views from above and from the side
"""

from __future__ import annotations

import json
import platform
from pathlib import Path
from typing import Any

import msgspec

from companion import __version__
from companion.config import Config


class RunFolder:
    """A new folder; never overwrites an older run."""

    def __init__(self, root: Path, name: str) -> None:
        self.path = _fresh(root, name)
        self.path.mkdir(parents=True)

    @property
    def tlog(self) -> Path:
        return self.path / "flight.tlog"

    @property
    def mcap(self) -> Path:
        return self.path / "flight.mcap"

    @property
    def report(self) -> Path:
        return self.path / "report.html"

    def write_pages(self, report: str, picture: str) -> None:
        self.report.write_text(report, encoding="utf-8")
        (self.path / "landing.svg").write_text(picture, encoding="utf-8")

    def write_config(self, config: Config) -> None:
        text = msgspec.json.format(msgspec.json.encode(config), indent=2)
        (self.path / "config.json").write_bytes(text + b"\n")

    def write_run(self, figures: dict[str, Any]) -> None:
        content = {**figures, "versions": versions()}
        (self.path / "run.json").write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")


def versions() -> dict[str, str]:
    """What made this run: a log is only comparable with one from the same versions."""
    import cv2
    import numpy as np
    import pymavlink

    return {
        "companion": __version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "opencv": cv2.__version__,
        "pymavlink": pymavlink.__version__,
        "machine": platform.machine(),
    }


def _fresh(root: Path, name: str) -> Path:
    if not (root / name).exists():
        return root / name
    number = 2
    while (root / f"{name}-{number}").exists():
        number += 1
    return root / f"{name}-{number}"
