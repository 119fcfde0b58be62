"""Every campaign and every preset that is committed can be loaded, and what it sets exists."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from companion.campaign.campaign_file import load_campaign, samples
from companion.config import Config, load, load_with
from companion.control import CONTROLLERS, YAW_LAWS
from companion.estimation import ESTIMATORS
from companion.io.camera_info import of, read
from companion.planning import PLANNERS
from companion.vision.lens import from_config
from sitl_stub.scenario import load as load_scenario
from sitl_stub.scenario import load_pad, with_overrides

CONFIGS = Path(__file__).parents[4] / "configs"


@pytest.mark.parametrize("path", sorted((CONFIGS / "campaigns").glob("*.toml")), ids=lambda path: path.stem)
def test_a_campaign_names_only_what_exists(path: Path) -> None:
    campaign = load_campaign(path)
    assert campaign.name == path.stem
    for sample in samples(campaign, seeds=1):
        scenario = with_overrides(load_scenario(sample.scenario), sample.world)
        config = load_with([Path(preset) for preset in sample.presets], sample.app)
        pad = load_pad(scenario)
        assert {(marker.id, marker.size_m) for marker in config.pad.markers} == {
            (marker.id, marker.size_m) for marker in pad.markers
        }


@pytest.mark.parametrize("path", sorted((CONFIGS / "peers").glob("*.toml")), ids=lambda path: path.stem)
def test_a_peer_names_only_what_exists(path: Path) -> None:
    config = load([path])
    assert config.control.controller in CONTROLLERS
    assert config.control.yaw in YAW_LAWS
    assert config.planning.planner in PLANNERS
    assert config.estimation.estimator in ESTIMATORS


@pytest.mark.parametrize("path", sorted((CONFIGS / "cameras").glob("*.toml")), ids=lambda path: path.stem)
def test_a_camera_file_gives_the_chosen_camera_the_lens_beside_it(path: Path) -> None:
    config = load([path])
    camera, lens = config.cameras[config.vision.camera], read(path.with_suffix(".yaml"))
    assert of(lens.name, camera) == lens
    middle = np.array([[camera.cx_px, camera.cy_px]])
    np.testing.assert_allclose(from_config(camera).ray(middle), [[0.0, 0.0, 1.0]], atol=1e-12)


def test_the_default_camera_and_that_of_the_boat_paper_are_those_of_their_files() -> None:
    default, written = of("down", Config().cameras["down"]), read(CONFIGS / "cameras" / "down.yaml")
    assert not any(written.distortion)  # the file spells out five zeros
    assert default == replace(written, distortion=())
    paper = load([CONFIGS / "papers" / "guo.toml"]).cameras["front"]
    left = msgspec.structs.replace(paper, width_px=paper.width_px // 2)  # both pictures are in one frame
    assert of("front", left) == read(CONFIGS / "cameras" / "front.yaml")
