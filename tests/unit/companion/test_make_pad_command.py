"""`companion make-pad` as typed."""

from __future__ import annotations

from pathlib import Path

from typer.testing import CliRunner, Result

from companion.cli import app
from companion.config import load

ROOT = Path(__file__).resolve().parents[3]
NESTED = ROOT / "configs" / "pads" / "nested.toml"


def invoked(*arguments: str) -> Result:
    return CliRunner().invoke(app, ["make-pad", *arguments])


def test_a_pad_is_drawn_with_its_layout_file_beside_it(tmp_path: Path) -> None:
    formats = ("--format", "pdf", "--format", "svg", "--format", "png", "--dpi", "20")
    result = invoked("-c", str(NESTED), "--out", str(tmp_path), "--name", "mine", *formats)
    assert result.exit_code == 0, result.output
    assert {path.name for path in tmp_path.iterdir()} == {"mine.toml", "mine.pdf", "mine.svg", "mine.png"}
    assert load([tmp_path / "mine.toml"]).pad == load([NESTED]).pad


def test_a_pad_or_a_format_that_cannot_be_drawn_is_refused(tmp_path: Path) -> None:
    for wrong in (("--format", "gif"), ("--set", "pad.family=DICT_NONE")):
        result = invoked("--out", str(tmp_path), *wrong)
        assert result.exit_code == 2
        assert "companion:" in result.output
