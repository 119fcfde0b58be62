"""`companion calibrate lens` on a live camera: the simulator's camera server, real HTTP, real time."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import pytest
from board_views import waved_board
from typer.testing import CliRunner, Result

from companion.cli import app
from companion.io.camera_info import read
from sitl_stub.mjpeg import CameraServer, JpegFrame

FRAME_S = 0.03
HELD_FRAMES = 5
"""How long the board is held still at each place."""


@contextmanager
def camera_of(pictures: list[bytes], *, stops_after: int | None = None) -> Iterator[str]:
    """The URL of a camera that shows each picture for a while, over and over, or goes silent after so many frames."""
    ready, over = threading.Event(), threading.Event()
    port = [0]

    async def film() -> None:
        server = CameraServer(["down"])
        port[0] = await server.start("127.0.0.1", 0)
        ready.set()
        number = 0
        while not over.is_set():
            if server.is_watched("down") and (stops_after is None or number < stops_after):
                data = pictures[number // HELD_FRAMES % len(pictures)]
                server.publish("down", JpegFrame(number * 30_000, number, data))
                number += 1
            await asyncio.sleep(FRAME_S)  # the camera's frame rate
        await server.stop()

    thread = threading.Thread(target=lambda: asyncio.run(film()))
    thread.start()
    ready.wait(5.0)
    try:
        yield f"http://127.0.0.1:{port[0]}/down"
    finally:
        over.set()
        thread.join()


@pytest.fixture(scope="module")
def pictures() -> list[bytes]:
    """JPEGs of the board."""
    return [cv2.imencode(".jpg", one, [cv2.IMWRITE_JPEG_QUALITY, 92])[1].tobytes() for one in waved_board()]


def calibrated(url: str, out: Path, seconds: float) -> Result:
    arguments = ["calibrate", "lens", url, "--out", str(out), "--seconds", str(seconds)]
    return CliRunner().invoke(app, arguments, env={"COLUMNS": "200"})


def test_a_board_waved_before_a_live_camera_becomes_a_lens(pictures: list[bytes], tmp_path: Path) -> None:
    with camera_of(pictures) as url:
        for seconds in (7.0, 20.0, 60.0):  # longer where a busy machine looks at few frames a second
            result = calibrated(url, tmp_path / "down.yaml", seconds)
            if result.exit_code == 0:
                break
    assert result.exit_code == 0, result.output
    lens = read(tmp_path / "down.yaml")
    assert lens.fx_px == pytest.approx(300.0, rel=0.01)
    assert (lens.cx_px, lens.cy_px) == pytest.approx((236.0, 162.0), abs=3.0)


def test_a_camera_that_goes_silent_ends_the_calibration_at_its_time(pictures: list[bytes], tmp_path: Path) -> None:
    with camera_of(pictures, stops_after=3 * HELD_FRAMES) as url:
        result = calibrated(url, tmp_path / "down.yaml", 2.0)
    assert result.exit_code == 2
    assert "not enough" in result.output
    assert not (tmp_path / "down.yaml").exists()
