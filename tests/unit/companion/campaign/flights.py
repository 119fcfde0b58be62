"""Stand-ins for a flight, importable by worker processes. What they do stands in the sample's scenario name."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from typing import Any

from companion.campaign.campaign_file import Sample


def sample(index: int, scenario: str = "fine", folder: Path | None = None) -> Sample:
    return Sample(index, scenario, index, scenario, (), {"folder": str(folder)}, {})


def flight(sample: Sample) -> dict[str, Any]:
    """fine: lands. dies: kills its process. dies_once: only the first time. raises, wrong_file: by name. waits: for ever."""
    if sample.scenario == "dies" or (sample.scenario == "dies_once" and _is_first_time(sample)):
        os.kill(os.getpid(), signal.SIGKILL)
    if sample.scenario == "raises":
        raise RuntimeError("a lens fell out")
    if sample.scenario == "wrong_file":
        raise ValueError("no such scenario")
    if sample.scenario == "waits":
        Path(sample.app["folder"], str(os.getpid())).touch()
        time.sleep(60.0)
    return {"sample": sample.index, "cell": sample.cell, "outcome": "landed", "seed": sample.seed}


def _is_first_time(sample: Sample) -> bool:
    mark = Path(sample.app["folder"]) / f"been-{sample.index}"
    been = mark.exists()
    mark.touch()
    return not been
