"""Frames to wire messages and back, exact to the byte of pymavlink's.

The messages of dialect.py are decoded and packed by precompiled structs (no objects of pymavlink in the loop: measured
in benchmarks/mavlink.py). Any other message id is looked up, when somebody asks for it, in pymavlink's generated dialect:
this is the only file that knows pymavlink, and it imports it only then. NaN and None meet here and nowhere else.
"""

from __future__ import annotations

import functools
import math
import re
import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from fastcrc.crc16 import mcrf4xx

from companion.mavlink import dialect
from companion.mavlink.dialect import WireMessage
from companion.mavlink.framing import HEADER_V1, HEADER_V2, MAGIC_V2

NAN = math.nan
_ZEROS = bytes(255)
_CHECKSUM = struct.Struct("<H")
_HEADER_V2 = struct.Struct("<BBBBBBBHB")  # magic, length, incompatible, compatible, sequence, system, component, id


@dataclass(frozen=True, slots=True)
class Definition:
    """How one message lies on the wire; fields in wire order, `array_lengths` 0 for scalars and strings."""

    message_id: int
    name: str
    layout: struct.Struct
    crc_extra: int
    fields: tuple[str, ...]
    array_lengths: tuple[int, ...]
    make: Callable[[Any], Any] = field(repr=False)
    has_arrays: bool = False


@dataclass(frozen=True, slots=True)
class Received:
    """A decoded frame and who sent it."""

    system: int
    component: int
    sequence: int
    message: WireMessage


class PeerError(ValueError):
    """What the peer sent is no message we can read."""


def finite(*values: float) -> bool:
    """True where no value is NaN or infinite."""
    return all(map(math.isfinite, values))


def number(value: float) -> float | None:
    """None for NaN and infinity."""
    return value if math.isfinite(value) else None


def wire(value: float | None) -> float:
    """NaN for None."""
    return NAN if value is None else value


def frame_is_valid(frame: bytes) -> bool | None:
    """Whether the checksum holds; None for a message that we do not know, which cannot be checked."""
    definition = DEFINITIONS.get(message_id(frame))
    return None if definition is None else _checksum_holds(frame, definition.crc_extra)


def message_id(frame: bytes) -> int:
    if frame[0] == MAGIC_V2:
        return frame[7] | frame[8] << 8 | frame[9] << 16
    return frame[5]


def payload(frame: bytes) -> bytes:
    """The payload as sent: MAVLink 2 leaves zeros at its end away."""
    header = HEADER_V2 if frame[0] == MAGIC_V2 else HEADER_V1
    return frame[header : header + frame[1]]


def decode(frame: bytes) -> Received | None:
    """The message in a complete frame; None where its id is not one of dialect.py. The checksum is not looked at."""
    definition = DEFINITIONS.get(message_id(frame))
    if definition is None:
        return None
    message = unpack(definition, payload(frame))
    if frame[0] == MAGIC_V2:
        return Received(frame[5], frame[6], frame[4], message)
    return Received(frame[3], frame[4], frame[2], message)


def unpack(definition: Definition, data: bytes) -> Any:
    """Payload to named tuple. Missing bytes are zero, bytes of newer extensions are ignored."""
    size = definition.layout.size
    values = definition.layout.unpack(data.ljust(size, b"\0") if len(data) <= size else data[:size])
    return definition.make(values if not definition.has_arrays else _grouped(values, definition.array_lengths))


def pack(message: WireMessage) -> bytes:
    """Payload of a message, zeros at the end left away as MAVLink 2 wants it (one byte stays)."""
    definition = BY_TYPE[type(message)]
    values = _flat(message) if definition.has_arrays else message
    return _trimmed(definition.layout.pack(*values))


def encode(message: WireMessage, sequence: int, system: int, component: int) -> bytes:
    """A complete unsigned MAVLink 2 frame."""
    definition = BY_TYPE[type(message)]
    values = _flat(message) if definition.has_arrays else message
    return frame_payload(definition, definition.layout.pack(*values), sequence, system, component)


def frame_payload(definition: Definition, data: bytes, sequence: int, system: int, component: int) -> bytes:
    """Header, payload and checksum of a MAVLink 2 frame."""
    data = _trimmed(data)
    number_of = definition.message_id
    header = _HEADER_V2.pack(
        MAGIC_V2, len(data), 0, 0, sequence & 0xFF, system, component, number_of & 0xFFFF, number_of >> 16
    )
    body = header + data
    return body + _CHECKSUM.pack(mcrf4xx(body[1:] + bytes((definition.crc_extra,))))


def _trimmed(data: bytes) -> bytes:
    return data.rstrip(b"\0") or b"\0"


def _checksum_holds(frame: bytes, crc_extra: int) -> bool:
    end = (HEADER_V2 if frame[0] == MAGIC_V2 else HEADER_V1) + frame[1]
    expected: int = mcrf4xx(frame[1:end] + bytes((crc_extra,)))
    return expected == frame[end] | frame[end + 1] << 8


def _grouped(values: tuple[Any, ...], array_lengths: tuple[int, ...]) -> list[Any]:
    grouped: list[Any] = []
    position = 0
    for length in array_lengths:
        if length == 0:
            grouped.append(values[position])
            position += 1
        else:
            grouped.append(values[position : position + length])
            position += length
    return grouped


def _flat(message: WireMessage) -> list[Any]:
    flat: list[Any] = []
    for value in message:
        if isinstance(value, tuple):
            flat.extend(value)
        else:
            flat.append(value)
    return flat


def _array_lengths(layout_format: str) -> tuple[int, ...]:
    """Lengths of the fields in a struct format; 0 for scalars and for strings, which struct keeps whole."""
    lengths: list[int] = []
    digits = ""
    for character in layout_format.lstrip("<"):
        if character.isdigit():
            digits += character
        else:
            lengths.append(int(digits) if digits and character != "s" else 0)
            digits = ""
    return tuple(lengths)


def _definition(kind: type[WireMessage], number_of: int, layout_format: str, crc_extra: int) -> Definition:
    lengths = _array_lengths(layout_format)
    return Definition(
        message_id=number_of,
        name=re.sub(r"(?<!^)(?=[A-Z])", "_", kind.__name__).upper(),
        layout=struct.Struct(layout_format),
        crc_extra=crc_extra,
        fields=kind._fields,
        array_lengths=lengths,
        make=kind._make,
        has_arrays=any(lengths),
    )


BY_TYPE: dict[type, Definition] = {row[0]: _definition(*row) for row in dialect.TABLE}
DEFINITIONS: dict[int, Definition] = {definition.message_id: definition for definition in BY_TYPE.values()}

# PX4 sends these, pymavlink's dialects lack them: only logs are read with them.
_NOT_IN_PYMAVLINK = (
    (
        "LINK_NODE_STATUS",
        8,
        "<QIIIIIHHHBB",
        117,
        "timestamp tx_rate rx_rate messages_sent messages_received messages_lost rx_parse_err tx_overflows "
        "rx_overflows tx_buf rx_buf",
    ),
    (
        "TIME_ESTIMATE_TO_TARGET",
        380,
        "<iiiii",
        232,
        "safe_return land mission_next_item mission_end commanded_action",
    ),
    ("CURRENT_EVENT_SEQUENCE", 411, "<HB", 106, "sequence flags"),
)


@functools.cache
def full_dialect() -> dict[int, Definition]:
    """Every message that pymavlink knows in any dialect, and ours: to read anybody's log. Costs its import, 0.1 s."""
    from pymavlink.dialects.v20 import all as everything

    definitions = {number_of: _foreign_definition(kind) for number_of, kind in everything.mavlink_map.items()}
    for name, number_of, layout_format, crc_extra, fields in _NOT_IN_PYMAVLINK:
        definitions[number_of] = _log_definition(number_of, name, layout_format, crc_extra, tuple(fields.split()))
    return definitions | DEFINITIONS


def _foreign_definition(kind: Any) -> Definition:
    return _log_definition(kind.id, kind.msgname, kind.unpacker.format, kind.crc_extra, tuple(kind.ordered_fieldnames))


def _log_definition(
    number_of: int, name: str, layout_format: str, crc_extra: int, fields: tuple[str, ...]
) -> Definition:
    lengths = _array_lengths(layout_format)
    layout = struct.Struct(layout_format)
    return Definition(number_of, name, layout, crc_extra, fields, lengths, make=tuple, has_arrays=any(lengths))
