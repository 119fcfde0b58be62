"""Damage, as wires, disks and people do it: flips, cuts, doublings, swaps, foreign pieces. Deterministic for a generator."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence

TOKENS = (
    b"=",
    b"[",
    b"]",
    b'"',
    b"\n",
    b"#",
    b"nan",
    b"inf",
    b"-1",
    b"1e999",
    b"true",
    b"0x",
    b"{}",
    b"'''",
    b"\xff",
    b"\0",
)
EDGES = (
    b"\x00",
    b"\xff",
    b"\xfd",
    b"\xfe",
    b"\x7f",
    b"\x80",
    b"\x00\x00\x00\x00",
    b"\xff\xff\xff\xff",
    b"\xfd\xff\x01",
)


def mutated(data: bytes, rng: random.Random, spare: Sequence[bytes]) -> bytes:
    """`data` after one to eight random damages; `spare` gives foreign pieces."""
    for _ in range(rng.randint(1, 8)):
        data = rng.choice(DAMAGES)(data, rng, spare)
    return data


def _place(data: bytes, rng: random.Random) -> int:
    return rng.randrange(len(data) + 1)


def _flip(data: bytes, rng: random.Random, spare: Sequence[bytes]) -> bytes:
    if not data:
        return data
    at = rng.randrange(len(data))
    return data[:at] + bytes((data[at] ^ 1 << rng.randrange(8),)) + data[at + 1 :]


def _cut(data: bytes, rng: random.Random, spare: Sequence[bytes]) -> bytes:
    return data[: _place(data, rng)]


def _behead(data: bytes, rng: random.Random, spare: Sequence[bytes]) -> bytes:
    return data[_place(data, rng) :]


def _drop(data: bytes, rng: random.Random, spare: Sequence[bytes]) -> bytes:
    at = _place(data, rng)
    return data[:at] + data[at + rng.randint(1, 64) :]


def _double(data: bytes, rng: random.Random, spare: Sequence[bytes]) -> bytes:
    at = _place(data, rng)
    piece = data[at : at + rng.randint(1, 256)]
    return data[:at] + piece * rng.randint(2, 5) + data[at:]


def _swap(data: bytes, rng: random.Random, spare: Sequence[bytes]) -> bytes:
    a, b = sorted((_place(data, rng), _place(data, rng)))
    return data[b:] + data[a:b] + data[:a]


def _insert(data: bytes, rng: random.Random, spare: Sequence[bytes]) -> bytes:
    at = _place(data, rng)
    foreign = rng.choice((*EDGES, *TOKENS, rng.randbytes(rng.randint(1, 40)), rng.choice(spare) if spare else b""))
    return data[:at] + foreign[:2000] + data[at:]


def _overwrite(data: bytes, rng: random.Random, spare: Sequence[bytes]) -> bytes:
    at = _place(data, rng)
    edge = rng.choice((*EDGES, *TOKENS))
    return data[:at] + edge + data[at + len(edge) :]


Damage = Callable[[bytes, random.Random, Sequence[bytes]], bytes]
DAMAGES: tuple[Damage, ...] = (_flip, _flip, _cut, _behead, _drop, _double, _swap, _insert, _overwrite)
