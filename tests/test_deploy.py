"""The files under docs/deploy/ start what exists, with options that exist."""

from __future__ import annotations

import configparser
import json
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest
from typer.testing import CliRunner

from companion.cli import app

DEPLOY = Path(__file__).resolve().parents[1] / "docs" / "deploy"


def unit() -> configparser.SectionProxy:
    parser = configparser.ConfigParser(interpolation=None, strict=False, delimiters=("=",))
    parser.optionxform = str  # type: ignore[assignment, method-assign]
    parser.read(DEPLOY / "companion.service")
    return parser["Service"]


@pytest.mark.parametrize("key", ["ExecStartPre", "ExecStart"])
def test_the_units_commands_are_understood(key: str) -> None:
    program, *arguments = shlex.split(unit()[key])
    assert Path(program).name == "companion"
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 2
    assert "/etc/companion/companion.toml: cannot be read" in result.stderr, "the file is what is missing, no option"


def test_the_watchdog_is_slower_than_the_autopilots_own_failsafe() -> None:
    service = unit()
    assert service["Type"] == "notify"
    assert 1.0 < float(service["WatchdogSec"]) <= 5.0


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd here")
def test_systemd_understands_the_unit() -> None:
    command = ["systemd-analyze", "verify", str(DEPLOY / "companion.service")]
    said = subprocess.run(command, capture_output=True, text=True, timeout=30).stderr.splitlines()
    ours = [line for line in said if "companion.service" in line and "is not executable" not in line]
    assert ours == []


def test_the_container_copies_what_is_there_and_runs_what_is_understood() -> None:
    lines = (DEPLOY / "Containerfile").read_text(encoding="utf-8").splitlines()
    for line in lines:
        if line.startswith("COPY "):
            assert all((DEPLOY.parents[1] / name).exists() for name in line.split()[1:-1])
    arguments = next(line for line in lines if line.startswith("CMD ")).removeprefix("CMD ")
    result = CliRunner().invoke(app, json.loads(arguments))
    assert "/etc/companion/companion.toml: cannot be read" in result.stderr
