"""flight.mcap: every message of the vocabulary as JSON with its schema, sampled camera frames, and what made the flight.

One channel for each message type ("/pad_estimate"). A message's JSON is its dataclass plus `sequence` (order of handling) and
`cause` (the sequence of the input that an output answers); MCAP's log time is its arrival and its publish time is `t_ns`, both
moved to the log's epoch by `log_minus_companion_ns` of the metadata record. Chunks are closed every half second of log time:
that is what a killed process loses. The reader needs no summary, and steps over damaged places. Same flight, same bytes.
"""

from __future__ import annotations

import base64
import dataclasses
import enum
import io
import math
import re
import struct
import types
import typing
import zlib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, Protocol, runtime_checkable

import cv2
import msgspec
import numpy as np
from mcap import records as mcap_records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.writer import CompressionType, IndexType, Writer

from companion import messages
from companion.config import Config
from companion.messages import Image, Message
from companion.onboard import JournalEntry

FORMAT = "1"
METADATA = "companion"
CHANNELS = "companion.channels"
FLUSH_EVERY_NS = 500_000_000
"""Of log time, so that the bytes do not depend on how fast the process runs."""

CHUNK_BYTES = 1_000_000
FRAME_PERIOD_NS = 500_000_000
JPEG_QUALITY = 50
FRAME_TOPIC = "/camera/"
TRUTH_TOPIC = "/truth"
MAX_CHUNK_BYTES = 64_000_000
"""A chunk that claims to be larger is damaged: nothing is allocated for it."""

MAGIC = b"\x89MCAP0\r\n"
_TAIL = 37
"""Bytes of footer and magic at the end of a file that was closed."""

_RECORD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
_CHUNK = struct.Struct("<QQQI")
_CHUNK_MARK = re.compile(rb"\x04\x00\x00\x00zstd|\x03\x00\x00\x00lz4")
_INPUTS = frozenset(typing.get_args(messages.Input))
MESSAGE_TYPES: tuple[type, ...] = (*typing.get_args(messages.Input), *typing.get_args(messages.Output))


def topic_of(kind: type) -> str:
    """PadEstimate -> /pad_estimate."""
    return "/" + re.sub(r"(?<!^)(?=[A-Z])", "_", kind.__name__).lower()


TYPE_OF_TOPIC: dict[str, type] = {topic_of(kind): kind for kind in MESSAGE_TYPES}


# ------------------------------------------------------------------------------------------------------------- schemas


def schema_of(kind: type) -> dict[str, Any]:
    """JSON schema of a message as it stands in the log.

    Every message fits it (JSON Schema 2020-12). The viewers' readers know one type for a field and arrays of scalars: what may
    be null and arrays of arrays stand under `patternProperties`, where those readers do not look.
    """
    hints = typing.get_type_hints(kind)
    fields = {
        "sequence": int,
        "cause": int | None,
        **{item.name: hints[item.name] for item in dataclasses.fields(kind)},
    }
    schemas = {name: _type_schema(hint) for name, hint in fields.items()}
    return {
        "title": kind.__name__,
        "description": (kind.__doc__ or "").strip().split("\n")[0],
        "type": "object",
        "properties": {name: schema for name, schema in schemas.items() if _is_plain(schema)},
        "patternProperties": {f"^{name}$": schema for name, schema in schemas.items() if not _is_plain(schema)},
        "required": list(fields),
    }


def _type_schema(hint: Any) -> dict[str, Any]:
    arguments = typing.get_args(hint)
    if isinstance(hint, types.UnionType):
        (inner,) = [argument for argument in arguments if argument is not types.NoneType]
        return {"anyOf": [_type_schema(inner), {"type": "null"}]}
    if typing.get_origin(hint) is tuple:
        return _tuple_schema(arguments)
    if issubclass(hint, enum.Enum):
        return {"type": "string", "enum": [member.value for member in hint]}
    return {"type": {bool: "boolean", int: "integer", float: "number", str: "string"}[hint]}


def _tuple_schema(arguments: tuple[Any, ...]) -> dict[str, Any]:
    if arguments[-1] is Ellipsis:
        return {"type": "array", "items": _type_schema(arguments[0])}
    if len(set(arguments)) == 1:
        count = len(arguments)
        return {"type": "array", "items": _type_schema(arguments[0]), "minItems": count, "maxItems": count}
    return {"type": "array", "prefixItems": [_type_schema(argument) for argument in arguments]}


def _is_plain(schema: Mapping[str, Any]) -> bool:
    """A scalar or an array of scalars, never null."""
    kind = schema["items"].get("type") if schema.get("type") == "array" and "items" in schema else schema.get("type")
    return kind not in (None, "array")


_TIME = {"type": "object", "title": "time", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}}
COMPRESSED_IMAGE = {
    "title": "foxglove.CompressedImage",
    "description": "A compressed image",
    "type": "object",
    "properties": {
        "timestamp": _TIME,
        "frame_id": {"type": "string"},
        "data": {"type": "string", "contentEncoding": "base64"},
        "format": {"type": "string"},
    },
}
_VECTOR = {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3}
TRUTH = {
    "title": "Truth",
    "description": "Simulation only: where vehicle and pad really are. Nothing that decides sees it.",
    "type": "object",
    "properties": {"t_ns": {"type": "integer"}, "vehicle_position_ned_m": _VECTOR, "pad_position_ned_m": _VECTOR},
}


# -------------------------------------------------------------------------------------------------------------- writer


@dataclass(frozen=True, slots=True)
class LogOrigin:
    """What a log says of itself. `log_minus_companion_ns` moves the companion's monotonic time to the log's."""

    config: Config
    versions: Mapping[str, str]
    log_minus_companion_ns: int
    about: Mapping[str, str] = field(default_factory=dict)


def encode_entry(sequence: int, cause: int | None, message: Any) -> bytes:
    """The JSON of one entry: the message with `sequence` and `cause` before its own fields."""
    body = _ENCODER.encode(message)
    return b'{"sequence":%d,"cause":%s,' % (sequence, b"null" if cause is None else b"%d" % cause) + body[1:]


def _plain(value: Any) -> Any:
    """Numpy scalars that found their way into a message."""
    if isinstance(value, np.generic):
        return value.item()
    raise NotImplementedError


_ENCODER = msgspec.json.Encoder(enc_hook=_plain)


class McapWriter:
    """Appends journal entries, frames and truth. Cost: some 15 us an entry, and a chunk every half second.

    `small` is for logs that are kept in a repository: one chunk and no index of messages, nothing to read before the end.
    """

    def __init__(self, path: Path, origin: LogOrigin, *, small: bool = False) -> None:
        self._file = path.open("wb")
        self._writer = Writer(
            self._file,
            chunk_size=MAX_CHUNK_BYTES if small else CHUNK_BYTES,
            compression=CompressionType.ZSTD,
            index_types=IndexType.ALL & ~IndexType.MESSAGE if small else IndexType.ALL,
        )
        self._flush_every_ns = math.inf if small else FLUSH_EVERY_NS
        self._shift_ns = origin.log_minus_companion_ns
        self._flushed_ns: int | None = None
        self._frame_due_ns: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._writer.start(profile="", library=f"companion {origin.versions.get('companion', '')}")
        self._channels = {topic_of(kind): 0 for kind in MESSAGE_TYPES}
        for kind in MESSAGE_TYPES:
            self._channels[topic_of(kind)] = self._register(topic_of(kind), kind.__name__, schema_of(kind))
        self._of_type = {kind: self._channels[topic_of(kind)] for kind in MESSAGE_TYPES}
        self._write_origin(origin)

    def _register(self, topic: str, name: str, schema: Mapping[str, Any]) -> int:
        if name not in self._schemas:
            self._schemas[name] = self._writer.register_schema(name, "jsonschema", msgspec.json.encode(schema))
        return self._writer.register_channel(topic, "json", self._schemas[name])

    def _write_origin(self, origin: LogOrigin) -> None:
        content = {
            "format": FORMAT,
            "config": msgspec.json.encode(origin.config).decode(),
            "versions": msgspec.json.encode(dict(origin.versions)).decode(),
            "log_minus_companion_ns": str(origin.log_minus_companion_ns),
            **origin.about,
        }
        self._writer.add_metadata(METADATA, content)
        self._writer.add_metadata(CHANNELS, {str(number): topic for topic, number in self._channels.items()})
        self._file.flush()

    def write(self, entry: JournalEntry) -> None:
        self._add(
            self._of_type[type(entry.message)],
            entry.arrived_ns,
            encode_entry(entry.sequence, entry.cause, entry.message),
            entry.message.t_ns,
            entry.sequence,
        )

    def write_frame(self, camera: str, arrived_ns: int, t_ns: int, frame: Image | bytes) -> None:
        """Keep a frame (pixels, or a finished JPEG) unless the last one of this camera is too recent."""
        due_ns = self._frame_due_ns.get(camera)
        if due_ns is not None and arrived_ns < due_ns:
            return
        self._frame_due_ns[camera] = arrived_ns + FRAME_PERIOD_NS
        topic = FRAME_TOPIC + camera
        if topic not in self._channels:
            self._channels[topic] = self._register(topic, "foxglove.CompressedImage", COMPRESSED_IMAGE)
        taken_ns = t_ns + self._shift_ns
        content = {
            "timestamp": {"sec": taken_ns // 1_000_000_000, "nsec": taken_ns % 1_000_000_000},
            "frame_id": camera,
            "data": base64.b64encode(frame if isinstance(frame, bytes) else _jpeg(frame)).decode(),
            "format": "jpeg",
        }
        self._add(self._channels[topic], arrived_ns, msgspec.json.encode(content), t_ns, 0)

    def write_truth(self, now_ns: int, vehicle_ned_m: messages.Vec3, pad_ned_m: messages.Vec3) -> None:
        """Simulation only."""
        if TRUTH_TOPIC not in self._channels:
            self._channels[TRUTH_TOPIC] = self._register(TRUTH_TOPIC, "Truth", TRUTH)
        content = {"t_ns": now_ns, "vehicle_position_ned_m": vehicle_ned_m, "pad_position_ned_m": pad_ned_m}
        self._add(self._channels[TRUTH_TOPIC], now_ns, _ENCODER.encode(content), now_ns, 0)

    def _add(self, channel: int, arrived_ns: int, data: bytes, t_ns: int, sequence: int) -> None:
        log_ns = max(arrived_ns + self._shift_ns, 0)
        self._writer.add_message(
            channel, log_ns, data, publish_time=max(t_ns + self._shift_ns, 0), sequence=sequence & 0xFFFFFFFF
        )
        if self._flushed_ns is None:
            self._flushed_ns = log_ns
        if log_ns - self._flushed_ns >= self._flush_every_ns:
            self._flushed_ns = log_ns
            self._writer.flush()  # type: ignore[no-untyped-call]

    def close(self) -> None:
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._file.close()


def _jpeg(image: Image) -> bytes:
    written, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return data.tobytes() if written else b""


# -------------------------------------------------------------------------------------------------------------- reader


class Record(NamedTuple):
    """One message of an MCAP file. Times are the log's, ns."""

    topic: str
    log_ns: int
    publish_ns: int
    sequence: int
    data: bytes


@dataclass(slots=True)
class Damage:
    """What a reader stepped over. `complete` is False for a file that nobody closed."""

    chunks: int = 0
    bytes: int = 0
    messages: int = 0
    complete: bool = False

    def __str__(self) -> str:
        parts = [] if self.complete else ["not closed"]
        counts = (("chunks", self.chunks), ("bytes", self.bytes), ("messages", self.messages))
        parts += [f"{number} {name} unreadable" for name, number in counts if number]
        return ", ".join(parts) or "none"


class McapLogError(ValueError):
    """The file is no MCAP file at all."""


class McapLog:
    """An MCAP file in memory: ours in full, any other one as far as its records go."""

    def __init__(self, data: bytes) -> None:
        if len(data) < len(MAGIC) or not data.startswith(MAGIC):
            raise McapLogError("it does not begin as an MCAP file does")
        self.damage = Damage()
        self.metadata: dict[str, dict[str, str]] = {}
        self.schemas: dict[str, dict[str, Any]] = {}
        self._topics: dict[int, str] = {}
        self._chunks: list[bytes] = []
        self._walk(data)
        for number, topic in self.metadata.get(CHANNELS, {}).items():
            if number.isdigit():
                self._topics.setdefault(int(number), topic)

    @classmethod
    def read(cls, path: Path) -> McapLog:
        return cls(path.read_bytes())

    def _walk(self, data: bytes) -> None:
        """Record by record up to the end of the data section; where the chain breaks, on to what looks like a chunk."""
        self.damage.complete = data.endswith(MAGIC) and data[-_TAIL : -_TAIL + 1] == bytes((Opcode.FOOTER,))
        position = len(MAGIC)
        while position + _RECORD.size <= len(data):
            opcode, length = _RECORD.unpack_from(data, position)
            body = position + _RECORD.size
            if opcode == Opcode.DATA_END and length == 4:
                return
            if body + length <= len(data) and self._take(opcode, data[body : body + length]):
                position = body + length
                continue
            self.damage.chunks += opcode == Opcode.CHUNK
            after = _next_chunk(data, position + 1)
            self.damage.bytes += after - position
            position = after

    def _take(self, opcode: int, body: bytes) -> bool:
        """False for what is no record: a length that is wrong must not swallow the chunks behind it."""
        take = self._takers.get(opcode)
        try:
            return take is not None and take(opcode, body)
        except (ValueError, McapError, struct.error, msgspec.DecodeError):
            return False

    @property
    def _takers(self) -> dict[int, Callable[[int, bytes], bool]]:
        return {
            Opcode.SCHEMA: self._take_description,
            Opcode.CHANNEL: self._take_description,
            Opcode.METADATA: self._take_description,
            Opcode.CHUNK: self._take_chunk,
            Opcode.MESSAGE: self._take_message,
            Opcode.HEADER: lambda _, body: _is_header(body),
            Opcode.MESSAGE_INDEX: lambda _, body: len(body) == 6 + int.from_bytes(body[2:6], "little"),
            Opcode.ATTACHMENT: lambda _, body: True,
        }

    def _take_message(self, opcode: int, body: bytes) -> bool:
        """Of a file without chunks."""
        self._chunks.append(_RECORD.pack(opcode, len(body)) + body)
        return True

    def _take_chunk(self, _: int, body: bytes) -> bool:
        _, _, size, checksum = _CHUNK.unpack_from(body)
        packed_at = 40 + int.from_bytes(body[28:32], "little")
        packed = body[packed_at:]
        if int.from_bytes(body[packed_at - 8 : packed_at], "little") != len(packed):
            return False
        content = _unpacked(body[32 : packed_at - 8], packed, size)
        if len(content) != size or (checksum and zlib.crc32(content) != checksum):
            return False
        for opcode, inner in _records(content):
            if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self._take(opcode, inner)
        self._chunks.append(content)
        return True

    def _take_description(self, opcode: int, body: bytes) -> bool:
        stream = ReadDataStream(io.BytesIO(body))
        if opcode == Opcode.METADATA:
            found = mcap_records.Metadata.read(stream)
            self.metadata[found.name] = found.metadata
        elif opcode == Opcode.CHANNEL:
            channel = mcap_records.Channel.read(stream)
            self._topics[channel.id] = channel.topic
        else:
            schema = mcap_records.Schema.read(stream)
            if schema.encoding == "jsonschema":
                self.schemas[schema.name] = msgspec.json.decode(schema.data)
        return bool(stream.count == len(body))

    def records(self) -> Iterator[Record]:
        """All messages in the order in which they were written."""
        for content in self._chunks:
            for opcode, body in _records(content):
                if opcode == Opcode.MESSAGE and len(body) >= _MESSAGE.size:
                    channel, sequence, log_ns, publish_ns = _MESSAGE.unpack_from(body)
                    topic = self._topics.get(channel)
                    if topic is not None:
                        yield Record(topic, log_ns, publish_ns, sequence, body[_MESSAGE.size :])

    def counts(self) -> Counter[str]:
        return Counter(record.topic for record in self.records())

    @property
    def is_ours(self) -> bool:
        return METADATA in self.metadata

    @property
    def about(self) -> dict[str, str]:
        """The metadata record of our own logs; empty in others."""
        return self.metadata.get(METADATA, {})

    @property
    def log_minus_companion_ns(self) -> int:
        text = self.about.get("log_minus_companion_ns", "")
        return int(text) if text.removeprefix("-").isdecimal() and len(text) < 20 else 0

    def config(self) -> Config:
        """The configuration that flew; msgspec.ValidationError where this version does not know it any more."""
        return msgspec.json.decode(self.about.get("config", "{}"), type=Config)

    def entries(self) -> Iterator[LoggedEntry]:
        """The journal, decoded message by message. What cannot be decoded is counted in `damage.messages`."""
        shift_ns = self.log_minus_companion_ns
        for topic, log_ns, _, _, data in self.records():
            decoder = _DECODERS.get(topic)
            if decoder is None:
                continue
            try:
                place = _PLACE.decode(data)
                message = decoder.decode(data)
            except msgspec.DecodeError:
                self.damage.messages += 1
                continue
            yield LoggedEntry(place.sequence, log_ns - shift_ns, place.cause, message, data)

    def truths(self) -> Iterator[tuple[int, messages.Vec3, messages.Vec3]]:
        """(t_ns, vehicle, pad) of a simulation, NED, m; on the companion's clock like the messages."""
        for record in self.records():
            if record.topic == TRUTH_TOPIC:
                try:
                    truth = _TRUTH.decode(record.data)
                except msgspec.DecodeError:
                    self.damage.messages += 1
                    continue
                yield truth.t_ns, truth.vehicle_position_ned_m, truth.pad_position_ned_m

    def frames(self, camera: str | None = None) -> Iterator[tuple[str, int, bytes]]:
        """(camera, log time ns at which it was taken, JPEG) of the frames that were kept."""
        for record in self.records():
            name = record.topic.removeprefix(FRAME_TOPIC)
            if name != record.topic and camera in (None, name):
                try:
                    yield name, record.publish_ns, base64.b64decode(msgspec.json.decode(record.data)["data"])
                except (msgspec.DecodeError, KeyError, TypeError, ValueError):
                    self.damage.messages += 1


class LoggedEntry(NamedTuple):
    """A journal entry as read. `data` is its JSON, for comparing without decoding."""

    sequence: int
    arrived_ns: int
    cause: int | None
    message: Message
    data: bytes

    @property
    def is_input(self) -> bool:
        return type(self.message) in _INPUTS


class _Place(msgspec.Struct):
    sequence: int
    cause: int | None = None


class _Truth(msgspec.Struct):
    t_ns: int
    vehicle_position_ned_m: messages.Vec3
    pad_position_ned_m: messages.Vec3


_PLACE = msgspec.json.Decoder(_Place)
_TRUTH = msgspec.json.Decoder(_Truth)
_DECODERS: dict[str, msgspec.json.Decoder[Any]] = {
    topic: msgspec.json.Decoder(kind) for topic, kind in TYPE_OF_TOPIC.items()
}


def _records(content: bytes) -> Iterator[tuple[int, bytes]]:
    position, size = 0, len(content)
    while position + _RECORD.size <= size:
        opcode, length = _RECORD.unpack_from(content, position)
        position += _RECORD.size
        if position + length > size:
            return
        yield opcode, content[position : position + length]
        position += length


def _unpacked(compression: bytes, packed: bytes, size: int) -> bytes:
    if size > MAX_CHUNK_BYTES:
        raise ValueError("a chunk larger than any that is written")
    if compression == b"":
        return packed
    if compression == b"zstd":
        import zstandard

        try:
            return zstandard.ZstdDecompressor().decompressobj().decompress(packed) if _fits(packed) else b""
        except zstandard.ZstdError as error:
            raise ValueError(str(error)) from error
    if compression == b"lz4":
        import lz4.frame  # type: ignore[import-untyped]

        try:
            return bytes(lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=size))
        except (RuntimeError, EOFError) as error:
            raise ValueError(str(error)) from error
    raise ValueError(f"unknown compression {compression!r}")


def _fits(packed: bytes) -> bool:
    import zstandard

    return 0 <= zstandard.frame_content_size(packed) <= MAX_CHUNK_BYTES


def _is_header(body: bytes) -> bool:
    profile = int.from_bytes(body[:4], "little")
    library = int.from_bytes(body[4 + profile : 8 + profile], "little")
    return len(body) == 8 + profile + library


def _next_chunk(data: bytes, start: int) -> int:
    """Where the next chunk record begins; the end of the data where there is none."""
    for mark in _CHUNK_MARK.finditer(data, start):
        begin = mark.start() - _CHUNK.size - _RECORD.size
        if begin >= start and data[begin] == Opcode.CHUNK:
            return begin
    return len(data)


@runtime_checkable
class FrameSink(Protocol):
    """A sink that also wants the camera's frames: pixels, or the JPEG as it came. Must not block."""

    def frame(self, camera: str, arrived_ns: int, t_ns: int, content: Image | bytes) -> None: ...


def write_entries(path: Path, origin: LogOrigin, entries: Sequence[JournalEntry], *, small: bool = False) -> None:
    """A whole log at once: golden logs and tests."""
    writer = McapWriter(path, origin, small=small)
    for entry in entries:
        writer.write(entry)
    writer.close()
