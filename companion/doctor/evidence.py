"""What the checks judge, and what they say. Times in seconds, distances in metres."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from companion.config import Config
from companion.mavlink.parameters import Value
from companion.mavlink.timesync import ClockQuality
from companion.messages import VehicleStatus


class Level(StrEnum):
    """How bad."""

    PASS = "pass"
    WARN = "warn"
    FAIL = "fail"


@dataclass(frozen=True, slots=True)
class Finding:
    """One line. `remedy` says what to do; empty where all is well."""

    check: str
    level: Level
    text: str
    remedy: str = ""


@dataclass(frozen=True, slots=True)
class FrameSample:
    """One frame as it came. `delay_s` is None where the source does not know when it was taken."""

    arrived_ns: int
    delay_s: float | None
    size_px: tuple[int, int]
    mean_level: float


@dataclass(slots=True)
class Evidence:
    """Gathered by collect.py. `message_counts` by name of the message class."""

    config: Config
    pad_speed_m_s: float
    duration_s: float
    link_error: str = ""
    message_counts: dict[str, int] = field(default_factory=dict)
    bytes_skipped: int = 0
    frames_refused: int = 0
    status: VehicleStatus | None = None
    clock: ClockQuality | None = None
    offset_jitter_s: float | None = None
    parameters: Mapping[str, Value] = field(default_factory=dict)
    missing_parameters: frozenset[str] = frozenset()
    camera_error: str = ""
    frames: list[FrameSample] = field(default_factory=list)
    marker_ids_seen: set[int] = field(default_factory=set)
    foreign_ids_seen: set[int] = field(default_factory=set)
    reprojection_errors_px: list[float] = field(default_factory=list)
    detect_s: list[float] = field(default_factory=list)
    tick_late_s: list[float] = field(default_factory=list)
    disk_free_bytes: int | None = None

    @property
    def was_heard(self) -> bool:
        return self.status is not None and self.status.connected

    def rate_hz(self, name: str) -> float:
        """Messages a second of one class."""
        return self.message_counts.get(name, 0) / self.duration_s


def percentile(values: list[float], fraction: float) -> float:
    """Nearest rank; ValueError for nothing."""
    ordered = sorted(values)
    if not ordered:
        raise ValueError("no values")
    return ordered[min(len(ordered) - 1, int(fraction * len(ordered)))]


def judged(check: str, text: str, remedy: str, *, fails: bool, warns: bool) -> Finding:
    """A finding whose level two conditions decide."""
    level = Level.FAIL if fails else Level.WARN if warns else Level.PASS
    return Finding(check, level, text, "" if level is Level.PASS else remedy)
