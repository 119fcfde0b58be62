"""flight.mcap: nothing is lost, others can read it, and damage costs only what is damaged."""

from __future__ import annotations

import dataclasses
import json
import math
import random
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from mcap.reader import make_reader

from companion.config import Config, Control
from companion.io import mcap_log
from companion.io.mcap_log import (
    FLUSH_EVERY_NS,
    MESSAGE_TYPES,
    LogOrigin,
    McapLog,
    McapLogError,
    McapWriter,
    schema_of,
    topic_of,
    write_entries,
)
from companion.messages import (
    AutopilotMode,
    CommandKind,
    Input,
    LandedState,
    MeasurementVerdict,
    Message,
    ObservationSource,
    PadEstimate,
    PadObservation,
    Tick,
    VehicleCommand,
    VehicleState,
    VehicleStatus,
    VelocitySetpoint,
)
from companion.onboard import JournalEntry

SHIFT_NS = 1_700_000_000_000_000_000
MS = 1_000_000
CONFIG = Config(control=Control(lead_s=0.123))
ORIGIN = LogOrigin(CONFIG, {"companion": "test"}, SHIFT_NS, {"seed": "7"})


def examples(t_ns: int) -> list[Message]:
    """Messages with everything that can go wrong in JSON: nested tuples, None, enums, the smallest float, minus zero."""
    return [
        VehicleState(t_ns, (0.1 + 0.2, -0.0, 5e-324), (1.0, 2.0, 3.0), (1.0, 0.0, 0.0, 0.0), (0.0, 1e300, 0.0), 3),
        VehicleStatus(t_ns, True, True, AutopilotMode.OFFBOARD, None, LandedState.IN_AIR, False, None, 0.5, None, 0.0),
        PadObservation(
            t_ns, "down", "aruco", (0.0, 0.1, 5.0), ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
            marker_ids=(45, 7), corners_px=((1.5, 2.5), (3.0, 4.0)),
        ),
        Tick(t_ns),
        PadEstimate(
            t_ns, (1.0, 2.0, 3.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.5, 0.0,
            tuple(tuple(float(6 * i + j) for j in range(6)) for i in range(6)), None, 0.25, "imm", (("cv", 0.75), ("ct", 0.25)),
        ),
        MeasurementVerdict(t_ns, ObservationSource.BEACON, True, "", 1.5, (0.1, 0.2)),
        VelocitySetpoint(t_ns, t_ns + 100 * MS, (1.0, 0.0, -1.0), 0.1),
        VehicleCommand(t_ns, CommandKind.DISARM, 'standing on the pad, "really" \u2713', ("thrust low", "range short")),
    ]  # fmt: skip


def journal(seconds: float = 2.0) -> list[JournalEntry]:
    entries: list[JournalEntry] = []
    inputs = Input.__args__
    cause = None
    for t_ns in range(0, round(seconds * 1e9), 20 * MS):
        for message in examples(t_ns):
            is_input = type(message) in inputs
            number = len(entries) + 1
            cause = number if is_input else cause
            entries.append(
                JournalEntry(number, t_ns + 3 * MS, "in" if is_input else "out", None if is_input else cause, message)
            )
    return entries


@pytest.fixture
def log_path(tmp_path: Path) -> Path:
    path = tmp_path / "flight.mcap"
    write_entries(path, ORIGIN, journal())
    return path


def test_every_message_comes_back_equal_in_its_place_and_with_its_times(log_path: Path) -> None:
    read = list(McapLog.read(log_path).entries())
    written = journal()
    assert [(e.sequence, e.arrived_ns, e.cause, e.message) for e in read] == [
        (e.sequence, e.arrived_ns, e.cause, e.message) for e in written
    ]
    assert [e.is_input for e in read] == [e.direction == "in" for e in written]


def test_floats_come_back_to_the_last_bit(log_path: Path) -> None:
    state = next(e.message for e in McapLog.read(log_path).entries() if isinstance(e.message, VehicleState))
    assert state.position_ned_m[0].hex() == (0.1 + 0.2).hex()
    assert math.copysign(1.0, state.position_ned_m[1]) == -1.0
    assert state.position_ned_m[2] == 5e-324


def test_configuration_versions_and_seed_stand_in_the_file(log_path: Path) -> None:
    log = McapLog.read(log_path)
    assert log.config() == CONFIG
    assert log.about["seed"] == "7"
    assert json.loads(log.about["versions"]) == {"companion": "test"}
    assert log.damage.complete


def test_the_reader_of_the_format_s_authors_reads_the_same(log_path: Path) -> None:
    with log_path.open("rb") as file:
        found = list(make_reader(file, validate_crcs=True).iter_messages(log_time_order=False))
    ours = list(McapLog.read(log_path).records())
    assert [(c.topic, m.log_time, m.publish_time, m.sequence, m.data) for _, c, m in found] == [
        (r.topic, r.log_ns, r.publish_ns, r.sequence, r.data) for r in ours
    ]
    schema, channel, message = found[0]
    assert schema is not None
    assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
    assert message.log_time == SHIFT_NS + 3 * MS
    assert message.publish_time == SHIFT_NS


@pytest.mark.parametrize("kind", MESSAGE_TYPES, ids=lambda kind: kind.__name__)
def test_the_schema_of_every_message_names_every_field_in_forms_that_viewers_read(kind: type) -> None:
    schema = schema_of(kind)
    nested = {name.strip("^$") for name in schema.get("patternProperties", {})}
    names = {field.name for field in dataclasses.fields(kind)}
    assert set(schema["properties"]) | nested == names | {"sequence", "cause"}
    for field in schema["properties"].values():
        assert field["type"] in ("boolean", "integer", "number", "string", "array")
        if field["type"] == "array":
            assert field["items"]["type"] in ("boolean", "integer", "number", "string")


def test_what_is_written_fits_its_schema(log_path: Path) -> None:
    assert misfits(log_path) == []


def misfits(path: Path) -> list[str]:
    """What a validator of JSON schemas that is not ours has against the messages of a log."""
    with path.open("rb") as file:
        found = list(make_reader(file, validate_crcs=True).iter_messages(log_time_order=False))
    validators = {
        schema.id: Draft202012Validator(json.loads(schema.data)) for schema, _, _ in found if schema is not None
    }
    errors = (
        (channel.topic, error)
        for schema, channel, message in found
        if schema is not None
        for error in validators[schema.id].iter_errors(json.loads(message.data))
    )
    return [f"{topic}: {error.json_path}: {error.message}" for topic, error in errors]


def test_a_schema_refuses_what_it_should() -> None:
    validator = Draft202012Validator(schema_of(VehicleState))
    assert not validator.is_valid({"sequence": 1, "cause": None, "t_ns": 1})
    Draft202012Validator.check_schema(schema_of(VehicleState))


def test_the_same_entries_give_the_same_bytes(tmp_path: Path, log_path: Path) -> None:
    again = tmp_path / "again.mcap"
    write_entries(again, ORIGIN, journal())
    assert again.read_bytes() == log_path.read_bytes()


def test_frames_are_kept_at_the_limited_rate_with_their_capture_times(tmp_path: Path) -> None:
    path = tmp_path / "frames.mcap"
    writer = McapWriter(path, ORIGIN)
    image = np.full((48, 64), 90, np.uint8)
    for i in range(60):
        writer.write_frame("down", i * 33 * MS, i * 33 * MS - 50 * MS, image if i % 2 else mcap_log._jpeg(image))
    writer.write_truth(10 * MS, (1.0, 2.0, 3.0), (4.0, 5.0, 6.0))
    writer.close()
    log = McapLog.read(path)
    frames = list(log.frames())
    assert len(frames) == 4
    assert frames[0][:2] == ("down", SHIFT_NS - 50 * MS)
    assert all(jpeg.startswith(b"\xff\xd8") for _, _, jpeg in frames)
    assert log.schemas["foxglove.CompressedImage"]["properties"]["data"]["contentEncoding"] == "base64"
    assert log.counts() == {"/camera/down": 4, "/truth": 1}


# -------------------------------------------------------------------------------------------------------------- damage


def test_a_killed_process_leaves_all_but_the_last_half_second(tmp_path: Path) -> None:
    path = tmp_path / "killed.mcap"
    program = (
        "import os, signal, sys; from pathlib import Path; sys.path.insert(0, sys.argv[2])\n"
        "from test_mcap_log import ORIGIN, journal; from companion.io.mcap_log import McapWriter\n"
        "writer = McapWriter(Path(sys.argv[1]), ORIGIN)\n"
        "for entry in journal(3.0): writer.write(entry)\n"
        "os.kill(os.getpid(), signal.SIGKILL)"
    )
    done = subprocess.run([sys.executable, "-c", program, str(path), str(Path(__file__).parent)], check=False)
    assert done.returncode == -signal.SIGKILL
    log = McapLog.read(path)
    written, read = journal(3.0), list(log.entries())
    assert not log.damage.complete
    assert [e.message for e in read] == [e.message for e in written[: len(read)]]
    assert written[-1].arrived_ns - read[-1].arrived_ns <= FLUSH_EVERY_NS
    assert log.config() == CONFIG


def test_a_log_cut_anywhere_gives_what_stands_before_the_cut(log_path: Path) -> None:
    data = log_path.read_bytes()
    written = [e.message for e in journal()]
    rng = random.Random(3)
    counts = []
    for cut in sorted(rng.sample(range(8, len(data)), 60)):
        read = [e.message for e in McapLog(data[:cut]).entries()]
        assert read == written[: len(read)]
        counts.append(len(read))
    assert counts == sorted(counts)
    assert counts[-1] > 0.7 * len(written)


def test_flipped_bits_cost_at_most_the_chunk_they_are_in(log_path: Path) -> None:
    data = log_path.read_bytes()
    written = {e.sequence: e.message for e in journal()}
    rng = random.Random(5)
    for _ in range(200):
        damaged = bytearray(data)
        damaged[rng.randrange(8, len(data))] ^= 1 << rng.randrange(8)
        read = list(McapLog(bytes(damaged)).entries())
        assert all(written[e.sequence] == e.message for e in read)
        assert len(read) >= 0.65 * len(written), "one chunk of four, and never more"


def test_a_lost_chunk_is_counted(log_path: Path) -> None:
    data = bytearray(log_path.read_bytes())
    at = data.index(b"\x04\x00\x00\x00zstd") + 60
    data[at] ^= 0xFF
    damage = McapLog(bytes(data)).damage
    assert damage.chunks == 1
    assert "1 chunks unreadable" in str(damage)


@pytest.mark.parametrize("content", [b"", b"\x89MCAP", b"not a log at all", b"\x00" * 1000])
def test_what_is_no_mcap_file_is_refused_with_a_reason(content: bytes) -> None:
    with pytest.raises(McapLogError, match="begin as an MCAP"):
        McapLog(content)


def test_random_bytes_behind_the_magic_hang_nobody() -> None:
    rng = random.Random(1)
    for _ in range(50):
        assert list(McapLog(mcap_log.MAGIC + rng.randbytes(5000)).entries()) == []


def test_topics_are_named_after_their_messages() -> None:
    assert topic_of(PadEstimate) == "/pad_estimate"
    assert len({topic_of(kind) for kind in MESSAGE_TYPES}) == len(MESSAGE_TYPES)
