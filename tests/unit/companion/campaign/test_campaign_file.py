"""A campaign file decides what sample N is, for ever."""

from __future__ import annotations

from pathlib import Path

import pytest
from rich.console import Console

from companion.campaign.campaign_file import fingerprint, load_campaign, samples
from companion.campaign.command import run_campaign
from companion.config import ConfigError

TEXT = """
name = "speeds"
scenarios = ["line", "circle"]
seeds = 3
first_seed = 10
[set]
"control.lead_s" = 0.2
[axes]
"path.speed_m_s" = [1.0, 2.0]
"app:control.position_gain_hz" = [0.8]
"""


def written(tmp_path: Path, text: str = TEXT) -> Path:
    path = tmp_path / "campaign.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_every_combination_is_flown_with_every_seed(tmp_path: Path) -> None:
    flown = list(samples(load_campaign(written(tmp_path))))
    assert [sample.index for sample in flown] == list(range(2 * 2 * 3))
    assert flown[4].seed == 11
    assert flown[4].world == {"path.speed_m_s": 2.0}
    assert flown[4].app == {"control.lead_s": 0.2, "control.position_gain_hz": 0.8}
    assert flown[4].cell == "line path.speed_m_s=2.0 app:control.position_gain_hz=0.8"


def test_fingerprint_follows_the_content(tmp_path: Path) -> None:
    first = fingerprint(load_campaign(written(tmp_path)))
    assert first == fingerprint(load_campaign(written(tmp_path)))
    assert first != fingerprint(load_campaign(written(tmp_path, TEXT.replace("0.2", "0.3"))))


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("name = 'x'\nscenarios = []\n", "at least one"),
        ("name = 'x'\n", "scenarios"),
        ("sedes = 1\n" + TEXT, "sedes"),
        (TEXT.replace('"speeds"', '"../speeds"'), "name"),
        (TEXT.replace("[1.0, 2.0]", "[]"), "path.speed_m_s = .*at least one"),
        (TEXT.replace("[1.0, 2.0]", "[1.0, 1.0]"), "path.speed_m_s: 1.0 stands there twice"),
        (TEXT.replace('"circle"', '"line"'), "scenarios: line stands there twice"),
        (TEXT + "variant = ['a']\n", "named ones stand in"),
        (TEXT.replace("seeds = 3", "seeds = 0"), "seeds"),
    ],
)
def test_a_wrong_file_is_refused_with_what_is_wrong(tmp_path: Path, text: str, word: str) -> None:
    with pytest.raises(ConfigError, match=word):
        load_campaign(written(tmp_path, text))


@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ("path.speed_m_s", "path.sped_m_s", "line path.sped_m_s=1.0.*sped_m_s"),
        ("app:control.position_gain_hz", "app:control.gain", "control.gain"),
        ("[1.0, 2.0]", "['fast']", "path.speed_m_s=fast"),
        ('"circle"', '"cirle"', "cirle"),
        ('"control.lead_s" = 0.2', '"control.lead_s" = -1.0', "lead_s"),
        ('"path.speed_m_s"', '"name.speed"', "name.speed"),
        ('"path.speed_m_s"', '"faults.speed"', "faults.speed"),
    ],
)
def test_a_combination_that_cannot_be_flown_is_refused_before_anything_is_written(
    tmp_path: Path, old: str, new: str, word: str
) -> None:
    path = written(tmp_path, TEXT.replace(old, new))
    with pytest.raises(ConfigError, match=word):
        run_campaign(path, out=tmp_path / "out", workers=1, scheduler=None, console=Console(quiet=True))
    assert not (tmp_path / "out").exists()


def test_fewer_seeds_keep_the_numbers_of_their_samples(tmp_path: Path) -> None:
    campaign = load_campaign(written(tmp_path))
    quick = list(samples(campaign, seeds=1))
    assert [sample.index for sample in quick] == [0, 3, 6, 9]
    everything = {sample.index: sample for sample in samples(campaign)}
    assert all(everything[sample.index] == sample for sample in quick)


def test_variants_fly_in_the_same_worlds(tmp_path: Path) -> None:
    (tmp_path / "slow.toml").write_text("[control]\nmax_speed_m_s = 2.0\n", encoding="utf-8")
    text = TEXT + "[variants]\nours = []\nslow = ['slow.toml']\n"
    flown = list(samples(load_campaign(written(tmp_path, text))))
    ours, slow = flown[0], flown[3]
    assert (ours.seed, ours.world, ours.presets) == (slow.seed, slow.world, ())
    assert slow.presets == (str(tmp_path / "slow.toml"),)
    assert slow.cell.endswith("variant=slow")


def test_named_worlds_add_their_keys_to_the_scenario_and_their_names_to_the_cells(tmp_path: Path) -> None:
    text = TEXT + "[worlds]\ncalm = {}\nradio = {faults = [{kind = 'datagram_loss', fraction = 0.3}]}\n"
    flown = list(samples(load_campaign(written(tmp_path, text))))
    calm, radio = flown[0], flown[3]
    assert "faults" not in calm.world
    assert radio.world == {**calm.world, "faults": [{"kind": "datagram_loss", "fraction": 0.3}]}
    assert radio.cell.endswith("world=radio")


def test_a_preset_with_other_content_is_another_campaign(tmp_path: Path) -> None:
    preset = tmp_path / "slow.toml"
    preset.write_text("[control]\nmax_speed_m_s = 2.0\n", encoding="utf-8")
    path = written(tmp_path, "presets = ['slow.toml']\n" + TEXT)
    before = fingerprint(load_campaign(path))
    preset.write_text("[control]\nmax_speed_m_s = 3.0\n", encoding="utf-8")
    assert fingerprint(load_campaign(path)) != before
