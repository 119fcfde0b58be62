"""Each paper's own scenarios, for `companion reproduce --versus`: flown by its preset and by the default pipeline.

A scene names a scenario of configs/scenarios/papers. The default pipeline sees what it is made for: a camera that looks
down, the paper's where it has one, on its own marker on a deck of the same size and motion (`default_world`, `default_files`,
`default_app`); the beacon is the scenario's.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, slots=True)
class Scene:
    """`world` holds for both; `preset_app` for the preset alone, the others for the default pipeline alone.

    `default_files` are configuration files without folder and suffix, as "pads/nested".
    """

    name: str
    scenario: str
    world: Mapping[str, Any] = field(default_factory=dict)
    preset_app: Mapping[str, Any] = field(default_factory=dict)
    default_world: Mapping[str, Any] = field(default_factory=dict)
    default_files: tuple[str, ...] = ()
    default_app: Mapping[str, Any] = field(default_factory=dict)


_LENS = {"cameras.down.fx_px": 263.0, "cameras.down.fy_px": 263.0}
_FISHEYE = {
    "cameras.down.model": "scaramuzza",
    "cameras.down.fx_px": 160.0,
    "cameras.down.fy_px": 160.0,
    "cameras.down.distortion": (160.0, 0.0, -2.0e-3, 0.0, 0.0),
}
"""Of `falanga` and of `kim`: where the paper's camera looks down both sides look through it; only the target is another."""


def _dalang(name: str, threshold_m: float, speed_m_s: float) -> Scene:
    world = {"path.speed_m_s": speed_m_s, "path.go_s": 20.0 if speed_m_s > 0.5 else 70.0}
    return Scene(name, "dalang", world, {"planning.deviation_threshold_m": threshold_m})


def _falanga(name: str, path: Mapping[str, Any]) -> Scene:
    return Scene(name, "falanga", {"path": path}, default_world={"pad.file": "nested"}, default_app=_LENS)


def _guo(name: str, scenario: str, preset_app: Mapping[str, Any]) -> Scene:
    own_pad = {"pad.file": "deck_120x70", "cameras": {"down": {}}}
    return Scene(name, scenario, {}, preset_app, own_pad, ("pads/deck_120x70",))


_EIGHT = {"length_m": 50.0, "width_m": 16.0}
_NEAR = {"mission.follow_behind_m": 2.25}

SCENES: dict[str, tuple[Scene, ...]] = {
    "shivam": (
        Scene("case 1, pad still", "shivam"),
        Scene("case 1, pad at 0.5 m/s", "shivam", {"path.speed_m_s": 0.5}),
        Scene("case 1, pad at 1.0 m/s", "shivam", {"path.speed_m_s": 1.0}),
    ),
    "falanga": (
        _falanga("line, 1.2 m/s", {"kind": "line", "speed_m_s": 1.2}),
        _falanga("circle, 2 m/s", {"kind": "circle", "speed_m_s": 2.0, "radius_m": 10.0}),
        _falanga("figure-8, 3 m/s", {"kind": "figure8", "speed_m_s": 3.0, **_EIGHT}),
        _falanga("figure-8, 4.2 m/s", {"kind": "figure8", "speed_m_s": 4.2, **_EIGHT}),
    ),
    "guo": (
        _guo("still deck, wind 12 km/h", "guo_deck", {}),
        _guo("cart, 0.2 m/s", "guo_cart", _NEAR),
        _guo("boat, 0.4 m/s", "guo", _NEAR),
    ),
    "kim": (Scene("rover on a line", "kim", default_world={"pad.file": "nested"}, default_app=_FISHEYE),),
    "dalang": (
        _dalang("Table I, 0.2 m", 0.2, 0.1),
        _dalang("Table I, 0.8 m", 0.8, 0.1),
        _dalang("Table I, 1.0 m, and Table II, 0.1 m/s", 1.0, 0.1),
        _dalang("Table II, 1.0 m/s", 1.0, 1.0),
        _dalang("Table II, 0.2 m/s", 1.0, 0.2),
    ),
}
"""By paper."""
