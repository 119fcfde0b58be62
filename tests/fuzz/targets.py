"""What is fuzzed: a function that takes bytes and must come back, whatever they are. An exception that is not the target's own
named error is a finding; so is a wrong answer that a target can see by itself."""

from __future__ import annotations

import os
import random
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path

from mutation import mutated

from companion.config import Config, ConfigError, Link, load
from companion.io.log_commands import info
from companion.io.log_inputs import tlog_inputs
from companion.io.log_tables import LogError
from companion.io.tlog import read_frames
from companion.io.tlog_columns import TlogColumns
from companion.mavlink.session import Session
from companion.mavlink.signing import Signing
from companion.messages import CommandKind, VehicleCommand, VehicleState

REPO = Path(__file__).resolve().parents[2]
PX4 = REPO / "tests" / "data" / "px4"
SHARED_MEMORY = Path("/dev/shm")


@dataclass(frozen=True)
class Target:
    """`make` builds one input from the seeds, `run` feeds it."""

    name: str
    seeds: Callable[[], Sequence[bytes]]
    make: Callable[[Sequence[bytes], random.Random], bytes]
    run: Callable[[bytes], None]


def tlog_seeds() -> list[bytes]:
    """Pieces of recorded logs of a real PX4."""
    pieces = []
    for path in sorted(PX4.glob("*.tlog")):
        data = path.read_bytes()
        pieces += [data[at : at + 3000] for at in range(0, min(len(data), 90_000), 3000)]
    return pieces


def datagram_seeds() -> list[bytes]:
    return [frame for path in sorted(PX4.glob("*.tlog")) for _, frame in list(read_frames(path))[:400]]


def config_seeds() -> list[bytes]:
    files = [*(REPO / "configs").glob("pads/*.toml"), *(REPO / "configs").glob("peers/*.toml")]
    return [path.read_bytes() for path in sorted(files)] + [WHOLE]


WHOLE = b"""
[link]
url = "udpin://0.0.0.0:14540"
state_rate_hz = 50.0
[cameras.down]
mount_deg = [0.0, 0.0, 0.0]
distortion = [0.1, 0.2]
[mission]
disarm = "auto"
follow_height_m = 5.0
[safety]
[[safety.zones]]
kind = "no_fly"
center_m = [1.0, 2.0]
radius_m = 3.0
[mqtt]
prefix = "companion"
accept = ["command"]
[guidance]
form = "px4"
"""


def damaged(seeds: Sequence[bytes], rng: random.Random) -> bytes:
    return mutated(rng.choice(seeds), rng, seeds)


def conversation(seeds: Sequence[bytes], rng: random.Random) -> bytes:
    """Good frames with bad ones among them; the first byte chooses the kind of session."""
    frames = [rng.choice(seeds) for _ in range(rng.randint(1, 30))]
    spoilt = [mutated(frame, rng, seeds) if rng.random() < 0.4 else frame for frame in frames]
    return bytes((rng.randrange(256),)) + b"".join(spoilt)


def run_session(data: bytes) -> None:
    """In datagrams or as a stream, with or without signing; the session must stay usable and its memory small."""
    kind, data = data[0], data[1:]
    url = "serial:///dev/null:1" if kind & 1 else "udpin://0.0.0.0:14540"
    signing = Signing(bytes(range(32)), unix_ns=1_700_000_000 * 10**9, now_ns=0) if kind & 2 else None
    session = Session(Link(url=url), 0, signing=signing)
    step, now_ns = 1 + kind, 0
    for at in range(0, len(data), step):
        now_ns += 10_000_000
        check(session.receive_datagram(data[at : at + step], now_ns))
        check(session.handle_timer(now_ns))
        if at == 0:
            session.send_command(VehicleCommand(now_ns, CommandKind.HOLD, "fuzz"), now_ns)
        sent = session.datagrams_to_send()
        assert sum(map(len, sent)) < 100_000
        due_ns = session.next_timer_ns()
        assert due_ns is not None


def check(messages: Sequence[object]) -> None:
    """No state that is not a number may come through."""
    for message in messages:
        if isinstance(message, VehicleState):
            assert all(map(isfinite, (*message.position_ned_m, *message.velocity_ned_m_s, *message.q_ned_frd)))


def run_tlog(data: bytes) -> None:
    """Scanned, in columns, through a session, and as `log info` sees it. All ways count the same frames."""
    with _file(".tlog", data) as path:
        frames = list(read_frames(path))
        columns = TlogColumns(data, use_compiler=False)
        assert sum(len(table) for table in columns.values()) <= len(frames)
        for table in columns.values():
            assert len(table.t_us) == len(table.values)
        list(tlog_inputs(path, Link()).messages)
        try:
            found = info(path)
        except LogError:
            return
        assert found["messages"] <= len(frames)


def run_config(data: bytes) -> None:
    """A configuration, or a ConfigError that names the file."""
    with _file(".toml", data) as path:
        try:
            assert isinstance(load([path]), Config)
        except ConfigError as error:
            assert str(error)
            assert len(str(error)) < 20_000 + 10 * len(data)


class _file:
    """The bytes as a file in memory, for readers that want one."""

    def __init__(self, suffix: str, data: bytes) -> None:
        folder = SHARED_MEMORY if os.access(SHARED_MEMORY, os.W_OK) else Path(tempfile.gettempdir())
        self._path = folder / f"companion-fuzz-{os.getpid()}{suffix}"
        self._data = data

    def __enter__(self) -> Path:
        self._path.write_bytes(self._data)
        return self._path

    def __exit__(self, *error: object) -> None:
        self._path.unlink(missing_ok=True)


TARGETS = {
    target.name: target
    for target in (
        Target("session", datagram_seeds, conversation, run_session),
        Target("tlog", tlog_seeds, damaged, run_tlog),
        Target("config", config_seeds, damaged, run_config),
    )
}
