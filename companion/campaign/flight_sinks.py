"""Who watches a lockstep flight: the tlog, the message log, the live view, the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from companion.campaign.runner import CLOCK_OFFSET_NS
from companion.config import Config
from companion.io.mcap_log import LogOrigin, McapWriter
from companion.io.run_folder import versions
from companion.io.tlog import TlogWriter
from companion.messages import Image
from companion.onboard import JournalEntry
from companion.telemetry.flight_record import FlightRecord
from companion.telemetry.live_view import LiveView
from sitl_stub.world import Truth

LOCKSTEP_EPOCH_US = 1_767_225_600_000_000
"""2026-01-01 in Unix microseconds: a lockstep flight has no date, and its log must not depend on one."""


class TlogSink:
    """flight.tlog of both directions."""

    def __init__(self, path: Path) -> None:
        self._writer = TlogWriter(path)
        self._first_ns: int | None = None

    def datagram(self, now_ns: int, data: bytes, *, outgoing: bool) -> None:
        if self._first_ns is None:
            self._first_ns = now_ns
        self._writer.write(LOCKSTEP_EPOCH_US + (now_ns - self._first_ns) // 1000, data)

    def journal(self, entries: Sequence[JournalEntry]) -> None:
        pass

    def truth(self, now_ns: int, truth: Truth) -> None:
        pass

    def close(self) -> None:
        self._writer.close()


class McapSink:
    """flight.mcap: the journal, some frames, and the truth of the simulation."""

    def __init__(self, path: Path, config: Config, about: Mapping[str, str]) -> None:
        shift_ns = LOCKSTEP_EPOCH_US * 1000 - CLOCK_OFFSET_NS
        self._writer = McapWriter(path, LogOrigin(config, versions(), shift_ns, about))

    def datagram(self, now_ns: int, data: bytes, *, outgoing: bool) -> None:
        pass

    def journal(self, entries: Sequence[JournalEntry]) -> None:
        for entry in entries:
            self._writer.write(entry)

    def frame(self, camera: str, arrived_ns: int, t_ns: int, content: Image | bytes) -> None:
        self._writer.write_frame(camera, arrived_ns, t_ns, content)

    def truth(self, now_ns: int, truth: Truth) -> None:
        self._writer.write_truth(now_ns, truth.vehicle.position_ned_m, truth.pad_position_ned_m)

    def close(self) -> None:
        self._writer.close()


class ViewSink:
    """Feeds the live view."""

    def __init__(self, view: LiveView) -> None:
        self._view = view

    def datagram(self, now_ns: int, data: bytes, *, outgoing: bool) -> None:
        pass

    def journal(self, entries: Sequence[JournalEntry]) -> None:
        for entry in entries:
            self._view.add(entry.message)

    def truth(self, now_ns: int, truth: Truth) -> None:
        pass

    def close(self) -> None:
        pass


class ReportSink:
    """Gathers what the report draws."""

    def __init__(self) -> None:
        self.record = FlightRecord()

    def datagram(self, now_ns: int, data: bytes, *, outgoing: bool) -> None:
        pass

    def journal(self, entries: Sequence[JournalEntry]) -> None:
        self.record.add_entries(entries)

    def frame(self, camera: str, arrived_ns: int, t_ns: int, content: Image | bytes) -> None:
        self.record.add_frame(t_ns, content)

    def truth(self, now_ns: int, truth: Truth) -> None:
        self.record.add_truth(now_ns, truth.vehicle.position_ned_m, truth.pad_position_ned_m)

    def close(self) -> None:
        pass
