"""Where the frames of a .tlog begin, with every checksum tested.

The walk is the only part of reading a log that cannot be vectorised: each frame says where the next one is. It is written
twice, with one meaning that a test compares: as a kernel that numba compiles (the extra `fast`) with its own CRC table,
and in Python around the compiled CRC of fastcrc. After a damaged place both look for the next stamp and frame byte by byte.
A message id that nobody knows has no checksum: it counts if another frame, or the end of the file, follows it exactly.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from fastcrc.crc16 import mcrf4xx

from companion.mavlink.codec import full_dialect

STAMP = 8
UNKNOWN = -1
COMPILER_PAYS_BYTES = 32_000_000
Integers = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Scan:
    """`starts` are indices of frames' magic bytes, ascending; `message_ids` belong to them."""

    starts: Integers
    message_ids: Integers
    bytes_skipped: int


def scan(data: bytes) -> Scan:
    """All frames of a log, by the walk that is faster for its size."""
    return scan_compiled(data) if compiler_pays(data) else scan_plain(data)


def compiler_pays(data: bytes) -> bool:
    """True where the extra `fast` is installed and loading its machine code (0.5 s) costs less than it saves."""
    return len(data) >= COMPILER_PAYS_BYTES and has_compiler()


def has_compiler() -> bool:
    """True where the extra `fast` is installed."""
    return _numba() is not None


@functools.cache
def _numba() -> Any | None:
    """The compiler, None without the extra `fast`."""
    try:
        import numba
    except ImportError:
        return None
    return numba


@functools.cache
def crc_seeds() -> npt.NDArray[np.int16]:
    """CRC seed by message id, -1 where no dialect knows the id."""
    dialect = full_dialect()
    seeds = np.full(max(dialect) + 2, UNKNOWN, np.int16)
    for message_id, definition in dialect.items():
        seeds[message_id] = definition.crc_extra
    return seeds


# ------------------------------------------------------------------------------------------------------- plain Python


def scan_plain(data: bytes) -> Scan:
    """The walk in Python: about 1 us a frame."""
    seeds = [bytes((seed,)) if seed >= 0 else None for seed in crc_seeds().tolist()]
    starts: list[int] = []
    ids: list[int] = []
    position, used, size = 0, 0, len(data)
    while position + STAMP + 8 <= size:
        start = position + STAMP
        magic = data[start]
        if magic == 0xFD:
            body_end = start + 10 + data[start + 1]
            end = body_end + (15 if data[start + 2] & 1 else 2)
            message_id = int.from_bytes(data[start + 7 : start + 10], "little")
        elif magic == 0xFE:
            body_end = start + 6 + data[start + 1]
            end = body_end + 2
            message_id = data[start + 5]
        else:
            position += 1
            continue
        if end > size or not _plain_is_frame(data, start, body_end, end, seeds, message_id):
            position += 1
            continue
        starts.append(start)
        ids.append(message_id)
        used += end - position
        position = end
    return Scan(np.array(starts, np.int64), np.array(ids, np.int64), size - used)


def _plain_is_frame(
    data: bytes, start: int, body_end: int, end: int, seeds: list[bytes | None], message_id: int
) -> bool:
    seed = seeds[message_id] if message_id < len(seeds) else None
    if seed is None:
        return end == len(data) or (end + STAMP < len(data) and data[end + STAMP] in (0xFD, 0xFE))
    checksum: int = mcrf4xx(data[start + 1 : body_end] + seed)
    return checksum == data[body_end] | data[body_end + 1] << 8


# ----------------------------------------------------------------------------------------------------------- compiled


def scan_compiled(data: bytes) -> Scan:
    """The walk as machine code: about 0.1 us a frame. Without numba the same statements run, slowly."""
    buffer = np.frombuffer(data, np.uint8)
    most = len(data) // (STAMP + 8) + 1
    starts, ids = np.empty(most, np.int64), np.empty(most, np.int64)
    count, used = _kernel()(buffer, crc_seeds(), _crc_tables(), starts, ids)
    return Scan(starts[:count].copy(), ids[:count].copy(), len(data) - used)


@functools.cache
def _kernel() -> Callable[..., Any]:
    return compiled(walk)


def compiled(kernel: Callable[..., Any]) -> Callable[..., Any]:
    """Machine code where the extra `fast` is there, else the same statements."""
    compiler = _numba()
    return kernel if compiler is None else compiler.njit(cache=True)(kernel)


@functools.cache
def _crc_tables() -> Integers:
    """CRC-16/MCRF4XX four bytes at a time: row k is the effect of a byte that k more bytes follow."""
    tables = np.zeros((4, 256), np.int64)
    for byte in range(256):
        value = byte
        for _ in range(8):
            value = value >> 1 ^ (0x8408 if value & 1 else 0)
        tables[0, byte] = value
    for k in range(1, 4):
        before = tables[k - 1]
        tables[k] = before >> 8 ^ tables[0, before & 0xFF]
    return tables


def walk(
    data: npt.NDArray[np.uint8],
    seeds: npt.NDArray[np.int16],
    tables: Integers,
    starts: Integers,
    ids: Integers,
) -> tuple[int, int]:
    """Fills `starts` and `ids`; returns (frames, bytes in frames and their stamps). One function: numba inlines nothing else."""
    size, position, count, used = len(data), 0, 0, 0
    while position + 16 <= size:
        start = position + 8
        if data[start] == 0xFD:
            body_end = start + 10 + int(data[start + 1])
            end = body_end + (15 if data[start + 2] & 1 else 2)
            message_id = int(data[start + 7]) | int(data[start + 8]) << 8 | int(data[start + 9]) << 16
        elif data[start] == 0xFE:
            body_end = start + 6 + int(data[start + 1])
            end = body_end + 2
            message_id = int(data[start + 5])
        else:
            position += 1
            continue
        valid = end <= size
        if valid:
            seed = int(seeds[message_id]) if message_id < len(seeds) else -1
            if seed < 0:
                valid = end == size or (end + 8 < size and (data[end + 8] == 0xFD or data[end + 8] == 0xFE))
            else:
                crc, i = 0xFFFF, start + 1
                while i + 4 <= body_end:
                    low, high = (crc ^ int(data[i])) & 0xFF, (crc >> 8 ^ int(data[i + 1])) & 0xFF
                    crc = tables[3, low] ^ tables[2, high]
                    crc ^= tables[1, data[i + 2]] ^ tables[0, data[i + 3]]
                    i += 4
                while i < body_end:
                    crc = crc >> 8 ^ tables[0, (crc ^ int(data[i])) & 0xFF]
                    i += 1
                crc = crc >> 8 ^ tables[0, (crc ^ seed) & 0xFF]
                valid = crc == int(data[body_end]) | int(data[body_end + 1]) << 8
        if not valid:
            position += 1
            continue
        starts[count], ids[count] = start, message_id
        count += 1
        used += end - position
        position = end
    return count, used
