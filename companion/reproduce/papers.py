"""The papers by key: how to reproduce one, and the two files that make its preset. Modules are imported when asked for.

A preset is a configuration of the app (`configs/papers/<key>.toml`) and the scenario that the paper flew
(`configs/scenarios/papers/<key>.toml`); `companion demo --preset <key>` flies the one in the other.
"""

from __future__ import annotations

import importlib
from pathlib import Path

from companion.reproduce.row import Reproduce, Reproduction
from sitl_stub.scenario import find, names


class NotReproduced(ValueError):
    """There is no reproduction of that name. The text says which there are."""


def reproducer(key: str) -> Reproduce:
    """What reproduces that paper; its module is looked for at the call, and NotReproduced where there is none."""

    def reproduce(quick: bool) -> Reproduction:
        name = f"{__package__}.{key}"
        try:
            module = importlib.import_module(name)
        except ModuleNotFoundError as error:
            if error.name != name:
                raise
            raise NotReproduced(f"{key!r} is not reproduced: there is no module {name}") from error
        made: Reproduction = module.reproduce(quick)
        return made

    return reproduce


PAPERS: dict[str, Reproduce] = {key: reproducer(key) for key in ("shivam", "falanga", "guo", "kim", "dalang")}
"""In the order in which they appeared here. Each module has `reproduce(quick: bool) -> Reproduction`."""


def chosen(key: str | None) -> dict[str, Reproduce]:
    """One paper, or all; NotReproduced names those that exist."""
    if key is None:
        return dict(PAPERS)
    if key not in PAPERS:
        raise NotReproduced(f"{key!r} is not one of the papers; allowed: {', '.join(PAPERS)}")
    return {key: PAPERS[key]}


def with_preset() -> list[str]:
    """Keys of the papers that have a preset, in the papers' order."""
    return [key for key in PAPERS if key in names("papers")]


def preset_file(key: str) -> Path:
    """The app's configuration for a paper; ScenarioError where there is none, with those there are."""
    return find("papers", key)


def preset_scenario(key: str) -> Path:
    """The scenario that a paper's preset is flown in."""
    return find("scenarios/papers", key)
