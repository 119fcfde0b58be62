"""Telemetry logs: ours read by pymavlink, anybody's read by us, damaged ones too."""

from __future__ import annotations

import math
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pymavlink import mavutil
from pymavlink.dialects.v20 import development as mav

from companion.io.tlog import TlogWriter, read_frames
from companion.io.tlog_columns import TlogColumns, gather, numpy_gather
from companion.io.tlog_scan import scan_compiled, scan_plain
from companion.mavlink import codec, dialect

EPOCH_US = 1_767_225_600_000_000


def attitude(i: int) -> bytes:
    encoder = mav.MAVLink(None, 1, 1)
    encoder.seq = i % 256
    return bytes(mav.MAVLink_attitude_message(20 * i, 0.1 * i, 0.0, -0.5, 0.0, 0.0, 0.0).pack(encoder))


def heartbeat(i: int) -> bytes:
    return codec.encode(dialect.Heartbeat(0, 18, 8, 0, 4), i % 256, 1, 191)


def write_log(path: Path, count: int = 100) -> None:
    writer = TlogWriter(path)
    for i in range(count):
        writer.write(EPOCH_US + 20_000 * i, attitude(i) + heartbeat(i))
    writer.close()


def test_pymavlink_reads_what_was_written(tmp_path: Path) -> None:
    write_log(tmp_path / "flight.tlog")
    reader = mavutil.mavlink_connection(str(tmp_path / "flight.tlog"))
    messages = []
    while (message := reader.recv_match()) is not None:
        messages.append(message)
    reader.close()
    assert [m.get_type() for m in messages] == ["ATTITUDE", "HEARTBEAT"] * 100
    assert messages[20].roll == pytest.approx(1.0)
    assert messages[20]._timestamp == pytest.approx(EPOCH_US * 1e-6 + 0.2)
    assert messages[21].get_srcComponent() == 191


def test_frames_come_back_with_their_times(tmp_path: Path) -> None:
    write_log(tmp_path / "flight.tlog", 3)
    assert list(read_frames(tmp_path / "flight.tlog"))[2:4] == [
        (EPOCH_US + 20_000, attitude(1)),
        (EPOCH_US + 20_000, heartbeat(1)),
    ]


def test_garbage_from_the_link_stays_out_of_the_log(tmp_path: Path) -> None:
    writer = TlogWriter(tmp_path / "flight.tlog")
    writer.write(EPOCH_US, b"\xfd\x09 noise" + heartbeat(0) + attitude(0)[:20])
    writer.close()
    assert [frame for _, frame in read_frames(tmp_path / "flight.tlog")] == [heartbeat(0)]
    assert writer.bytes_skipped == 28


def test_a_log_is_readable_while_it_is_written(tmp_path: Path) -> None:
    writer = TlogWriter(tmp_path / "flight.tlog")
    for i in range(100):
        writer.write(EPOCH_US + 20_000 * i, attitude(i))
    readable = len(list(read_frames(tmp_path / "flight.tlog")))
    writer.close()
    assert readable >= 90  # at most the last 200 ms are missing if the process dies now


def test_a_killed_process_leaves_a_readable_log(tmp_path: Path) -> None:
    program = f"""
import os, signal
from pathlib import Path
from companion.io.tlog import TlogWriter
from companion.mavlink import codec, dialect
writer = TlogWriter(Path({str(tmp_path / "flight.tlog")!r}))
for i in range(100):
    writer.write({EPOCH_US} + 20_000 * i, codec.encode(dialect.Timesync(i + 1, 0), i, 1, 1))
os.kill(os.getpid(), signal.SIGKILL)
"""
    killed = subprocess.run([sys.executable, "-c", program], check=False)
    assert killed.returncode == -signal.SIGKILL
    log = TlogColumns.read(tmp_path / "flight.tlog")
    np.testing.assert_array_equal(log["TIMESYNC"]["tc1"], np.arange(log.frames) + 1)
    assert log.frames >= 90


def test_columns_have_the_fields_of_the_messages(tmp_path: Path) -> None:
    write_log(tmp_path / "flight.tlog")
    log = TlogColumns.read(tmp_path / "flight.tlog")
    attitudes = log["ATTITUDE"]
    assert set(log) == {"ATTITUDE", "HEARTBEAT"}
    assert attitudes.fields == ("time_boot_ms", "roll", "pitch", "yaw", "rollspeed", "pitchspeed", "yawspeed")
    np.testing.assert_allclose(attitudes["roll"], 0.1 * np.arange(100), rtol=1e-6)
    np.testing.assert_array_equal(attitudes.t_us, EPOCH_US + 20_000 * np.arange(100))
    np.testing.assert_array_equal(attitudes.sequence, np.arange(100) % 256)
    assert set(log["HEARTBEAT"].component) == {191}


def test_arrays_and_texts_keep_their_shape(tmp_path: Path) -> None:
    encoder = mav.MAVLink(None, 1, 1)
    target = mav.MAVLink_attitude_target_message(0, 0, [0.5, 0.25, 0.125, 1.0], 0.0, 0.0, 0.0, 0.75)
    text = mav.MAVLink_statustext_message(6, b"Takeoff detected", 0, 0)
    writer = TlogWriter(tmp_path / "flight.tlog")
    writer.write(EPOCH_US, bytes(target.pack(encoder)) + bytes(text.pack(encoder)))
    writer.close()
    log = TlogColumns.read(tmp_path / "flight.tlog")
    np.testing.assert_array_equal(log["ATTITUDE_TARGET"]["q"], [[0.5, 0.25, 0.125, 1.0]])
    assert log["STATUSTEXT"]["text"].tolist() == [b"Takeoff detected"]


def test_an_empty_log_has_nothing(tmp_path: Path) -> None:
    (tmp_path / "empty.tlog").write_bytes(b"")
    log = TlogColumns.read(tmp_path / "empty.tlog")
    assert (len(log), log.frames, log.bytes_skipped) == (0, 0, 0)


@pytest.mark.parametrize("cut", [1, 8, 9, 20, 50])
def test_a_cut_end_loses_the_last_message_only(tmp_path: Path, cut: int) -> None:
    write_log(tmp_path / "flight.tlog", 10)
    whole = (tmp_path / "flight.tlog").read_bytes()
    log = TlogColumns(whole[:-cut])
    lost = 1 if cut <= len(heartbeat(0)) + 8 else 2
    assert log.frames == 20 - lost


def test_a_damaged_place_loses_what_it_touches_only(tmp_path: Path) -> None:
    write_log(tmp_path / "flight.tlog", 100)
    data = bytearray((tmp_path / "flight.tlog").read_bytes())
    payload = data.index(attitude(25)) + 12
    data[payload : payload + 10] = b"\xfd" * 10
    log = TlogColumns(bytes(data))
    assert (log.count("ATTITUDE"), log.count("HEARTBEAT")) == (99, 100)
    assert log.bytes_skipped == len(attitude(25)) + 8


@pytest.mark.parametrize("seed", range(40))
def test_both_walks_find_the_same_frames_in_damaged_logs(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    write_log(tmp_path / "flight.tlog", 30)
    data = bytearray((tmp_path / "flight.tlog").read_bytes())
    for _ in range(int(rng.integers(1, 12))):
        where = int(rng.integers(len(data)))
        kind = rng.integers(3)
        if kind == 0:
            data[where] ^= 1 << int(rng.integers(8))
        elif kind == 1:
            del data[where : where + int(rng.integers(1, 40))]
        else:
            data[where:where] = rng.bytes(int(rng.integers(1, 40)))
    plain, fast = scan_plain(bytes(data)), scan_compiled(bytes(data))
    np.testing.assert_array_equal(plain.starts, fast.starts)
    np.testing.assert_array_equal(plain.message_ids, fast.message_ids)
    assert plain.bytes_skipped == fast.bytes_skipped
    assert len(plain.starts) >= 20


def test_both_ways_of_gathering_payloads_agree_at_the_ends_of_a_file() -> None:
    data = np.arange(1, 41, dtype=np.uint8)
    starts, lengths = np.array([0, 7, 38]), np.array([3, 12, 2])
    compiled_rows, numpy_rows = np.zeros((3, 8), np.uint8), np.zeros((3, 8), np.uint8)
    gather(data, starts, lengths, compiled_rows)
    numpy_gather(data, starts, lengths, numpy_rows)
    np.testing.assert_array_equal(compiled_rows, numpy_rows)
    np.testing.assert_array_equal(numpy_rows[:, 0], [1, 8, 39])
    np.testing.assert_array_equal(numpy_rows[0], [1, 2, 3, 0, 0, 0, 0, 0])


def test_noise_is_no_log() -> None:
    noise = np.random.default_rng(3).bytes(200_000)
    found = scan_plain(noise)
    assert found.bytes_skipped > 0.99 * len(noise)


def equal(ours: Any, theirs: Any) -> bool:
    """Same value; NaN equals NaN, text without the zeros behind it, char arrays as pymavlink shows them."""
    if isinstance(theirs, str):
        return bytes(ours).split(b"\0")[0].decode("ascii", "replace") == theirs
    if isinstance(theirs, list):
        return len(ours) == len(theirs) and all(map(equal, ours, theirs))
    return bool(ours == theirs) or (isinstance(theirs, float) and math.isnan(theirs) and math.isnan(ours))


@pytest.mark.parametrize("use_compiler", [False, True])
def test_recorded_px4_messages_agree_with_mavutil_one_by_one(use_compiler: bool) -> None:
    path = Path(__file__).parents[3] / "data" / "px4" / "takeoff_land.tlog"
    log = TlogColumns(path.read_bytes(), use_compiler=use_compiler)
    seen = dict.fromkeys(log, 0)
    reader, compared = mavutil.mavlink_connection(str(path)), 0
    while (message := reader.recv_msg()) is not None:
        name = message.get_type()
        if name.startswith("UNKNOWN"):
            continue
        columns, row = log[name], seen[name]
        seen[name] += 1
        compared += 1
        assert columns.t_us[row] == round(message._timestamp * 1e6)
        assert columns.sequence[row] == message.get_seq()
        assert all(equal(columns[field][row], getattr(message, field)) for field in message.get_fieldnames()), message
    reader.close()
    unknown_to_pymavlink = {"EVENT", "CURRENT_EVENT_SEQUENCE", "LINK_NODE_STATUS", "TIME_ESTIMATE_TO_TARGET"}
    assert compared == log.frames - sum(log.count(name) for name in unknown_to_pymavlink)
    assert compared > 3_000
