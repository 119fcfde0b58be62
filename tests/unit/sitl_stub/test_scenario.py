"""Scenario files: what is refused, what is found, and that the ones that come with the project fly."""

from __future__ import annotations

import msgspec
import pytest

from sitl_stub import scenario
from sitl_stub.carriers import CARRIERS
from sitl_stub.faults import FAULTS
from sitl_stub.paths import PATHS
from sitl_stub.randomness import generator
from sitl_stub.scenario import ScenarioError
from sitl_stub.start import draw_start
from sitl_stub.world import World


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[wind]\nmean = 3", ["[wind] mean = 3", "did you mean 'mean_m_s'", "gust_sigma_m_s"]),
        ("wnd = 3", ["wnd = 3", "did you mean 'wind'"]),
        ('[path]\nkind = "circl"', ["kind = 'circl'", "figure8"]),
        ("[path]\nspeed_m_s = 1.0", ["[path] needs kind", "line"]),
        ('[path]\nkind = "circle"\nspeed_m_s = -1.0\nradius_m = 3', ["speed_m_s = -1.0", ">= 0"]),
        ("[cameras.down]\nwidth = 3", ["[cameras.down] width = 3", "width_px"]),
        ('[[faults]]\nkind = "gps_loss"\nx = 3', ["faults[0]", "x = 3", "duration_s"]),
        ('[vehicle]\nstart = "sea"', ["start = 'sea'"]),
        ("name = ", ["not valid TOML"]),
    ],
)
def test_a_mistake_is_refused_with_file_key_value_and_what_is_allowed(text: str, says: list[str]) -> None:
    with pytest.raises(ScenarioError) as refused:
        scenario.from_toml(text, "my.toml")
    message = str(refused.value)
    assert "my.toml" in message
    for part in says:
        assert part in message


def test_every_mistake_is_named_not_only_the_first() -> None:
    with pytest.raises(ScenarioError) as refused:
        scenario.from_toml("[wind]\nmean = 3\n[beacon]\nrate = 1", "my.toml")
    assert "mean = 3" in str(refused.value)
    assert "rate = 1" in str(refused.value)


def test_an_unknown_name_is_refused_with_the_names_there_are() -> None:
    with pytest.raises(ScenarioError, match="did you mean 'circle'"):
        scenario.load("circel")


def test_a_missing_file_is_refused_with_its_name() -> None:
    with pytest.raises(ScenarioError, match=r"nowhere\.toml: cannot be read"):
        scenario.load("nowhere.toml")


@pytest.mark.parametrize("name", scenario.names())
def test_every_scenario_that_comes_along_says_what_it_is_and_runs(name: str) -> None:
    loaded = scenario.load(name)
    assert loaded.name == name
    assert loaded.description
    world = World(msgspec.structs.replace(loaded, cameras={}), 3)
    world.step(0.4)
    assert world.verdict().ending == "flying"


def test_overrides_reach_into_tables_and_are_checked() -> None:
    loaded = scenario.with_overrides(scenario.load("line"), {"path.speed_m_s": 3.0, "wind.mean_m_s": 8})
    assert loaded.path.speed_m_s == 3.0
    assert loaded.wind.mean_m_s == 8
    with pytest.raises(ScenarioError, match="speed = 3"):
        scenario.with_overrides(loaded, {"path.speed": 3})


def test_a_frame_of_two_pictures_has_an_even_width() -> None:
    with pytest.raises(ScenarioError, match=r"width_px = 851: an even number of pixels"):
        scenario.from_table({"cameras": {"front": {"width_px": 851, "stereo_baseline_m": 0.1}}})


def test_a_parameter_that_px4_does_not_have_is_refused() -> None:
    loaded = scenario.with_overrides(scenario.load("line"), {"vehicle.parameters.MPC_XY_VEL_MAXX": 3.0, "cameras": {}})
    with pytest.raises(ScenarioError, match="MPC_XY_VEL_MAXX"):
        World(loaded, 1)


def test_a_seed_is_another_flight_and_a_given_value_leaves_the_others_as_they_were() -> None:
    line = scenario.load("line")
    given = scenario.with_overrides(line, {"place.pad_bearing_deg": 90.0})
    first, second = (draw_start(line, generator(seed, "start")) for seed in (1, 2))
    fixed = draw_start(given, generator(1, "start"))
    assert first != second
    assert fixed.pad_east_m == pytest.approx(30.0)
    assert fixed.path_heading_rad == first.path_heading_rad
    assert fixed.wind_from_rad == first.wind_from_rad


@pytest.mark.parametrize("registry", [PATHS, CARRIERS, FAULTS], ids=["paths", "carriers", "faults"])
def test_the_name_in_a_registry_is_the_kind_that_its_struct_answers_to(registry: dict[str, type]) -> None:
    for name, struct in registry.items():
        assert struct.__struct_config__.tag == name
        assert struct.__doc__
