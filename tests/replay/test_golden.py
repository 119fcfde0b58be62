"""Golden replays: recorded inputs through today's pipeline, figures within stated tolerances.

Where a difference is wanted: `companion replay tests/replay/line.mcap --check tests/replay/line.json --update` (docs/replay.md).
"""

from __future__ import annotations

from pathlib import Path

import pytest

from companion import golden
from companion.replay import ReplayOptions, replay

HERE = Path(__file__).parent
PX4 = HERE.parent / "data" / "px4"

GOLDEN = {
    "line": (HERE / "line.mcap", ReplayOptions()),
    "takeoff_land": (PX4 / "takeoff_land.tlog", ReplayOptions(pad_ned_m=(10.0, 5.0, 0.0))),
}


@pytest.mark.parametrize("name", GOLDEN)
def test_the_figures_are_those_of_the_golden_file(name: str) -> None:
    path, options = GOLDEN[name]
    expected = golden.read(HERE / f"{name}.json")
    assert expected.log == path.name
    assert len(expected.figures) >= 10
    differences = golden.differences(expected, replay(path, options).figures)
    assert not differences, "\n".join(differences)


def test_a_changed_gain_does_not_pass_for_the_golden_flight() -> None:
    """The tolerances are tight enough to notice a tracker that trusts its beacon less."""
    changed = replay(GOLDEN["line"][0], ReplayOptions(settings={"estimation.beacon_noise_sigma_m": 1.0}))
    differences = golden.differences(golden.read(HERE / "line.json"), changed.figures)
    assert any(line.startswith("beacon_nis_mean") for line in differences)


def test_the_logs_kept_here_stay_small() -> None:
    assert sum(file.stat().st_size for file in HERE.iterdir() if file.is_file()) < 600_000
