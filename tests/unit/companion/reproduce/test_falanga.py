"""The moving-platform paper: its frames show the tag, its campaign flies the cells the issue names."""

from __future__ import annotations

from pathlib import Path

import pytest

from companion.campaign.campaign_file import fingerprint, load_campaign, samples
from companion.campaign.results_file import ResultsFile
from companion.messages import CameraImage, PadObservation
from companion.reproduce import falanga
from companion.reproduce.falanga import frames
from companion.reproduce.watched_flight import preset
from companion.vision import DETECTORS
from companion.vision.lens import from_config

ROOT = Path(__file__).parents[4]


def test_every_frame_that_is_timed_shows_the_tag() -> None:
    config = preset("falanga")
    detector = DETECTORS["cross"](config.vision, config.pad, from_config(config.cameras["down"]))
    for image in frames(config, 3):
        assert isinstance(detector.detect(CameraImage(0, "down", image, 0), None), PadObservation)


def test_the_campaign_has_three_paths_at_four_speeds_with_fifty_seeds_each() -> None:
    campaign = load_campaign(ROOT / "configs/campaigns/falanga.toml")
    assert campaign.seeds == 50
    flown = [sample.world["path"] for sample in samples(campaign, 1)]
    assert {(path["kind"], path["speed_m_s"]) for path in flown} == {
        (kind, speed) for kind in ("line", "circle", "figure8") for speed in (1.0, 2.0, 3.0, 4.2)
    }


def test_the_page_takes_up_as_many_flights_of_the_campaign_as_have_been_flown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    campaign = load_campaign(ROOT / "configs/campaigns/falanga.toml")
    monkeypatch.setattr(falanga, "results_folder", lambda campaign: tmp_path)
    assert falanga.rate_rows() == []
    results = ResultsFile(tmp_path / "samples.jsonl", fingerprint(campaign))
    for sample, outcome in zip(samples(campaign, 2), ("landed", "timeout", "landed"), strict=False):
        results.add(
            {
                "sample": sample.index,
                "outcome": outcome,
                "forced_disarm_in_air": False,
                "touchdown_error_m": 0.1,
                "frames_with_pad": 12,
                "time_to_touchdown_s": 12.0 if outcome == "landed" else None,
                "first_sight_to_touchdown_s": 10.5 if outcome == "landed" else None,
            }
        )
    results.close()
    rows = falanga.rate_rows()
    assert [row.name for row in rows] == ["line, 1 m/s", "line, 2 m/s"]
    assert rows[0].table == "Success rates (n = 3 flights, seeds from 1 on)"
    assert (
        rows[0].ours == "1 of 2 landed (9% to 91%), 1 timeout; 0.10 m off, median; found in 2 of 2 after 1.5 s, median"
    )
