"""Two hundred malformed inputs: each gives a clear error or is skipped and counted; none hangs, crashes or loses the rest.

Random damage for minutes is the fuzzers' business (tests/fuzz); these are the cases that people, disks and networks make.
"""

from __future__ import annotations

import asyncio
import http.client
import random
import socket
from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import cv2
import numpy as np
import pytest

from companion.config import Config, ConfigError, Dashboard, Link, load
from companion.io import camera_info
from companion.io.cameras import CameraError, frames
from companion.io.cameras.frame import decoded
from companion.io.log_commands import info
from companion.io.log_inputs import tlog_inputs
from companion.io.mcap_log import LogOrigin, McapLog, write_entries
from companion.io.tlog import read_frames
from companion.onboard import JournalEntry
from companion.replay import ReplayOptions, replay
from companion.telemetry.topics import Refused, taken

REPO = Path(__file__).resolve().parents[2]
TLOG = (REPO / "tests" / "data" / "px4" / "offboard_loss.tlog").read_bytes()
GOLDEN = REPO / "tests" / "replay" / "line.mcap"
NOW_NS, SHIFT_NS = 5 * 10**12, 17 * 10**17


def tlog_file(folder: Path, data: bytes) -> Path:
    (folder / "odd.tlog").write_bytes(data)
    return folder / "odd.tlog"


def whole_frames(folder: Path) -> list[bytes]:
    """Stamp and frame together, as they stand in the file."""
    return [t_us.to_bytes(8, "big") + frame for t_us, frame in read_frames(tlog_file(folder, TLOG))]


def flipped(data: bytes, flips: int, seed: int, *, spare: int = 0) -> bytes:
    """`spare` bytes at the beginning stay."""
    rng, damaged = random.Random(seed), bytearray(data)
    for _ in range(flips):
        damaged[rng.randrange(spare, len(damaged))] ^= 1 << rng.randrange(8)
    return bytes(damaged)


# ------------------------------------------------------------------------------------------------------ telemetry logs

CUTS = [0.01, 0.1, 0.2, 0.3, 0.37, 0.5, 0.61, 0.7, 0.83, 0.9, 0.97, 0.999]
FLIPS = [1, 1, 1, 2, 3, 5, 8, 13, 21, 34, 55, 89]
ORDERS = list(range(10))


def survive(path: Path) -> int:
    """Everything that reads a .tlog, on this one; the number of messages."""
    assert all(t_ns >= 0 for t_ns, _ in tlog_inputs(path, Link()).messages)
    messages: int = info(path)["messages"]
    return messages


@pytest.mark.parametrize("share", CUTS)
def test_a_cut_tlog_holds_all_that_is_before_the_cut(tmp_path: Path, share: float) -> None:
    kept, size, expected = round(share * len(TLOG)), 0, 0
    for piece in whole_frames(tmp_path):
        size += len(piece)
        expected += size <= kept
    assert survive(tlog_file(tmp_path, TLOG[:kept])) == expected


@pytest.mark.parametrize(("flips", "seed"), [(flips, seed) for seed, flips in enumerate(FLIPS)])
def test_a_flipped_bit_in_a_tlog_costs_its_own_frame_only(tmp_path: Path, flips: int, seed: int) -> None:
    before = len(whole_frames(tmp_path))
    assert before - 2 * flips <= survive(tlog_file(tmp_path, flipped(TLOG, flips, seed))) <= before


@pytest.mark.parametrize("seed", ORDERS)
def test_a_tlog_in_another_order_holds_the_same_frames(tmp_path: Path, seed: int) -> None:
    pieces = whole_frames(tmp_path)
    rng = random.Random(seed)
    begin = rng.randrange(len(pieces) // 2)
    middle = pieces[begin : begin + 10 ** (1 + seed % 3)]
    rng.shuffle(middle)
    pieces[begin : begin + len(middle)] = middle
    assert survive(tlog_file(tmp_path, b"".join(pieces))) == len(pieces)


# ------------------------------------------------------------------------------------------------------------ our logs

MCAP_CUTS = [0.02, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.98, 0.9999]
MCAP_FLIPS = [1, 1, 1, 1, 2, 2, 3, 5, 8, 13, 21, 34]
MCAP_ORDERS = [1, 2, 3, 4, 5, 6]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[bytes, int]:
    """The golden log as a flight would have written it, a chunk each half second; and its number of messages."""
    log = McapLog.read(GOLDEN)
    entries = [JournalEntry(e.sequence, e.arrived_ns, "in", e.cause, e.message) for e in log.entries()]
    path = tmp_path_factory.mktemp("mcap") / "whole.mcap"
    write_entries(path, LogOrigin(log.config(), {}, log.log_minus_companion_ns, {}), entries)
    return path.read_bytes(), len(entries)


def mcap_entries(folder: Path, data: bytes) -> tuple[int, Path]:
    path = folder / "odd.mcap"
    path.write_bytes(data)
    return len(list(McapLog.read(path).entries())), path


@pytest.mark.parametrize("share", MCAP_CUTS)
def test_a_cut_mcap_is_read_up_to_the_cut(whole: tuple[bytes, int], tmp_path: Path, share: float) -> None:
    data, count = whole
    found, _ = mcap_entries(tmp_path, data[: round(share * len(data))])
    assert (share - 0.2) * count <= found <= count


@pytest.mark.parametrize(("flips", "seed"), [(flips, seed) for seed, flips in enumerate(MCAP_FLIPS)])
def test_a_flipped_bit_in_an_mcap_costs_its_chunk_at_most(
    whole: tuple[bytes, int], tmp_path: Path, flips: int, seed: int
) -> None:
    data, count = whole
    found, path = mcap_entries(tmp_path, flipped(data, flips, seed, spare=64))
    assert count - flips * 0.05 * count <= found <= count
    if seed < 3:
        assert replay(path, ReplayOptions()).figures


@pytest.mark.parametrize("pieces", MCAP_ORDERS)
def test_an_mcap_with_its_middle_turned_round_keeps_all_but_the_seams(
    whole: tuple[bytes, int], tmp_path: Path, pieces: int
) -> None:
    data, count = whole
    third = len(data) // 3
    step = third // pieces
    blocks = [data[third + i * step : third + (i + 1) * step] for i in range(pieces)]
    found, _ = mcap_entries(tmp_path, data[:third] + b"".join(reversed(blocks)) + data[third + pieces * step :])
    assert count - (pieces + 1) * 0.05 * count <= found <= count


# ---------------------------------------------------------------------------------------------------------------- TOML

TOML = [
    ("[link", "not valid TOML"),
    ("link]", "not valid TOML"),
    ("[link]\nurl = ", "not valid TOML"),
    ("[link]\nurl = 'a", "not valid TOML"),
    ("[link]\nurl = udp", "not valid TOML"),
    ("[link]\nurl = 'a'\nurl = 'b'", "not valid TOML"),
    ("[link]\n[link]\n", "not valid TOML"),
    ("[link]\nurl == 'a'", "not valid TOML"),
    ("[link]\nx = [1, 2", "not valid TOML"),
    ("[link]\nx = 01", "not valid TOML"),
    ("[link]\nx = 1.", "not valid TOML"),
    ("[link]\nx = 2026-13-45", "not valid TOML"),
    ("\x00", "not valid TOML"),
    ("[" * 3000, "not valid TOML"),
    ("[links]\n", "did you mean 'link'"),
    ("link = 1", "[link]"),
    ("[link]\nurl = 5", "[link] url = 5"),
    ("[link]\nuri = 'a'", "did you mean 'url'"),
    ("[link]\nsystem_id = 0", "system_id = 0"),
    ("[link]\nsystem_id = 256", "system_id = 256"),
    ("[link]\nsystem_id = 1.5", "system_id = 1.5"),
    ("[link]\nstate_rate_hz = -1", "state_rate_hz = -1"),
    ("[link]\ncommand_attempts = 1000000", "command_attempts"),
    ("[cameras.down]\nwidth_px = 'wide'", "width_px = 'wide'"),
    ("[cameras.down]\nmount_deg = [1, 2]", "mount_deg"),
    ("[cameras.down]\nmodel = 'fish'", "model = 'fish'"),
    ("[cameras.down]\ncalibration_file = 'none.yaml'", "none.yaml"),
    ("[cameras]\ndown = 3", "[cameras.down]"),
    ("[[pad.markers]]\nid = -1\nsize_m = 1", "id"),
    ("[[pad.markers]]\nid = 1", "size_m"),
    ("[pad]\nmarkers = {}", "markers"),
    ("[mission]\ndisarm = 'always'", "disarm = 'always'"),
    ("[mission]\nmax_go_arounds = -3", "max_go_arounds = -3"),
    ("[mission]\ncommit_height_m = 0", "commit_height_m = 0"),
    ("[safety]\nmin_battery = 20", "min_battery = 20"),
    ("[[safety.zones]]\nkind = 'no_fly'", "a zone needs exactly one"),
    ("[[safety.zones]]\nkind = 'no_go'\ncenter_m = [0, 0]\nradius_m = 1", "kind"),
    ("[[safety.zones]]\npolygon_m = [[0, 0], [1, 1]]", "three corners"),
    ("[mqtt]\nport = 70000", "port = 70000"),
    ("[mqtt]\nprefix = '#'", "prefix = '#'"),
    ("[dashboard]\nrate_hz = 1000", "rate_hz = 1000"),
    ("[guidance]\nform = 'yes'", "form = 'yes'"),
]


@pytest.mark.parametrize(("text", "said"), TOML)
def test_a_wrong_configuration_is_an_error_that_names_the_place(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "my.toml").write_text(text)
    with pytest.raises(ConfigError) as caught:
        load([tmp_path / "my.toml"])
    assert said in str(caught.value)


# ---------------------------------------------------------------------------------------------------------------- YAML

CALIBRATION = """\
image_width: 640
image_height: 480
camera_name: front
camera_matrix:
  rows: 3
  cols: 3
  data: [400.0, 0.0, 320.0, 0.0, 400.0, 240.0, 0.0, 0.0, 1.0]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [0.0, 0.0, 0.0, 0.0, 0.0]
"""
YAML = [
    ("image_width: 640", "image_width: wide"),
    ("image_width: 640", "image_width: -640"),
    ("image_width: 640", "image_width: 0"),
    ("image_width: 640", "image_width:"),
    ("image_width: 640", "image_width: [640]"),
    ("image_width: 640\n", ""),
    ("image_height: 480\n", ""),
    ("image_height: 480", "image_height: 1e400"),
    ("image_height: 480", "image_height: .nan"),
    ("400.0, 0.0, 320.0", "0.0, 0.0, 320.0"),
    ("400.0, 0.0, 320.0", "-400.0, 0.0, 320.0"),
    ("400.0, 0.0, 320.0", ".inf, 0.0, 320.0"),
    ("400.0, 0.0, 320.0", "x, 0.0, 320.0"),
    ("400.0, 0.0, 320.0", "0.0, 320.0"),
    ("data: [400.0", "data: 400.0"),
    ("camera_matrix", "matrix"),
    ("data: [400.0", "data: [[400.0"),
    ("plumb_bob", "barrel"),
    ("plumb_bob", "[plumb_bob]"),
    ("data: [0.0, 0.0, 0.0, 0.0, 0.0]", "data: [0.0, 0.0]"),
    ("data: [0.0, 0.0, 0.0, 0.0, 0.0]", "data: [0.0, 0.0, 0.0, 0.0, nothing]"),
    ("data: [0.0, 0.0, 0.0, 0.0, 0.0]", "data: [0.0, 0.0, 0.0, 0.0, .nan]"),
    (CALIBRATION, ""),
    (CALIBRATION, "just words"),
    (CALIBRATION, "- a\n- b\n"),
    (CALIBRATION, "!!python/object/apply:os.system ['true']"),
]


@pytest.mark.parametrize(("old", "new"), YAML)
def test_a_wrong_calibration_is_an_error_that_names_the_file(tmp_path: Path, old: str, new: str) -> None:
    assert old in CALIBRATION
    (tmp_path / "down.yaml").write_text(CALIBRATION.replace(old, new, 1))
    (tmp_path / "my.toml").write_text('[cameras.down]\ncalibration_file = "down.yaml"\n')
    with pytest.raises(ConfigError, match=r"down\.yaml"):
        load([tmp_path / "my.toml"])


def test_the_calibration_itself_is_good() -> None:
    assert camera_info.parse(CALIBRATION, "x").fx_px == 400.0


# ------------------------------------------------------------------------------------------------------------ pictures


def encoded(suffix: str) -> bytes:
    image = np.random.default_rng(1).integers(0, 255, (48, 64, 3), np.uint8)
    return bytes(cv2.imencode(suffix, image)[1].tobytes())


PICTURES: list[tuple[str, Callable[[bytes], bytes]]] = [
    *((".png", lambda d, k=k: d[: k * len(d) // 8]) for k in range(8)),
    *((".jpg", lambda d, k=k: d[: k * len(d) // 8]) for k in range(8)),
    (".png", lambda d: d[:16] + b"\x7f\xff\xff\xff\x7f\xff\xff\xff" + d[24:]),
    (".png", lambda d: d[:16] + b"\x00\x00\x00\x00\x00\x00\x00\x00" + d[24:]),
    (".png", lambda d: b"\x89PNG" + d),
    (".png", lambda d: d[:8] + d[33:]),
    (".jpg", lambda d: d[::-1]),
    (".jpg", lambda d: d.replace(b"\xff\xc0", b"\xff\xc1")),
    (".jpg", lambda d: b"GIF89a" + d[6:]),
    (".jpg", lambda d: b"<svg/>"),
]


@pytest.mark.parametrize(("suffix", "spoil"), PICTURES)
def test_a_spoilt_picture_is_a_picture_or_none(suffix: str, spoil: Callable[[bytes], bytes]) -> None:
    image = decoded(spoil(encoded(suffix)))
    assert image is None or (image.dtype == np.uint8 and image.shape[:2] == (48, 64))
    assert decoded(encoded(suffix)) is not None


# ---------------------------------------------------------------------------------------------------------------- MQTT

PAYLOADS = [
    *(("command", body) for body in (b"", b"null", b"true", b"0", b'"start"', b"[]", b"{}", b"{", b"}", b"\x00", b"\xff")),
    ("command", b'{"action": null}'),
    ("command", b'{"action": ["start"]}'),
    ("command", b'{"action": "START"}'),
    ("command", b'{"action": "start\\u0000"}'),
    ("command", b'{"action": "start", "action ": 1}'),
    ("command", b'{"action": "start", "source": 7}'),
    ("command", b'{"action": "start", "t_unix_ns": "now"}'),
    ("command", b'{"action": "start", "t_unix_ns": -1}'),
    ("command", b'{"action": "start", "t_unix_ns": 1.5}'),
    ("command", b'{"a":' * 500 + b"1" + b"}" * 500),
    ("pad", b"{}"),
    ("pad", b'{"position_ned_m": null}'),
    ("pad", b'{"position_ned_m": []}'),
    ("pad", b'{"position_ned_m": [1, 2, 3, 4]}'),
    ("pad", b'{"position_ned_m": [1, 2, 1e6]}'),
    ("pad", b'{"position_ned_m": {"n": 1}}'),
    ("pad", b'{"position_ned_m": [1, 2, 3], "velocity_ned_m_s": [1e3, 0, 0]}'),
    ("pad", b'{"position_ned_m": [1, 2, 3], "yaw_rad": 700}'),
    ("pad", b'{"position_ned_m": [1, 2, 3], "position_sigma_m": -1}'),
    ("pad", b'{"position_ned_m": [1, 2, 3], "yaw_rate_rad_s": Infinity}'),
    ("state", b"{}"),
    ("../command", b'{"action": "start"}'),
]  # fmt: skip


@pytest.mark.parametrize(("topic", "payload"), PAYLOADS)
def test_a_hostile_message_of_the_broker_is_refused_in_words(topic: str, payload: bytes) -> None:
    with pytest.raises(Refused, match=r"\w"):
        taken(topic, payload, now_ns=NOW_NS, unix_minus_monotonic_ns=SHIFT_NS)


# ---------------------------------------------------------------------------------------------------------------- HTTP

OK = b"HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=b\r\n\r\n"
ANSWERS = [
    b"",
    b"\r\n\r\n",
    b"\x00" * 1000,
    b"HTTP/1.1\r\n\r\n",
    b"HTTP/1.1 abc\r\n\r\n",
    b"HTTP/1.1 500 Oh\r\n\r\n",
    b"HTTP/1.1 301 Moved\r\nLocation: http://elsewhere/\r\n\r\n",
    b"SSH-2.0-OpenSSH_9\r\n",
    b"HTTP/1.1 200 OK\r\n\r\n",
    b"HTTP/1.1 200 OK\r\nContent-Type: image/jpeg\r\n\r\n" + b"x" * 100,
    b"HTTP/1.1 200 OK\r\n" + b"X: y\r\n" * 50_000 + b"\r\n",
    OK + b"--b\r\nContent-Length: -5\r\n\r\n",
    OK + b"--b\r\nContent-Length: many\r\n\r\n",
    OK + b"--b\r\nContent-Length: 18446744073709551616\r\n\r\n",
    OK + b"--c\r\n" * 30_000,
]
REQUESTS = [
    b"",
    b"\r\n" * 500,
    b"\xff" * 5000,
    b"GET\r\n\r\n",
    b"GET / HTTP/1.1\r\n" + b"X: y\r\n" * 20_000 + b"\r\n",
    b"GET / HTTP/1.1\r\nContent-Length: -1\r\n\r\n",
    b"POST /command HTTP/1.1\r\nContent-Length: 99999999999\r\n\r\n{",
    b"POST /command HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\nzz\r\n",
    b"GET /live HTTP/1.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Key: x\r\n\r\n",
    b"GET /%00%ff HTTP/1.1\r\nHost: x\r\n\r\n",
    b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03",
    b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
]


@pytest.mark.sockets
@pytest.mark.parametrize("answer", ANSWERS)
def test_a_server_that_is_no_camera_is_an_error_or_the_end_of_the_stream(answer: bytes) -> None:
    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readuntil(b"\r\n\r\n")
        writer.write(answer)
        writer.close()

    async def watch() -> int:
        server = await asyncio.start_server(serve, "127.0.0.1", 0)
        port = server.sockets[0].getsockname()[1]
        async with server:
            return len([frame async for frame in frames(f"http://127.0.0.1:{port}/down")])

    try:
        assert asyncio.run(asyncio.wait_for(watch(), 60.0)) == 0
    except CameraError as error:
        assert "127.0.0.1" in str(error)  # noqa: PT017


@pytest.fixture(scope="module")
def page() -> Iterator[tuple[int, str]]:
    pytest.importorskip("starlette", reason="the web extra is not installed")
    from companion.telemetry.dashboard.service import DashboardService

    service = DashboardService(Config(dashboard=Dashboard(port=0)), title="a test")
    service.start(lambda message: None)
    yield service.port, parse_qs(urlsplit(service.address).query)["token"][0]
    service.close()


@pytest.mark.sockets
@pytest.mark.parametrize("request_bytes", REQUESTS)
def test_whatever_is_said_to_the_page_it_serves_the_next(page: tuple[int, str], request_bytes: bytes) -> None:
    port, token = page
    with socket.create_connection(("127.0.0.1", port), timeout=60.0) as line:
        line.sendall(request_bytes)
        line.shutdown(socket.SHUT_WR)
        try:
            while line.recv(65536):
                pass
        except ConnectionResetError:
            pass  # hung up before everything was read
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60.0)
    connection.request("GET", "/settings", headers={"Authorization": f"Bearer {token}"})
    assert connection.getresponse().status == 200
    connection.close()


def test_there_are_two_hundred_of_them() -> None:
    families = (
        CUTS,
        FLIPS,
        ORDERS,
        MCAP_CUTS,
        MCAP_FLIPS,
        MCAP_ORDERS,
        TOML,
        YAML,
        PICTURES,
        PAYLOADS,
        ANSWERS,
        REQUESTS,
    )
    assert sum(map(len, families)) >= 200
