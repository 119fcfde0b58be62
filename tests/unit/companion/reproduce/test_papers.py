"""The registry, the presets' files, and the scenes in which presets and default meet."""

from __future__ import annotations

import pytest

from companion.config import load, load_with
from companion.reproduce.papers import PAPERS, NotReproduced, chosen, preset_file, preset_scenario, with_preset
from companion.reproduce.scenes import SCENES
from companion.reproduce.versus import balance, judged, scene_rows
from sitl_stub.scenario import ScenarioError, find, with_overrides
from sitl_stub.scenario import load as load_scenario

PRESETS = with_preset()


def test_the_five_papers_are_known_and_no_other() -> None:
    assert list(PAPERS) == ["shivam", "falanga", "guo", "kim", "dalang"]
    assert list(chosen(None)) == list(PAPERS)
    with pytest.raises(NotReproduced, match="allowed: shivam, falanga, guo, kim, dalang"):
        chosen("newton")


def test_a_preset_that_is_not_there_is_refused_with_those_that_are() -> None:
    with pytest.raises(ScenarioError, match="shivam"):
        preset_file("newton")


@pytest.mark.parametrize("key", PRESETS)
def test_a_preset_is_a_configuration_and_a_scenario_that_load(key: str) -> None:
    assert load([preset_file(key)]) != load()
    assert load_scenario(preset_scenario(key)).description


@pytest.mark.parametrize(
    ("key", "name"), [(key, scene.name) for key in PRESETS for scene in SCENES[key]], ids=lambda value: str(value)
)
def test_a_scene_loads_for_both_sides(key: str, name: str) -> None:
    scene = next(scene for scene in SCENES[key] if scene.name == name)
    flown = load_scenario(find("scenarios/papers", scene.scenario))
    assert load_with([preset_file(key)], scene.preset_app) != load()
    default = load([find(*file.split("/")) for file in scene.default_files])
    world = with_overrides(flown, {**scene.world, **scene.default_world})
    assert with_overrides(flown, scene.world).pad.file == flown.pad.file
    assert default.vision.camera in world.cameras


@pytest.mark.parametrize(
    ("preset", "default", "verdict"),
    [
        (0.10, 0.05, "better"),
        (0.10, 0.11, "same"),
        (0.10, 0.20, "differs"),
        (None, 0.30, "better"),
        (0.30, None, "differs"),
        (None, None, "same"),
    ],
)
def test_the_default_wins_ties_or_loses(preset: float | None, default: float | None, verdict: str) -> None:
    assert judged(-1, 0.02, preset, default) == verdict


def test_failures_count_for_success_and_not_for_the_medians() -> None:
    figures = {"time_to_touchdown_s": 10.0, "jerk_rms_m_s3": 1.0, "energy_j": 100.0}
    landed = {"outcome": "landed", "touchdown_error_m": 0.1, **figures}
    missed = {"outcome": "off_pad", "touchdown_error_m": 5.0, **figures}
    rows = {row.name: row for row in scene_rows("t", [landed, missed], [landed, landed])}
    assert (rows["landed"].printed, rows["landed"].ours, rows["landed"].verdict) == ("1 of 2", "2 of 2", "better")
    assert rows["touchdown error, median"].printed == 0.1
    assert balance(list(rows.values())) == "In 5 rows the default wins 1, ties 4 and loses 0."
    nobody = {row.name: row for row in scene_rows("t", [missed], [landed])}
    assert nobody["energy, median"].printed == "no landing"
    assert nobody["energy, median"].verdict == "better"
