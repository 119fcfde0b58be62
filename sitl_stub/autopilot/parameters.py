"""PX4's parameters: names, types and defaults of the recorded PX4 v1.17 (data/px4_parameters.csv), and their bytes on the wire.

PX4 puts an integer's own four bytes into the float field of PARAM_VALUE and PARAM_SET (the "byte-wise union"); a client that
converts the number instead reads 1e-43. Used by the commander, the flight tasks and the control cascade.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping
from functools import cache
from importlib.resources import files
from struct import Struct
from zlib import crc32

MAV_PARAM_TYPE_UINT32 = 5
MAV_PARAM_TYPE_INT32 = 6
MAV_PARAM_TYPE_REAL32 = 9

_FLOAT = Struct("<f")
_INT = Struct("<i")

HASH_NAME = "_HASH_CHECK"


@cache
def default_values() -> Mapping[str, float | int]:
    """All parameters in PX4's order; the Python type is the parameter's type."""
    text = files("sitl_stub").joinpath("data/px4_parameters.csv").read_text(encoding="ascii")
    rows = csv.DictReader(text.splitlines())
    return {row["name"]: int(row["value"]) if row["type"] == "INT32" else float(row["value"]) for row in rows}


def _round_to_float32(value: float) -> float:
    return float(_FLOAT.unpack(_FLOAT.pack(value))[0])


class Parameters:
    """The parameters of one vehicle.

    `overrides` may hold any known name; an unknown name raises KeyError. Floats are kept at single precision as PX4 does.
    """

    def __init__(self, overrides: Mapping[str, float | int] | None = None) -> None:
        self._values: dict[str, float | int] = dict(default_values())
        self._names = list(self._values)
        self._index = {name: index for index, name in enumerate(self._names)}
        self._listeners: list[Callable[[str], None]] = []
        for name, value in (overrides or {}).items():
            self.set(name, value)

    def __len__(self) -> int:
        return len(self._names)

    def __contains__(self, name: object) -> bool:
        return name in self._values

    def __getitem__(self, name: str) -> float | int:
        return self._values[name]

    def get(self, name: str) -> float:
        """Value as a float; KeyError for an unknown name."""
        return float(self._values[name])

    def get_int(self, name: str) -> int:
        """Value as an integer; KeyError for an unknown name."""
        return int(self._values[name])

    def as_mapping(self) -> Mapping[str, float | int]:
        """Live read-only view for the control cascade."""
        return self._values

    def name_at(self, index: int) -> str | None:
        """Name of the parameter with that index, None when out of range."""
        return self._names[index] if 0 <= index < len(self._names) else None

    def index_of(self, name: str) -> int:
        """Index as in PARAM_VALUE."""
        return self._index[name]

    def set(self, name: str, value: float | int) -> None:
        """Store a value (converted to the parameter's own type) and tell the listeners."""
        is_integer = isinstance(self._values[name], int)
        self._values[name] = int(value) if is_integer else _round_to_float32(float(value))
        for listener in self._listeners:
            listener(name)

    def on_change(self, listener: Callable[[str], None]) -> None:
        """Call `listener(name)` after each change."""
        self._listeners.append(listener)

    def wire_type(self, name: str) -> int:
        """MAV_PARAM_TYPE of the parameter."""
        return MAV_PARAM_TYPE_INT32 if isinstance(self._values[name], int) else MAV_PARAM_TYPE_REAL32

    def wire_value(self, name: str) -> bytes:
        """The four bytes of the `param_value` field."""
        value = self._values[name]
        return _INT.pack(value) if isinstance(value, int) else _FLOAT.pack(value)

    def set_from_wire(self, name: str, raw: bytes, wire_type: int) -> bool:
        """Store the four bytes of PARAM_SET; False when the type is not the parameter's."""
        if wire_type != self.wire_type(name):
            return False
        self.set(name, (_INT if wire_type == MAV_PARAM_TYPE_INT32 else _FLOAT).unpack(raw)[0])
        return True

    def hash(self) -> int:
        """Checksum over names and values, as a ground station caches the list by it."""
        crc = 0
        for name in self._names:
            crc = crc32(self.wire_value(name), crc32(name.encode("ascii"), crc))
        return crc
