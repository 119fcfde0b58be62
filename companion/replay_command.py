"""What `companion replay` says and with which status it ends: 0 fine, 1 a difference."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from companion import golden
from companion.replay import ReplayOptions, ReplayResult, replay


@dataclass(frozen=True, slots=True)
class ReplayAnswer:
    """`lines` for people, `content` for --json."""

    status: int
    lines: list[str]
    content: dict[str, Any]


def answer(path: Path, options: ReplayOptions, *, check: Path | None, update: bool) -> ReplayAnswer:
    """Replay, and compare with a golden file or rewrite it. ValueErrors say what is wrong with the request."""
    if update and check is None:
        raise golden.GoldenError("--update needs --check FILE: the file to write")
    before = golden.read(check) if check is not None and (check.is_file() or not update) else None
    result = replay(path, options)
    lines, content = _lines(result), result.as_json()
    status = 1 if result.differing else 0
    if check is None:
        return ReplayAnswer(status, lines, content)
    if update:
        written, changes = golden.updated(before, path.name, result.figures)
        golden.write(check, written)
        lines += [f"{check}: {len(changes)} changed", *(f"  {line}" for line in changes)]
        return ReplayAnswer(0, lines, {**content, "changed": changes})
    assert before is not None
    found = golden.differences(before, result.figures)
    lines += [f"{check}: " + (f"{len(found)} differ" if found else "agrees"), *(f"  {line}" for line in found)]
    return ReplayAnswer(1 if found else 0, lines, {**content, "golden_differences": found})


def _lines(result: ReplayResult) -> list[str]:
    pace = f"{result.log_s:.1f} s of log in {result.wall_s:.2f} s"
    lines = [
        f"{result.mode}: {pace} ({result.log_s / max(result.wall_s, 1e-9):.0f} x real time); damage: {result.damage}"
    ]
    lines += [f"  {t_s:8.2f} s  {phase:10} {reason}" for t_s, phase, reason in result.phases]
    if result.mode == "exact":
        lines.append(_verdict(result))
    else:
        lines += _figures(result)
    return lines


def _verdict(result: ReplayResult) -> str:
    if result.difference is None:
        return f"no difference in {result.compared} outputs"
    return f"{result.differing} of {result.compared} outputs differ; the first at {result.difference}"


def _figures(result: ReplayResult) -> list[str]:
    """Every figure; beside it the recorded one where that is known and another."""
    names = [*result.figures, *(name for name in result.recorded if name not in result.figures)]
    width = max(map(len, names), default=0)
    lines = []
    for name in names:
        now, then = result.figures.get(name), result.recorded.get(name)
        shown = "-" if now is None else f"{now:g}"
        differs = bool(result.recorded) and name in result.recorded and now != then
        lines.append(
            f"  {name:{width}} {shown:>12}" + (f"   recorded {then:g}" if differs and then is not None else "")
        )
    return lines
