"""One sample of a campaign to one row: what a worker process runs. Everything it needs is in the sample."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from companion.campaign.campaign_file import Sample
from companion.campaign.runner import Sink, fly
from companion.campaign.summary import summary
from companion.config import Config, load_with
from sitl_stub.scenario import Scenario, with_overrides
from sitl_stub.scenario import load as load_scenario


def prepared(sample: Sample) -> tuple[Scenario, Config]:
    """Both sides' settings. ScenarioError or ConfigError, both ValueError, where a key or value is wrong."""
    scenario = with_overrides(load_scenario(sample.scenario), sample.world)
    return scenario, load_with([Path(preset) for preset in sample.presets], sample.app)


def fly_sample(sample: Sample, sinks: Sequence[Sink] = ()) -> dict[str, Any]:
    """Fly it; the row as in the results file."""
    import cv2

    cv2.setNumThreads(1)
    scenario, config = prepared(sample)
    started = time.perf_counter()
    result = fly(scenario, config, seed=sample.seed, sinks=sinks)
    figures = summary(result, scenario=sample.scenario, seed=sample.seed, wall_s=time.perf_counter() - started)
    return {"sample": sample.index, "cell": sample.cell, **figures}
