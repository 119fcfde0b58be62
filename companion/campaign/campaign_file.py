"""A campaign file: scenarios x parameters x seeds, as TOML. Order and numbering of the samples are fixed by the file alone.

name = "first-landing"
scenarios = ["line", "circle"]
seeds = 100                      # seeds 1..100 of each combination
first_seed = 1
presets = []                     # configuration files of the app, relative to the campaign file

[set]                            # keys of the app's configuration for all samples
"control.lead_s" = 0.3
[world]                          # keys of the scenario for all samples
"wind.mean_m_s" = 5.0
[axes]                           # every combination is flown; keys of the scenario, or of the app with "app:" in front
"path.speed_m_s" = [1.0, 2.0, 4.2]
[worlds]                         # each is flown: a name for keys of the scenario that belong together
calm = {}
radio = {faults = [{kind = "datagram_loss", fraction = 0.3}]}
[variants]                       # each is flown in the same worlds: further configuration files of the app
ours = []
naive = ["../peers/p_follow.toml"]
"""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

import msgspec
from msgspec import Meta

from companion.config import ConfigError, read_toml
from sitl_stub.scenario import find as find_scenario
from sitl_stub.scenario import read as read_scenario

APP_PREFIX = "app:"
VARIANT = "variant"
WORLD = "world"
NAME = "^[A-Za-z0-9][A-Za-z0-9._-]*$"
"""It names a folder."""


class Campaign(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What is flown. `axes` values may be anything that the key takes."""

    name: Annotated[str, Meta(pattern=NAME)]
    scenarios: tuple[str, ...]
    seeds: Annotated[int, Meta(ge=1, le=1_000_000)] = 100
    first_seed: Annotated[int, Meta(ge=0)] = 1
    presets: tuple[str, ...] = ()
    set: dict[str, Any] = {}
    world: dict[str, Any] = {}
    axes: dict[str, tuple[Any, ...]] = {}
    worlds: dict[str, dict[str, Any]] = {}
    variants: dict[str, tuple[str, ...]] = {}

    @property
    def all_axes(self) -> dict[str, tuple[Any, ...]]:
        """The axes in the order in which they are flown; then the named worlds, the variants as the last."""
        named = {WORLD: tuple(self.worlds), VARIANT: tuple(self.variants)}
        return {**self.axes, **{axis: names for axis, names in named.items() if names}}


class Sample(msgspec.Struct, frozen=True):
    """One flight of a campaign. `cell` names the combination that statistics are made over."""

    index: int
    scenario: str
    seed: int
    cell: str
    presets: tuple[str, ...]
    app: dict[str, Any]
    world: dict[str, Any]


def load_campaign(path: Path) -> Campaign:
    """ConfigError names file, key and what is allowed."""
    data = read_toml(path)
    try:
        campaign = msgspec.convert(data, Campaign)
    except msgspec.ValidationError as error:
        known = ", ".join(field.name for field in msgspec.structs.fields(Campaign))
        raise ConfigError(f"{path}: {error}; keys of a campaign: {known}") from error
    if problem := _problem(campaign):
        raise ConfigError(f"{path}: {problem}")
    return msgspec.structs.replace(
        campaign,
        presets=_resolved(path, campaign.presets),
        variants={name: _resolved(path, files) for name, files in campaign.variants.items()},
    )


def _problem(campaign: Campaign) -> str:
    """What would make samples that cannot be told apart, or none; empty where nothing does."""
    if not campaign.scenarios:
        return "scenarios = []: at least one scenario is needed"
    for axis in (VARIANT, WORLD):
        if axis in campaign.axes:
            return f"axes: {axis!r} is no key of a scenario; named ones stand in [{axis}s]"
    for key, values in {"scenarios": campaign.scenarios, **campaign.axes}.items():
        if not values:
            return f"axes: {key} = []: at least one value is needed"
        texts = [str(value) for value in values]
        twice = next((text for text in texts if texts.count(text) > 1), None)
        if twice is not None:
            return f"{key}: {twice} stands there twice"
    return ""


def _resolved(campaign_file: Path, names: Sequence[str]) -> tuple[str, ...]:
    return tuple(str(_preset(campaign_file, name)) for name in names)


def _preset(campaign_file: Path, name: str) -> Path:
    beside = campaign_file.parent / name
    if not beside.is_file():
        raise ConfigError(f"{campaign_file}: presets: {name!r} is not a file beside it")
    return beside


def samples(campaign: Campaign, seeds: int | None = None) -> Iterator[Sample]:
    """All flights in their order: scenario, then axes as they stand in the file, then seeds.

    `seeds` takes only the first so many seeds of each combination; every sample keeps its number.
    """
    index = 0
    axes = campaign.all_axes
    for scenario, values in itertools.product(campaign.scenarios, itertools.product(*axes.values())):
        chosen = dict(zip(axes, values, strict=True))
        cell = " ".join([scenario, *(f"{key}={value}" for key, value in chosen.items())])
        presets = campaign.presets + campaign.variants.get(chosen.pop(VARIANT, ""), ())
        named_world = campaign.worlds.get(chosen.pop(WORLD, ""), {})
        app = {k.removeprefix(APP_PREFIX): v for k, v in chosen.items() if k.startswith(APP_PREFIX)}
        world = {k: v for k, v in chosen.items() if not k.startswith(APP_PREFIX)}
        wanted = campaign.seeds if seeds is None else min(seeds, campaign.seeds)
        for offset in range(wanted):
            yield Sample(
                index + offset,
                scenario,
                campaign.first_seed + offset,
                cell,
                presets,
                {**campaign.set, **app},
                {**campaign.world, **world, **named_world},
            )
        index += campaign.seeds


def cells(campaign: Campaign) -> Iterator[Sample]:
    """The first sample of each combination: enough to see whether all keys and values are known."""
    return samples(campaign, 1)


def fingerprint(campaign: Campaign) -> str:
    """Of everything that decides what sample N is, files by their content: a file of results belongs to one fingerprint."""
    content = msgspec.to_builtins(campaign)
    if not campaign.worlds:
        del content["worlds"]  # results flown before there were named worlds stay valid
    content["presets"] = _contents(campaign.presets)
    content["variants"] = {name: _contents(files) for name, files in campaign.variants.items()}
    content["scenarios"] = [[name, read_scenario(find_scenario("scenarios", name))] for name in campaign.scenarios]
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]


def _contents(files: Sequence[str]) -> list[str]:
    return [Path(file).read_text(encoding="utf-8") for file in files]
