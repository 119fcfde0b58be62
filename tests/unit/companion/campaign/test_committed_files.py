"""Every campaign and every preset that is committed can be loaded, and what it sets exists."""

from __future__ import annotations

from pathlib import Path

import pytest

from companion.campaign.campaign_file import load_campaign, samples
from companion.config import load, load_with
from companion.control import CONTROLLERS, YAW_LAWS
from companion.estimation import ESTIMATORS
from companion.planning import PLANNERS
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
