"""Golden files: the figures of a replay with stated tolerances, for CI.

    {"log": "line.mcap", "figures": {"setpoints": {"value": 931, "tolerance": 5}, ...}}

A person may edit any tolerance; `--update` keeps it and replaces the values, and says what changed.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import msgspec

RELATIVE_TOLERANCE = 0.01
UNIT_TOLERANCES = {"_m": 0.01, "_m_s": 0.01, "_s": 0.05, "_nis_mean": 0.05}
"""Absolute, by how a figure's name ends; counts may be off by one in a hundred."""


class GoldenError(ValueError):
    """The golden file cannot be read."""


class GoldenFigure(msgspec.Struct, frozen=True):
    value: float
    tolerance: float


class Golden(msgspec.Struct, frozen=True):
    """What a replay of `log` is expected to give."""

    log: str
    figures: dict[str, GoldenFigure]


def read(path: Path) -> Golden:
    try:
        return msgspec.json.decode(path.read_bytes(), type=Golden)
    except OSError as error:
        raise GoldenError(f"{path}: cannot be read: {error.strerror}; --update writes it") from error
    except msgspec.DecodeError as error:
        raise GoldenError(f"{path}: is not a golden file: {error}") from error


def default_tolerance(name: str, value: float) -> float:
    for ending in sorted(UNIT_TOLERANCES, key=len, reverse=True):
        if name.endswith(ending):
            return UNIT_TOLERANCES[ending]
    return float(round(RELATIVE_TOLERANCE * abs(value)))


def differences(golden: Golden, figures: Mapping[str, float]) -> list[str]:
    """One line for each figure outside its tolerance, missing, or new."""
    lines = []
    for name, expected in golden.figures.items():
        if name not in figures:
            lines.append(f"{name}: expected {expected.value:g}, is missing")
        elif not abs(figures[name] - expected.value) <= expected.tolerance:
            lines.append(f"{name}: expected {expected.value:g} +- {expected.tolerance:g}, got {figures[name]:g}")
    lines += [f"{name}: {figures[name]:g} is not in the golden file" for name in figures if name not in golden.figures]
    return lines


def updated(before: Golden | None, log: str, figures: Mapping[str, float]) -> tuple[Golden, list[str]]:
    """The golden file for these figures, and one line for each change against the file before."""
    known = {} if before is None else before.figures
    made = {
        name: GoldenFigure(value, known[name].tolerance if name in known else default_tolerance(name, value))
        for name, value in figures.items()
    }
    lines = [
        f"{name}: {known[name].value:g} -> {value:g}"
        for name, value in figures.items()
        if name in known and known[name].value != value
    ]
    lines += [f"{name}: new, {figures[name]:g}" for name in figures if name not in known]
    lines += [f"{name}: gone (was {figure.value:g})" for name, figure in known.items() if name not in figures]
    return Golden(log, made), lines


def write(path: Path, golden: Golden) -> None:
    path.write_bytes(msgspec.json.format(msgspec.json.encode(golden), indent=1) + b"\n")
