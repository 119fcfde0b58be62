"""Reading the autopilot's parameters by name: asked one by one, asked again, given up. Sans-IO.

PX4 puts integers into PARAM_VALUE.param_value bit by bit (MAV_PARAM_ENCODE_BYTEWISE), so 1 arrives as 1.4e-45: the type
field says how to read the four bytes. Nothing here writes a parameter: a landing program does not tune a vehicle.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import dataclass

from companion.mavlink.dialect import ParamRequestRead, ParamValue

Value = int | float
AT_ONCE = 4
_INTEGERS = {1: "<B3x", 2: "<b3x", 3: "<H2x", 4: "<h2x", 5: "<I", 6: "<i"}
"""MAV_PARAM_TYPE of integers to what lies in the four bytes."""
BY_NAME = -1


@dataclass(slots=True)
class _Wanted:
    attempts: int = 0
    deadline_ns: int = 0


class ParameterReader:
    """`values` fills; `missing` are names that the autopilot does not answer to."""

    def __init__(self, *, target_system: int, target_component: int, timeout_ns: int, attempts: int) -> None:
        self.values: dict[str, Value] = {}
        self.missing: set[str] = set()
        self._target = (target_system, target_component)
        self._timeout_ns = timeout_ns
        self._attempts = attempts
        self._wanted: dict[str, _Wanted] = {}

    def want(self, names: Iterable[str]) -> None:
        """Ask for these; ValueError for a name that cannot be one. They come with the next `due`."""
        for name in names:
            if not name.isascii() or not 1 <= len(name) <= 16:
                raise ValueError(f"{name!r} is no parameter name: 1 to 16 ASCII characters")
            self.missing.discard(name)
            self._wanted.setdefault(name, _Wanted())

    @property
    def complete(self) -> bool:
        """Everything asked has been answered or given up."""
        return not self._wanted

    def received(self, message: ParamValue) -> None:
        """Take one PARAM_VALUE, asked or not: ground stations share the link and their answers are as good."""
        name = message.param_id.split(b"\0")[0].decode("ascii", "replace")
        self.values[name] = decoded(message.param_value, message.param_type)
        self._wanted.pop(name, None)

    def next_timer_ns(self) -> int | None:
        return min((wanted.deadline_ns for wanted in self._in_turn().values()), default=None)

    def due(self, now_ns: int) -> list[ParamRequestRead]:
        """Requests to send now: a few at a time, so that a slow line is not flooded."""
        requests = []
        for name, wanted in self._in_turn().items():
            if wanted.deadline_ns > now_ns:
                continue
            if wanted.attempts >= self._attempts:
                del self._wanted[name]
                self.missing.add(name)
                continue
            wanted.attempts += 1
            wanted.deadline_ns = now_ns + self._timeout_ns
            requests.append(ParamRequestRead(BY_NAME, *self._target, name.encode()))
        return requests

    def _in_turn(self) -> dict[str, _Wanted]:
        return dict(list(self._wanted.items())[:AT_ONCE])


def decoded(value: float, kind: int) -> Value:
    """The number that a PARAM_VALUE means."""
    layout = _INTEGERS.get(kind)
    return value if layout is None else int(struct.unpack(layout, struct.pack("<f", value))[0])
