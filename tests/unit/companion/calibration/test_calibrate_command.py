"""`companion calibrate` as typed: from a board's sheet to a lens in the configuration, from a recording to a delay."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from board_views import LENS, board_texture, poses, rendered, waved_board
from pymavlink.dialects.v20 import common as mavlink
from typer.testing import CliRunner, Result

from companion.calibration.board import Board
from companion.calibration.collect import Collection
from companion.calibration.gyro_log import filter_lag_s
from companion.cli import app
from companion.config import load
from companion.io.camera_info import read
from companion.io.tlog import TlogWriter


def invoked(*arguments: str) -> Result:
    return CliRunner().invoke(app, ["calibrate", *arguments], env={"COLUMNS": "200"})


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("pictures")
    for index, picture in enumerate(waved_board()):
        cv2.imwrite(str(folder / f"view{index:02}.png"), picture)
    (folder / "broken.png").write_bytes(b"no picture")
    cv2.imwrite(str(folder / "empty.png"), np.full((320, 480), 90, np.uint8))
    return folder


def test_pictures_of_a_board_become_a_lens_that_the_configuration_takes(pictures: Path, tmp_path: Path) -> None:
    out = tmp_path / "down.yaml"
    result = invoked("lens", f"folder://{pictures}", "--out", str(out))
    assert result.exit_code == 0, result.output
    lens = read(out)
    assert lens.fx_px == pytest.approx(300.0, rel=0.005)
    assert (lens.cx_px, lens.cy_px) == pytest.approx((236.0, 162.0), abs=2.0)
    assert load([], {"cameras.down.calibration_file": str(out)}).cameras["down"].fx_px == lens.fx_px
    for name in ("reprojection error", "held-out views", "coverage", "views", "tilted views"):
        assert name in result.output


def test_too_few_pictures_are_refused_and_nothing_is_written(pictures: Path, tmp_path: Path) -> None:
    few = tmp_path / "few"
    few.mkdir()
    for path in sorted(pictures.glob("view0[0-2].png")):
        (few / path.name).write_bytes(path.read_bytes())
    result = invoked("lens", f"folder://{few}", "--out", str(tmp_path / "down.yaml"))
    assert result.exit_code == 2
    assert "not enough" in result.output
    assert not (tmp_path / "down.yaml").exists()


def test_a_folder_without_a_picture_and_a_camera_that_is_not_there_are_named(tmp_path: Path) -> None:
    assert "no images" in invoked("lens", f"folder://{tmp_path}").output
    assert "there is no /dev/nothing" in invoked("lens", "v4l2:///dev/nothing").output


def test_the_board_is_written_at_the_size_asked_for(tmp_path: Path) -> None:
    result = invoked("board", "--out", str(tmp_path / "b.pdf"), "--square-mm", "25", "--kind", "chessboard")
    assert result.exit_code == 0
    assert "8 x 6 squares of 25 mm, on 297 x 210 mm" in result.output
    assert invoked("board", "--out", str(tmp_path / "b.doc")).exit_code == 2


def test_live_views_are_kept_when_still_and_new_only() -> None:
    rng = np.random.default_rng(1)
    (R, p), (R2, p2) = poses(2, 9, spread=0.3, distance_m=(0.3, 0.35))
    collection = Collection(Board(), is_live=True)
    first = rendered(board_texture(), LENS, R, p, rng)
    shifted = rendered(board_texture(), LENS, R2, p2, rng)
    said = []
    for image in (None, np.zeros((320, 480), np.uint8), first, first, first, shifted, shifted):
        collection.add(image)
        said.append(collection.said.partition(";")[0].partition(":")[0])
    assert said == [
        "not a readable picture",
        "no board found",
        "hold still",
        "kept",
        "seen already",
        "hold still",
        "kept",
    ]


def test_pictures_of_two_sizes_are_refused() -> None:
    collection = Collection(Board(), is_live=False)
    collection.add(np.zeros((320, 480), np.uint8))
    with pytest.raises(ValueError, match="one camera, one size"):
        collection.add(np.zeros((100, 100), np.uint8))


# --------------------------------------------------------------------------------------------------------------- delay

F, WIDTH, HEIGHT = 200.0, 240, 180
DELAY_S = 0.07
BOOT_TO_UNIX_S = 1_700_000_000.0
SETTINGS = (
    f"[cameras.down]\nfx_px = {F}\nfy_px = {F}\ncx_px = 119.5\ncy_px = 89.5\nwidth_px = {WIDTH}\nheight_px = {HEIGHT}\n"
)


def roll(t: float) -> float:
    return float(0.08 * (np.sin(4.4 * t) + np.sin(8.2 * t + 1.0) + 0.7 * np.sin(13.1 * t + 2.0)))


def roll_rate(t: float) -> float:
    return float(0.08 * (4.4 * np.cos(4.4 * t) + 8.2 * np.cos(8.2 * t + 1.0) + 0.7 * 13.1 * np.cos(13.1 * t + 2.0)))


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Frames stamped DELAY_S late in Unix time, and ATTITUDE at 50 Hz that took 2 to 9 ms to the log."""
    folder = tmp_path_factory.mktemp("recording")
    (folder / "frames").mkdir()
    rng = np.random.default_rng(2)
    scene = cv2.resize(rng.integers(0, 255, (60, 80), np.uint8), (800, 600), interpolation=cv2.INTER_CUBIC)
    K = np.array([[F, 0.0, 119.5], [0.0, F, 89.5], [0.0, 0.0, 1.0]])
    sheet = np.array([[F, 0.0, 399.5], [0.0, F, 299.5], [0.0, 0.0, 1.0]])
    for k in range(150):
        t = 1.0 + k / 30.0
        # The default mount: the image's right is the body's right, up is its nose, so a roll turns about C's -y.
        R_WC = cv2.Rodrigues(np.array([0.0, -roll(t), 0.0]))[0]
        image = cv2.warpPerspective(scene, K @ R_WC.T @ np.linalg.inv(sheet), (WIDTH, HEIGHT))
        cv2.imwrite(str(folder / "frames" / f"{round((t + DELAY_S + BOOT_TO_UNIX_S) * 1e9)}.jpg"), image)
    sender = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    writer = TlogWriter(folder / "flight.tlog")
    for t in np.arange(0.0, 7.5, 0.02):
        message = sender.attitude_encode(round(t * 1000), roll(t), 0.0, 0.0, roll_rate(t), 0.0, 0.0)
        writer.write(round((t + BOOT_TO_UNIX_S + rng.uniform(0.002, 0.009)) * 1e6), message.pack(sender))
    writer.close()
    (folder / "my.toml").write_text(SETTINGS, encoding="utf-8")
    return folder


def test_a_delay_is_measured_from_a_recording(recording: Path) -> None:
    frames, log, settings = (str(recording / name) for name in ("frames", "flight.tlog", "my.toml"))
    result = invoked("delay", "-c", settings, "--frames", f"folder://{frames}", "--log", log, "--gyro-cutoff-hz", "0")
    assert result.exit_code == 0, result.output
    found_s = float(result.output.rsplit("delay_s = ", 1)[1])
    # The log cannot tell the shortest transport delay, 2 ms here, from the clocks' distance.
    assert found_s == pytest.approx(DELAY_S - 0.002, abs=0.003)


@pytest.mark.parametrize("turning_hz", [0.5, 2.0, 4.0])
def test_what_a_hand_can_turn_comes_through_the_gyros_filter_that_much_later(turning_hz: float) -> None:
    """The phase of 1 / (1 + sqrt(2) s + s^2), over the frequency."""
    s = 1j * turning_hz / 40.0
    phase_rad = -np.angle(1.0 / (1.0 + np.sqrt(2.0) * s + s * s))
    assert filter_lag_s(40.0) == pytest.approx(phase_rad / (2.0 * np.pi * turning_hz), rel=0.01)
    assert filter_lag_s(0.0) == 0.0


def test_a_vehicle_with_the_usual_gyro_filter_adds_its_lag(recording: Path) -> None:
    frames, log, settings = (str(recording / name) for name in ("frames", "flight.tlog", "my.toml"))
    found = [
        float(
            invoked(
                "delay", "-c", settings, "--frames", f"folder://{frames}", "--log", log, "--gyro-cutoff-hz", cutoff
            ).output.rsplit("delay_s = ", 1)[1]
        )
        for cutoff in ("0", "40")
    ]
    assert found[1] - found[0] == pytest.approx(filter_lag_s(40.0), abs=0.0005)


def test_frames_on_a_clock_of_their_own_have_no_delay(recording: Path, tmp_path: Path) -> None:
    for index, path in enumerate(sorted((recording / "frames").iterdir())[:5]):
        (tmp_path / f"frame{index}.jpg").write_bytes(path.read_bytes())
    result = invoked("delay", "--frames", f"folder://{tmp_path}", "--log", str(recording / "flight.tlog"))
    assert result.exit_code == 2
    assert "a clock of their own" in result.output


def test_a_log_without_rates_a_missing_log_and_half_a_request_are_refused(recording: Path, tmp_path: Path) -> None:
    frames = f"folder://{recording / 'frames'}"
    (tmp_path / "empty.tlog").write_bytes(b"")
    assert "no body rates" in invoked("delay", "--frames", frames, "--log", str(tmp_path / "empty.tlog")).output
    assert invoked("delay", "--frames", frames, "--log", str(tmp_path / "none.tlog")).exit_code == 2
    assert "belong together" in invoked("delay", "--frames", frames).output
    assert "has down" in invoked("delay", "--camera", "up").output
