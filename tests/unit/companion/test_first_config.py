"""`companion init`: what it writes is a configuration, and what it is told stands in it."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from companion.cli import app
from companion.config import Marker, load
from companion.first_config import QUESTIONS, AnswerError, answered


def init(*arguments: str) -> Result:
    return CliRunner().invoke(app, ["init", *arguments])


def test_the_defaults_are_accepted_by_check_config(tmp_path: Path) -> None:
    file = tmp_path / "my.toml"
    assert init(str(file), "--defaults").exit_code == 0
    checked = CliRunner().invoke(app, ["check-config", "-c", str(file)])
    assert checked.exit_code == 0
    assert list(tmp_path.iterdir()) == [file]


def test_every_section_and_key_that_is_commented_out_is_one_that_may_be_used(tmp_path: Path) -> None:
    file = tmp_path / "my.toml"
    init(str(file), "--defaults")
    lines = file.read_text().splitlines()
    first = next(i for i, line in enumerate(lines) if line == "[link]")
    used = []
    for line in lines[first:]:
        inner = line.removeprefix("# ")
        is_code = inner.startswith("[") or (" = " in inner and inner.split(" = ")[0].isidentifier())
        used.append(inner if is_code and "calibration_file" not in inner else line)
    (tmp_path / "all.toml").write_text("\n".join(used))
    assert load([tmp_path / "all.toml"]).guidance.form == "px4"


def test_answers_stand_in_the_file(tmp_path: Path) -> None:
    file = tmp_path / "my.toml"
    answers = ["link=serial:///dev/ttyAMA0:921600", "camera=v4l2:///dev/video2?fps=60", "size=640x480"]
    answers += ["field_of_view=90", "markers=3:0.5", "position=0.1,0,0.02", "water=yes", "dashboard=no", "delay=0.03"]
    arguments = [part for answer in answers for part in ("--answer", answer)]
    assert init(str(file), "--defaults", *arguments).exit_code == 0
    config = load([file])
    camera = config.cameras["down"]
    assert config.link.url == "serial:///dev/ttyAMA0:921600"
    assert camera.source == "v4l2:///dev/video2?fps=60"
    assert (camera.width_px, camera.fx_px, camera.cx_px, camera.delay_s) == (640, 320.0, 319.5, 0.03)
    assert camera.position_frd_m == (0.1, 0.0, 0.02)
    assert config.pad.markers == (Marker(id=3, size_m=0.5),)
    assert config.safety.only_the_pad_is_land
    assert not config.dashboard.enabled


@pytest.mark.parametrize(
    "answer",
    [
        "link=usb0",
        "camera=webcam",
        "size=big",
        "field_of_view=400",
        "delay=soon",
        "position=1,2",
        "markers=45",
        "water=?",
    ],
)
def test_an_answer_that_cannot_be_used_is_refused_by_its_name_and_nothing_is_written(
    tmp_path: Path, answer: str
) -> None:
    file = tmp_path / "my.toml"
    result = init(str(file), "--defaults", "--answer", answer)
    assert result.exit_code == 2
    assert answer.partition("=")[0] in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_what_the_configuration_refuses_is_not_written_either(tmp_path: Path) -> None:
    result = init(str(tmp_path / "my.toml"), "--defaults", "--answer", "markers=45:-1")
    assert result.exit_code == 2
    assert "size_m" in result.stderr
    result = init(str(tmp_path / "my.toml"), "--defaults", "--answer", "calibration=nowhere.yaml")
    assert result.exit_code == 2
    assert "nowhere.yaml" in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_file_is_never_replaced_unasked(tmp_path: Path) -> None:
    file = tmp_path / "my.toml"
    file.write_text("mine")
    assert "--force" in init(str(file), "--defaults").stderr
    assert file.read_text() == "mine"
    assert init(str(file), "--defaults", "--force").exit_code == 0


def test_a_question_that_a_calibration_file_answers_is_not_asked() -> None:
    asked = []

    def ask(question: object) -> str:
        name = question.name  # type: ignore[attr-defined]
        asked.append(name)
        return "down.yaml" if name == "calibration" else next(q.default for q in QUESTIONS if q.name == name)

    answered({"link": "udpin://0.0.0.0:14540"}, ask)
    assert "link" not in asked
    assert "size" not in asked
    assert len(asked) == len(QUESTIONS) - 3


def test_an_unknown_question_names_those_there_are(tmp_path: Path) -> None:
    assert "field_of_view" in init(str(tmp_path / "my.toml"), "--defaults", "--answer", "fov=3").stderr
    with pytest.raises(AnswerError, match="link"):
        answered({"link": "x"}, None)
