"""`companion doctor`: collect, diagnose, print line by line; the exit status says whether to fly."""

from __future__ import annotations

import asyncio
import json
from dataclasses import asdict
from pathlib import Path

from rich.console import Console
from rich.text import Text

from companion.config import Config
from companion.doctor import Finding, Level, diagnose
from companion.doctor.collect import collect

STYLES = {Level.PASS: "green", Level.WARN: "yellow", Level.FAIL: "bold red"}


def run_doctor(config: Config, *, pad_speed_m_s: float, duration_s: float, runs: Path) -> list[Finding]:
    """All findings, in the order of the checks."""
    evidence = asyncio.run(collect(config, pad_speed_m_s=pad_speed_m_s, duration_s=duration_s, runs=runs))
    return diagnose(evidence)


def exit_status(findings: list[Finding]) -> int:
    """1 where something fails; warnings do not keep from flying."""
    return int(any(finding.level is Level.FAIL for finding in findings))


def print_findings(findings: list[Finding], console: Console) -> None:
    for finding in findings:
        line = Text.assemble(
            (f"{finding.level:4} ", STYLES[finding.level]), (f"{finding.check:11}", "dim"), finding.text
        )
        console.print(line, soft_wrap=True)
        if finding.remedy:
            console.print(Text(f"                -> {finding.remedy}"), soft_wrap=True)
    count = {level: sum(finding.level is level for finding in findings) for level in Level}
    console.print(", ".join(f"{number} {level}" for level, number in count.items()))


def as_json(findings: list[Finding]) -> str:
    """One line."""
    return json.dumps({"status": exit_status(findings), "findings": [asdict(finding) for finding in findings]})
