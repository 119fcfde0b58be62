"""Configuration errors name file, key, value and what is allowed."""

from __future__ import annotations

from pathlib import Path

import pytest

from companion.config import Config, ConfigError, load


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "my.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_without_files_the_defaults_hold() -> None:
    assert load() == Config()


def test_a_file_changes_only_what_it_names(tmp_path: Path) -> None:
    config = load([written(tmp_path, "[control]\nposition_gain_hz = 0.7\n")])
    assert config.control.position_gain_hz == 0.7
    assert config.planning == Config().planning


def test_later_files_and_overrides_win(tmp_path: Path) -> None:
    path = written(tmp_path, "[link]\nurl = 'tcp://10.0.0.2:5760'\n[vision]\ntrack = false\n")
    config = load([path], {"link.url": "udpin://0.0.0.0:14540", "control.lead_s": "0.1"})
    assert (config.link.url, config.vision.track, config.control.lead_s) == ("udpin://0.0.0.0:14540", False, 0.1)


def test_a_second_camera_may_be_added(tmp_path: Path) -> None:
    config = load([written(tmp_path, "[cameras.front]\nfx_px = 500\nmount_deg = [0, 90, 0]\n")])
    assert config.cameras["front"].mount_deg == (0.0, 90.0, 0.0)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[vision]\ndetectr = 'aruco'\n", ["my.toml", "[vision]", "detectr", "did you mean 'detector'", "allowed:"]),
        ("[contrl]\nrate_hz = 50\n", ["my.toml", "[contrl]", "did you mean 'control'"]),
        ("[control]\nrate_hz = -5\n", ["my.toml", "[control] rate_hz", "-5", "> 0.0"]),
        ("[control]\nrate_hz = 'fast'\n", ["[control] rate_hz", "'fast'", "float"]),
        ("[cameras.down]\nfx = 1.0\n", ["[cameras.down] fx", "fx_px"]),
        ("[[pad.markers]]\nid = -1\nsize_m = 0.4\n", ["markers[0].id", "-1", ">= 0"]),
        ("[mission]\ndisarm = 'maybe'\n", ["[mission] disarm", "maybe"]),
        ("[control\n", ["my.toml", "not valid TOML"]),
    ],
)
def test_a_mistake_is_named_with_file_key_value_and_what_is_allowed(
    tmp_path: Path, text: str, words: list[str]
) -> None:
    with pytest.raises(ConfigError) as error:
        load([written(tmp_path, text)])
    assert not [word for word in words if word not in str(error.value)], str(error.value)


def test_mistakes_in_several_sections_show_at_once(tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as error:
        load([written(tmp_path, "[vision]\nx = 1\n[control]\nrate_hz = 0\n")])
    assert "[vision] x" in str(error.value)
    assert "[control] rate_hz" in str(error.value)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"nothing\.toml: cannot be read"):
        load([tmp_path / "nothing.toml"])


def test_a_file_that_is_not_text_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "image.toml"
    path.write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(ConfigError, match="not UTF-8"):
        load([path])
