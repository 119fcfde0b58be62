"""Replay: nothing differs where nothing changed, and what changed is named; anybody's log goes through."""

from __future__ import annotations

import json
import random
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner, Result

from companion import golden
from companion.cli import app
from companion.config import ConfigError
from companion.io.frame_folder import FramesError, recorded_frames
from companion.io.mcap_log import LogOrigin as Origin
from companion.io.mcap_log import McapLog, McapWriter, write_entries
from companion.messages import Health, PadEstimate, VehicleState
from companion.onboard import JournalEntry
from companion.pipeline import Pipeline
from companion.replay import RecordedSetpoint, ReplayError, ReplayOptions, replay, setpoint_differences

ROOT = Path(__file__).parents[3]
FLIGHT = ROOT / "tests" / "replay" / "line.mcap"
PX4 = ROOT / "tests" / "data" / "px4"
SECONDS = 3.0


@cache
def flown() -> tuple[Origin, list[JournalEntry]]:
    """The first seconds of a recorded flight with what this version makes of them."""
    log = McapLog.read(FLIGHT)
    origin = Origin(log.config(), {"companion": "test"}, log.log_minus_companion_ns)
    pipeline = Pipeline(origin.config)
    entries: list[JournalEntry] = []
    first_ns: int | None = None
    for logged in log.entries():
        first_ns = logged.arrived_ns if first_ns is None else first_ns
        if logged.arrived_ns - first_ns > SECONDS * 1e9:
            break
        cause = len(entries) + 1
        entries.append(JournalEntry(cause, logged.arrived_ns, "in", None, logged.message))
        for output in pipeline.handle(logged.message):  # type: ignore[arg-type]
            entries.append(JournalEntry(len(entries) + 1, logged.arrived_ns, "out", cause, output))
    return origin, entries


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "flight.mcap"
    write_entries(path, *flown())
    return path


def invoked(*arguments: object) -> Result:
    return CliRunner().invoke(app, ["replay", *map(str, arguments)])


# --------------------------------------------------------------------------------------------------------------- exact


def test_the_same_inputs_give_the_same_outputs_to_the_last_bit(log: Path) -> None:
    result = replay(log, ReplayOptions())
    assert (result.mode, result.differing, result.difference) == ("exact", 0, None)
    assert result.compared == sum(entry.direction == "out" for entry in flown()[1])
    assert result.compared > 250


def test_the_first_differing_field_is_named_with_its_place_and_both_values(tmp_path: Path) -> None:
    origin, entries = flown()
    at = next(i for i, e in enumerate(entries) if isinstance(e.message, PadEstimate) and e.sequence > 500)
    estimate = entries[at].message
    assert isinstance(estimate, PadEstimate)
    rows = [list(row) for row in estimate.covariance]
    rows[2][4] = np.nextafter(rows[2][4], 1.0).item()
    changed = PadEstimate(
        **{
            **{name: getattr(estimate, name) for name in PadEstimate.__slots__},
            "covariance": tuple(map(tuple, rows)),
        }
    )
    path = tmp_path / "changed.mcap"
    tampered = JournalEntry(entries[at].sequence, entries[at].arrived_ns, "out", entries[at].cause, changed)
    write_entries(path, origin, [*entries[:at], tampered, *entries[at + 1 :]])
    result = replay(path, ReplayOptions())
    assert result.differing == 1
    assert result.difference is not None
    assert result.difference.sequence == entries[at].sequence
    assert (result.difference.message, result.difference.field) == ("PadEstimate", "covariance[2][4]")
    assert result.difference.expected == rows[2][4]
    assert result.difference.got == estimate.covariance[2][4]
    told = invoked(path)
    assert told.exit_code == 1
    assert f"sequence {entries[at].sequence}: PadEstimate.covariance[2][4]" in told.stdout


def test_an_input_that_is_missing_from_the_log_is_noticed(tmp_path: Path) -> None:
    origin, entries = flown()
    at = next(i for i, e in enumerate(entries) if isinstance(e.message, VehicleState) and e.sequence > 300)
    path = tmp_path / "hole.mcap"
    write_entries(path, origin, [*entries[:at], *entries[at + 1 :]])
    assert replay(path, ReplayOptions()).differing > 0


def test_what_the_shell_itself_reported_is_no_output_of_the_pipeline(tmp_path: Path) -> None:
    origin, entries = flown()
    health = JournalEntry(0, entries[50].arrived_ns, "out", None, Health(entries[50].arrived_ns, "camera", 1, "late"))
    path = tmp_path / "health.mcap"
    write_entries(path, origin, [*entries[:50], health, *entries[50:]])
    assert replay(path, ReplayOptions()).differing == 0


def test_no_difference_is_said_in_so_many_words(log: Path) -> None:
    told = invoked(log)
    assert told.exit_code == 0
    assert "no difference in" in told.stdout


# ------------------------------------------------------------------------------------------------------------- what-if


def test_a_changed_setting_is_a_what_if_with_both_figures(log: Path) -> None:
    result = replay(log, ReplayOptions(settings={"estimation.beacon_noise_sigma_m": 3.0}))
    assert result.mode == "what-if"
    assert result.figures["pad_estimates"] == result.recorded["pad_estimates"]
    assert result.figures["pad_sigma_mean_m"] > 1.05 * result.recorded["pad_sigma_mean_m"]


def test_a_setting_that_does_not_exist_is_refused_with_its_name(log: Path) -> None:
    with pytest.raises(ConfigError, match="leed_s"):
        replay(log, ReplayOptions(settings={"control.leed_s": 1.0}))
    assert invoked(log, "--set", "control.leed_s=1").exit_code == 2


def test_frames_replace_the_recorded_detections(log: Path, tmp_path: Path) -> None:
    frames = tmp_path / "frames"
    frames.mkdir()
    for i in range(5):
        cv2.imwrite(str(frames / f"{i}.png"), np.full((480, 752), 100, np.uint8))
    (frames / "broken.png").write_bytes(b"no picture")
    rows = [f"{i}.png,{0.2 * i}" for i in range(5)] + ["broken.png,1.1", "missing.png,1.2", "nonsense", "0.png,nan"]
    (frames / "times.csv").write_text("file,t_s\n" + "\n".join(rows))
    result = replay(log, ReplayOptions(frames=recorded_frames(frames)))
    assert result.figures["pad_not_seen"] == 7
    assert result.recorded["pad_not_seen"] > 50


def test_the_frames_inside_a_log_can_be_looked_at_again(tmp_path: Path) -> None:
    origin, entries = flown()
    path = tmp_path / "with_frames.mcap"
    writer = McapWriter(path, origin)
    for entry in entries:
        writer.write(entry)
        writer.write_frame("down", entry.arrived_ns, entry.arrived_ns, np.full((480, 752), 90, np.uint8))
    writer.close()
    frames = recorded_frames(path)
    assert len(frames) == 6
    assert frames[1].t_s - frames[0].t_s == pytest.approx(0.5, abs=0.03)
    out = tmp_path / "frames"
    done = CliRunner().invoke(app, ["log", "export", str(path), "--frames", "--out", str(out)])
    assert "6 frames" in done.stdout
    assert [f.t_s for f in recorded_frames(out)] == pytest.approx([f.t_s for f in frames], abs=1e-8)


def test_a_folder_without_frames_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FramesError, match="no frames"):
        recorded_frames(tmp_path)


def test_setpoints_are_paired_by_time_and_their_distance_is_a_velocity() -> None:
    sent = [RecordedSetpoint(t * 20_000_000, (1.0, 0.0, 0.0)) for t in range(10)]
    ours = [(t * 20_000_000 + 3_000_000, (1.0, 0.3, 0.4)) for t in range(5)]
    found = setpoint_differences(sent, ours)
    assert found["setpoints_paired"] == 7
    assert found["setpoint_difference_rms_m_s"] == pytest.approx(0.5)
    assert found["setpoint_difference_max_m_s"] == pytest.approx(0.5)


# ----------------------------------------------------------------------------------------------------- anybody's logs


@pytest.mark.parametrize("name", ["takeoff_land", "offboard_loss", "refused_modes"])
def test_recorded_logs_of_a_real_px4_go_through(name: str) -> None:
    result = replay(PX4 / f"{name}.tlog", ReplayOptions(pad_ned_m=(10.0, 0.0, 0.0)))
    assert result.mode == "state in"
    assert result.damage == "none"
    assert result.figures["vehicle_states"] > 100
    assert result.figures["beacon_accepted"] > 0.9 * 5.0 * result.log_s
    assert result.figures["pad_n_mean_m"] == pytest.approx(10.0, abs=1.0)


def test_a_flipped_stamp_does_not_make_the_replay_tick_through_centuries(tmp_path: Path) -> None:
    data = (PX4 / "refused_modes.tlog").read_bytes()
    rng = random.Random(2)
    plain = replay(PX4 / "refused_modes.tlog", ReplayOptions())
    for i in range(5):
        damaged = bytearray(data)
        for _ in range(40):
            damaged[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        path = tmp_path / f"{i}.tlog"
        path.write_bytes(bytes(damaged))
        result = replay(path, ReplayOptions())
        assert result.damage != "none"
        assert result.log_s == pytest.approx(plain.log_s, abs=5.0)
        assert result.figures["vehicle_states"] > 0.8 * plain.figures["vehicle_states"]


def test_a_cut_log_is_no_error(tmp_path: Path) -> None:
    data = (PX4 / "refused_modes.tlog").read_bytes()
    for length in (0, 1, 7, 30, len(data) // 2):
        path = tmp_path / "cut.tlog"
        path.write_bytes(data[:length])
        replay(path, ReplayOptions())


@pytest.mark.parametrize(
    ("name", "content"),
    [("a.mcap", b"nothing"), ("a.ulg", b"nothing at all"), ("a.txt", b"text"), ("missing.tlog", None)],
)
def test_what_cannot_be_replayed_is_refused_with_a_reason(name: str, content: bytes | None, tmp_path: Path) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ReplayError, match=name):
        replay(path, ReplayOptions())
    assert invoked(path).exit_code == 2


# -------------------------------------------------------------------------------------------------------------- golden


def test_a_golden_file_is_written_agrees_and_then_says_what_differs(log: Path, tmp_path: Path) -> None:
    file = tmp_path / "golden.json"
    assert invoked(log, "--check", file).exit_code == 2, "there is none yet"
    assert invoked(log, "--check", file, "--update").exit_code == 0
    assert invoked(log, "--check", file).exit_code == 0
    content: dict[str, Any] = json.loads(file.read_text())
    content["figures"]["pad_estimates"] = {"value": 7, "tolerance": 0}
    content["figures"]["pad_n_mean_m"]["tolerance"] = 123.0
    content["figures"]["unheard_of"] = {"value": 1, "tolerance": 0}
    file.write_text(json.dumps(content))
    told = invoked(log, "--check", file)
    assert told.exit_code == 1
    assert "pad_estimates: expected 7 +- 0, got" in told.stdout
    assert "unheard_of: expected 1, is missing" in told.stdout
    updated = invoked(log, "--check", file, "--update")
    assert updated.exit_code == 0
    assert "pad_estimates: 7 -> " in updated.stdout
    assert "unheard_of: gone" in updated.stdout
    assert golden.read(file).figures["pad_n_mean_m"].tolerance == 123.0, "a tolerance set by hand stays"


@pytest.mark.parametrize("content", ["", "[]", "{", '{"log": 3}', '{"log": "a", "figures": {"x": 1}}'])
def test_a_broken_golden_file_is_refused(content: str, log: Path, tmp_path: Path) -> None:
    file = tmp_path / "golden.json"
    file.write_text(content)
    told = invoked(log, "--check", file)
    assert told.exit_code == 2
    assert "golden.json" in told.stderr


def test_not_a_number_never_agrees() -> None:
    expected = golden.Golden("a", {"x_m": golden.GoldenFigure(1.0, 0.1)})
    assert golden.differences(expected, {"x_m": float("nan")})
    assert not golden.differences(expected, {"x_m": 1.05})


def test_json_holds_the_whole_answer(log: Path) -> None:
    content = json.loads(invoked(log, "--json").stdout)
    assert content["differing"] == 0
    assert content["first_difference"] is None
    assert content["figures"]["pad_estimates"] > 100
