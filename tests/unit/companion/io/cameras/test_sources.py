"""Sources that need no hardware: a folder, a video, HTTP; and what is said where one cannot be opened."""

from __future__ import annotations

import asyncio
from contextlib import aclosing
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.io.cameras import CAMERAS, CameraError, CameraFrame, CaptureClock, frames
from companion.io.cameras.arrival import ArrivalStamps
from companion.io.cameras.capture_thread import threaded_frames
from companion.io.cameras.frame import as_image, decoded
from companion.io.cameras.gstreamer import is_built_in
from companion.io.cameras.rtsp import without_password
from companion.io.cameras.video_capture import captured

PERIOD_NS = 33_333_333


def all_frames(url: str) -> list[CameraFrame]:
    async def read() -> list[CameraFrame]:
        return [frame async for frame in frames(url)]

    return asyncio.run(read())


def picture(level: int = 120, width: int = 64, height: int = 48) -> Any:
    return np.full((height, width), level, np.uint8)


def jpeg(level: int = 120) -> bytes:
    return cv2.imencode(".jpg", picture(level))[1].tobytes()


# ------------------------------------------------------------------------------------------------------------- folders


def test_a_folder_with_a_table_gives_images_in_the_order_of_their_times_on_the_clock_that_it_names(
    tmp_path: Path,
) -> None:
    for name, level in (("b.png", 10), ("a.png", 200)):
        cv2.imwrite(str(tmp_path / name), picture(level))
    (tmp_path / "times.csv").write_text("file,capture_boot_us\na.png,3000\nb.png,1000\n", encoding="utf-8")
    first, second = all_frames(f"folder://{tmp_path}")
    assert (first.name, first.capture_ns, first.clock) == ("b.png", 1_000_000, CaptureClock.AUTOPILOT)
    assert (second.name, second.capture_ns) == ("a.png", 3_000_000)
    image = second.image()
    assert image is not None
    assert image.shape == (48, 64)


def test_names_that_are_nanoseconds_are_times_and_large_ones_are_unix_time(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "1700000000123456789.png"), picture())
    (frame,) = all_frames(f"folder://{tmp_path}")
    assert (frame.capture_ns, frame.clock) == (1_700_000_000_123_456_789, CaptureClock.UNIX)


def test_images_without_times_say_that_their_time_is_uncertain_by_a_frame(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "one.png"), picture())
    cv2.imwrite(str(tmp_path / "two.png"), picture())
    assert [frame.capture_uncertainty_ns for frame in all_frames(f"folder://{tmp_path}")] == [PERIOD_NS, PERIOD_NS]


@pytest.mark.parametrize(
    ("table", "says"),
    [
        ("name,when\na.png,1\n", "needed: file and one of"),
        ("file,t_ns\na.png,soon\n", "line 2"),
        ("file,t_ns\na.png,1\n", "a.png: cannot be read"),
        ("file,t_ns\n", "no images"),
    ],
)
def test_a_table_of_times_that_cannot_be_used_is_refused_with_the_reason(tmp_path: Path, table: str, says: str) -> None:
    (tmp_path / "times.csv").write_text(table, encoding="utf-8")
    with pytest.raises(CameraError, match=says):
        all_frames(f"folder://{tmp_path}")


def test_a_file_in_the_folder_that_is_no_picture_is_a_frame_without_one(tmp_path: Path) -> None:
    (tmp_path / "broken.png").write_bytes(b"not a picture")
    (frame,) = all_frames(f"folder://{tmp_path}")
    assert frame.image() is None


# -------------------------------------------------------------------------------------------------------------- videos


@pytest.fixture
def clip(tmp_path: Path) -> Path:
    path = tmp_path / "clip.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 20.0, (64, 48))
    for level in (20, 90, 160, 230):
        writer.write(cv2.cvtColor(picture(level), cv2.COLOR_GRAY2BGR))
    writer.release()
    return path


def test_a_video_file_gives_every_frame_with_its_time_in_the_file(clip: Path) -> None:
    read = all_frames(f"file://{clip}")
    assert [round(frame.capture_ns / 1e6) for frame in read] == [0, 50, 100, 150]
    assert {frame.clock for frame in read} == {CaptureClock.MEDIA}
    assert [frame.capture_uncertainty_ns for frame in read] == [25_000_000] * 4
    levels = [float(np.mean(image)) for frame in read if (image := frame.image()) is not None]
    assert levels == pytest.approx([20, 90, 160, 230], abs=3)


def test_a_file_that_is_no_video_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "clip.mp4"
    path.write_bytes(b"\x00" * 100)
    with pytest.raises(CameraError, match="no video"):
        all_frames(f"file://{path}")


# ---------------------------------------------------------------------------------------------------------------- HTTP


async def served(answer: bytes) -> list[CameraFrame]:
    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readuntil(b"\r\n\r\n")
        writer.write(answer)
        await writer.drain()
        writer.close()

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    port = server.sockets[0].getsockname()[1]
    async with server:
        return [frame async for frame in frames(f"http://127.0.0.1:{port}/down")]


HEAD = b"HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=b\r\n\r\n"


def part(body: bytes, headers: bytes = b"") -> bytes:
    return b"--b\r\n" + headers + b"Content-Length: %d\r\n\r\n" % len(body) + body + b"\r\n"


@pytest.mark.sockets
def test_a_stamped_part_is_on_the_autopilots_clock_and_an_unstamped_one_counts_from_its_arrival() -> None:
    stamp = b"X-Capture-Time-Boot-Us: 123456\r\nX-Frame-Sequence: 7\r\n"
    stamped, plain = asyncio.run(served(HEAD + part(jpeg(), stamp) + part(jpeg())))
    assert (stamped.clock, stamped.capture_ns, stamped.sequence) == (CaptureClock.AUTOPILOT, 123_456_000, 7)
    assert plain.clock is CaptureClock.MONOTONIC
    assert 0 < plain.arrived_ns - plain.capture_ns < 2 * plain.capture_uncertainty_ns


@pytest.mark.sockets
@pytest.mark.parametrize(
    ("answer", "says"),
    [
        (b"HTTP/1.1 404 Not Found\r\n\r\n", "404"),
        (b"HTTP/1.1 200 OK\r\nContent-Type: text/html\r\n\r\n", "text/html"),
        (HEAD + b"--b\r\nX: y\r\n\r\n", "Content-Length"),
        (HEAD + b"--b\r\nContent-Length: 99999999999\r\n\r\n", "Content-Length"),
        (HEAD + b"x" * 100_000, "not a stream"),
    ],
)
def test_a_server_that_is_no_camera_is_named_with_what_it_sent(answer: bytes, says: str) -> None:
    with pytest.raises(CameraError, match=says):
        asyncio.run(served(answer))


@pytest.mark.sockets
def test_a_stream_cut_in_the_middle_of_a_frame_just_ends() -> None:
    whole = HEAD + part(jpeg())
    assert len(asyncio.run(served(whole + part(jpeg())[:60]))) == 1


# ---------------------------------------------------------------------------------------------------- threads, hardware


def test_frames_from_a_thread_come_in_order_and_its_error_comes_last() -> None:
    def source() -> Any:
        yield CameraFrame(picture(), 1, 0, CaptureClock.MONOTONIC, 1)
        raise CameraError("unplugged")

    seen: list[int] = []

    async def read() -> None:
        async with aclosing(threaded_frames(source)) as stream:
            async for frame in stream:
                seen.append(frame.capture_ns)

    with pytest.raises(CameraError, match="unplugged"):
        asyncio.run(read())
    assert seen == [1]


@pytest.mark.parametrize(
    ("url", "says"),
    [
        ("v4l2:///dev/video-none", "there is no /dev/video-none"),
        ("v4l2:///dev/null?widht=640", "'widht' is not an option; allowed: width"),
        ("v4l2:///dev/null", "cannot be opened"),
        ("file:///nowhere.mp4", "there is no file"),
        ("folder:///nowhere", "there is no folder"),
        ("usb0", "begins with one of v4l2:"),
        ("http://127.0.0.1:1/down", "cannot connect"),
    ],
)
def test_a_camera_that_cannot_be_opened_says_why(url: str, says: str) -> None:
    with pytest.raises(CameraError, match=says):
        all_frames(url)


@pytest.mark.skipif(is_built_in(cv2.getBuildInformation()), reason="this OpenCV has GStreamer")
def test_gstreamer_without_gstreamer_says_what_to_do() -> None:
    with pytest.raises(CameraError, match="without GStreamer"):
        all_frames("gstreamer:videotestsrc ! appsink")


def test_every_scheme_has_a_source() -> None:
    assert set(CAMERAS) == {"v4l2", "gstreamer", "rtsp", "http", "file", "folder"}


def test_a_password_is_not_shown() -> None:
    assert without_password("rtsp://me:secret@cam/live") == "rtsp://me:***@cam/live"


# --------------------------------------------------------------------------------------------------------------- times


def test_a_drivers_stamp_is_used_only_where_it_is_of_this_clock() -> None:
    now = 50_000_000_000
    assert captured(now - 20_000_000, now, ArrivalStamps(PERIOD_NS)) == (now - 20_000_000, PERIOD_NS // 2)
    for foreign in (None, now + 5_000_000, 1_700_000_000_000_000_000, 0):
        assert captured(foreign, now, ArrivalStamps(PERIOD_NS)) == (now - PERIOD_NS // 2, PERIOD_NS)


def test_the_frame_period_is_learned_from_arrivals_and_an_outage_is_no_period() -> None:
    stamps = ArrivalStamps()
    t_ns = 0
    for _ in range(100):
        t_ns += 20_000_000
        stamps.note(t_ns)
    stamps.note(t_ns + 5_000_000_000)
    assert stamps.period_ns == pytest.approx(20_000_000, rel=0.01)


# ---------------------------------------------------------------------------------------------------------------- fuzz


@settings(max_examples=150, deadline=None)
@given(cut=st.integers(0, 2000), flips=st.lists(st.tuples(st.integers(0, 2000), st.integers(0, 255)), max_size=8))
def test_a_damaged_jpeg_gives_a_picture_or_none_and_never_an_exception(cut: int, flips: list[tuple[int, int]]) -> None:
    rng = np.random.default_rng(5)
    data = bytearray(cv2.imencode(".jpg", rng.integers(0, 255, (48, 64), np.uint8))[1].tobytes())
    for place, value in flips:
        data[place % len(data)] = value
    image = decoded(bytes(data[: cut % (len(data) + 1)]))
    assert image is None or (image.dtype == np.uint8 and image.ndim in (2, 3))


@settings(max_examples=50, deadline=None)
@given(
    shape=st.lists(st.integers(0, 5), min_size=0, max_size=4), dtype=st.sampled_from(["u1", "u2", "f4", "i4", "bool"])
)
def test_arrays_of_any_shape_are_8_bit_grey_or_colour_or_refused(shape: list[int], dtype: str) -> None:
    image = as_image(np.zeros(shape, dtype))
    assert image is None or (image.dtype == np.uint8 and (image.ndim == 2 or image.shape[2] == 3))
