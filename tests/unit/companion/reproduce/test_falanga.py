"""The moving-platform paper: its frames show the tag, its campaign flies the cells the issue names."""

from __future__ import annotations

from pathlib import Path

from companion.campaign.campaign_file import load_campaign, samples
from companion.messages import CameraImage, PadObservation
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
