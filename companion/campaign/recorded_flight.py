"""The whole run folder of one lockstep flight: what `companion demo` and `companion campaign rerun` keep, the same for both."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from companion.campaign.flight_sinks import McapSink, ReportSink, TlogSink
from companion.campaign.runner import Sink
from companion.campaign.summary import summary_line
from companion.config import Config
from companion.io.run_folder import RunFolder, versions
from companion.telemetry.report import picture, report_html


class RecordedFlight:
    """Give `sinks` to the flight, then call `finish` with its figures."""

    def __init__(self, runs: Path, name: str, config: Config, about: Mapping[str, str]) -> None:
        self._folder = RunFolder(runs, name)
        self._folder.write_config(config)
        self._report = ReportSink()
        mcap = McapSink(self._folder.mcap, config, {**about, "simulated": "true"})
        self.sinks: tuple[Sink, ...] = (self._report, TlogSink(self._folder.tlog), mcap)

    def finish(self, figures: Mapping[str, Any], *, title: str) -> dict[str, Any]:
        """run.json and the pages; the figures with the folder's name in `run`."""
        kept = {**figures, "run": str(self._folder.path)}
        self._folder.write_run(kept)
        page = report_html(self._report.record, {**kept, **versions()}, title=title, line=summary_line(kept))
        self._folder.write_pages(page, picture(self._report.record))
        return kept
