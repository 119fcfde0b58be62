"""A campaign file: scenarios x parameters x seeds, as TOML. Order and numbering of the samples are fixed by the file alone.

name = "first-landing"
scenarios = ["line", "circle"]
seeds = 100                      # seeds 1..100 of each combination
first_seed = 1
presets = []                     # configuration files of the app, relative to the campaign file or to configs/

[set]                            # keys of the app's configuration for all samples
"control.lead_s" = 0.3
[world]                          # keys of the scenario for all samples
"wind.mean_m_s" = 5.0
[axes]                           # every combination is flown; keys of the scenario, or of the app with "app:" in front
"path.speed_m_s" = [1.0, 2.0, 4.2]
"""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import msgspec
from msgspec import Meta

from companion.config import ConfigError, read_toml

APP_PREFIX = "app:"


class Campaign(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What is flown. `axes` values may be anything that the key takes."""

    name: str
    scenarios: tuple[str, ...]
    seeds: Annotated[int, Meta(ge=1, le=1_000_000)] = 100
    first_seed: Annotated[int, Meta(ge=0)] = 1
    presets: tuple[str, ...] = ()
    set: dict[str, Any] = {}
    world: dict[str, Any] = {}
    axes: dict[str, tuple[Any, ...]] = {}


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
    if not campaign.scenarios:
        raise ConfigError(f"{path}: scenarios = []: at least one scenario is needed")
    presets = tuple(str(_preset(path, name)) for name in campaign.presets)
    return msgspec.structs.replace(campaign, presets=presets)


def _preset(campaign_file: Path, name: str) -> Path:
    beside = campaign_file.parent / name
    if not beside.is_file():
        raise ConfigError(f"{campaign_file}: presets: {name!r} is not a file beside it")
    return beside


def samples(campaign: Campaign) -> Iterator[Sample]:
    """All flights in their order: scenario, then axes as they stand in the file, then seeds."""
    index = 0
    for scenario, values in itertools.product(campaign.scenarios, itertools.product(*campaign.axes.values())):
        chosen = dict(zip(campaign.axes, values, strict=True))
        app = {k.removeprefix(APP_PREFIX): v for k, v in chosen.items() if k.startswith(APP_PREFIX)}
        world = {k: v for k, v in chosen.items() if not k.startswith(APP_PREFIX)}
        cell = " ".join([scenario, *(f"{key}={value}" for key, value in chosen.items())])
        for seed in range(campaign.first_seed, campaign.first_seed + campaign.seeds):
            yield Sample(
                index,
                scenario,
                seed,
                cell,
                campaign.presets,
                {**campaign.set, **app},
                {**campaign.world, **world},
            )
            index += 1


def fingerprint(campaign: Campaign) -> str:
    """Of everything that decides what sample N is: a file of results belongs to one fingerprint."""
    content = json.dumps(msgspec.to_builtins(campaign), sort_keys=True)
    return hashlib.sha256(content.encode()).hexdigest()[:16]
