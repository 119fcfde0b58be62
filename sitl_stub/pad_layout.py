"""What is painted on the pad and how large the deck is, read from configs/pads/*.toml on the simulator's side.

Positions are in the pad frame P: x along travel, y right, z down, origin at the landing point on the deck's top. Metres
and degrees in the file, metres and radians here. The scenario reads it; the renderer and the contact model use it. The
application has its own reader of the same files, on purpose.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

Vec2 = tuple[float, float]


class PadLayoutError(ValueError):
    """A pad file that cannot be used; the text names the file and the key."""


@dataclass(frozen=True, slots=True)
class Marker:
    """One marker. At yaw 0 the top edge of its image points along P +x.

    `facing` is "up" (painted on the deck, `position_m` is its centre) or "back" (on the upright board, seen by a vehicle
    that comes from behind; `position_m` is the point of the deck below its centre, `height_m` the centre's height over it).
    """

    id: int
    size_m: float
    position_m: Vec2 = (0.0, 0.0)
    yaw_rad: float = 0.0
    facing: str = "up"
    height_m: float = 0.0


@dataclass(frozen=True, slots=True)
class PadLayout:
    """The deck (a box whose top is `length_m` along x by `width_m` along y) and its markers.

    `deck_center_m` is the centre of the deck's top in P: zero unless the landing point lies off centre. `board_size_m` is
    (width, height) of an upright board that stands on the deck behind its marker, None without one. Grey values are those
    of a well exposed image.
    """

    family: str = "DICT_4X4_50"
    length_m: float = 1.5
    width_m: float = 1.5
    deck_height_m: float = 0.5
    deck_center_m: Vec2 = (0.0, 0.0)
    board_size_m: Vec2 | None = None
    deck_brightness: float = 225.0
    markers: tuple[Marker, ...] = field(default=(Marker(45, 1.2), Marker(7, 0.24)))


_FACINGS = ("up", "back")
_PAD_KEYS = frozenset(
    ("family", "length_m", "width_m", "deck_height_m", "deck_center_m", "board_size_m", "deck_brightness", "markers")
)
_MARKER_KEYS = frozenset(("id", "size_m", "position_m", "yaw_deg", "facing", "height_m"))


def pad_layout_from_toml(text: str, origin: str = "pad") -> PadLayout:
    """The layout in the text of a pad file. PadLayoutError for an unknown key, a missing one or a wrong type."""
    try:
        table = tomllib.loads(text)["pad"]
    except tomllib.TOMLDecodeError as error:
        raise PadLayoutError(f"{origin}: is not valid TOML: {error}") from error
    except KeyError as error:
        raise PadLayoutError(f"{origin}: has no [pad]") from error
    return pad_layout_from_table(table, origin)


def pad_layout_from_table(table: Mapping[str, Any], origin: str = "pad") -> PadLayout:
    """The layout in the parsed [pad] table."""
    _refuse_unknown(table, _PAD_KEYS, f"{origin}: [pad]")
    values: dict[str, Any] = {key: table[key] for key in _PAD_KEYS & table.keys() - {"markers"}}
    for key in {"deck_center_m", "board_size_m"} & values.keys():
        values[key] = _pair(values[key], f"{origin}: [pad] {key}")
    if "markers" in table:
        values["markers"] = tuple(_marker(entry, origin) for entry in table["markers"])
    layout = PadLayout(**values)
    _check(layout, origin)
    return layout


def _marker(entry: Mapping[str, Any], origin: str) -> Marker:
    where = f"{origin}: [[pad.markers]]"
    _refuse_unknown(entry, _MARKER_KEYS, where)
    if not {"id", "size_m"} <= entry.keys():
        raise PadLayoutError(f"{where} needs id and size_m, has {', '.join(sorted(entry))}")
    facing = entry.get("facing", "up")
    if facing not in _FACINGS:
        raise PadLayoutError(f"{where} facing = {facing!r}: allowed are {', '.join(_FACINGS)}")
    return Marker(
        id=int(entry["id"]),
        size_m=float(entry["size_m"]),
        position_m=_pair(entry.get("position_m", (0.0, 0.0)), f"{where} position_m"),
        yaw_rad=math.radians(entry.get("yaw_deg", 0.0)),
        facing=facing,
        height_m=float(entry.get("height_m", 0.0)),
    )


def _check(layout: PadLayout, origin: str) -> None:
    sizes = {"length_m": layout.length_m, "width_m": layout.width_m}
    sizes |= {f"size_m of marker {marker.id}": marker.size_m for marker in layout.markers}
    for name, size in sizes.items():
        if not size > 0.0:
            raise PadLayoutError(f"{origin}: [pad] {name} = {size!r}: must be greater than 0")
    upright = any(marker.facing == "back" for marker in layout.markers)
    if upright and layout.board_size_m is None:
        raise PadLayoutError(f"{origin}: a marker that faces back needs [pad] board_size_m = [width, height]")


def _refuse_unknown(table: Mapping[str, Any], known: frozenset[str], where: str) -> None:
    unknown = sorted(set(table) - known)
    if unknown:
        raise PadLayoutError(f"{where} {unknown[0]} is not a key; allowed: {', '.join(sorted(known))}")


def _pair(value: Any, where: str) -> Vec2:
    if len(value) != 2:
        raise PadLayoutError(f"{where} = {value!r}: needs two numbers")
    return (float(value[0]), float(value[1]))
