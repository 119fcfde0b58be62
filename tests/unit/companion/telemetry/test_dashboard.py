"""The page's server over real HTTP and websockets: who may in, what is sent, what is refused. And what it shows of messages."""

from __future__ import annotations

import http.client
import json
import queue
import socket
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import numpy as np
import pytest

pytest.importorskip("starlette", reason="the web extra is not installed")
pytest.importorskip("uvicorn", reason="the web extra is not installed")

from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from companion.config import Config, ConfigError, Dashboard
from companion.messages import (
    Health,
    MissionView,
    OperatorAction,
    OperatorCommand,
    PadNotSeen,
    PadObservation,
    Phase,
    PhaseChanged,
    VelocitySetpoint,
)
from companion.onboard import JournalEntry
from companion.telemetry.dashboard.picture import EVENTS_KEPT, Picture
from companion.telemetry.dashboard.server import MOST_VIEWERS
from companion.telemetry.dashboard.service import DashboardService, check_safety

BOUND_S = 30.0
"""For a busy machine; all comes within a second otherwise."""

ATTEMPTS = 6
"""Of a measurement in real time, which other programs can spoil."""

CHANGE = PhaseChanged(2_000_000_000, Phase.SEARCH, Phase.APPROACH, "pad in sight")
VIEW = MissionView(2_000_000_000, Phase.APPROACH, (3.0, 4.0, -5.0), (0.1, 0.2, 0.3), 5.0, True, "above the pad", 1)
CORNERS = ((1.0, 2.0), (3.0, 2.0), (3.0, 4.0), (1.0, 4.0))
SEEN = PadObservation(
    7, "down", "aruco", (0.0, 0.0, 5.0), ((1.0, 0, 0), (0, 1.0, 0), (0, 0, 1.0)), corners_px=CORNERS, marker_ids=(45,)
)


class Served:
    """A running service and what it handed in."""

    def __init__(self, service: DashboardService) -> None:
        self.service = service
        self.asked: queue.Queue[object] = queue.Queue()
        self.token = parse_qs(urlsplit(service.address).query)["token"][0]
        service.start(self.asked.put)

    def tell(self, *messages: object) -> None:
        self.service.journal([JournalEntry(0, 0, "out", None, message) for message in messages])

    def request(
        self, path: str, *, method: str = "GET", body: bytes | None = None, token: bool = True, **headers: str
    ) -> tuple[int, bytes, http.client.HTTPMessage]:
        connection = http.client.HTTPConnection("127.0.0.1", self.service.port, timeout=BOUND_S)
        if token:
            headers["Authorization"] = f"Bearer {self.token}"
        try:
            connection.request(method, path, body=body, headers=headers)
            reply = connection.getresponse()
            return reply.status, reply.read(), reply.headers
        finally:
            connection.close()

    def live(self, *, token: bool = True, origin: str | None = None):
        headers = {"Authorization": f"Bearer {self.token}"} if token else {}
        if origin is not None:
            headers["Origin"] = origin
        return connect(f"ws://127.0.0.1:{self.service.port}/live", additional_headers=headers, open_timeout=BOUND_S)


@pytest.fixture
def served() -> Iterator[Served]:
    running = Served(DashboardService(Config(dashboard=Dashboard(port=0)), title="a test"))
    yield running
    running.service.close()


# ------------------------------------------------------------------------------------------------------------------ gate


@pytest.mark.parametrize("path", ["/", "/settings", "/static/page.js", "/command", "/live", "/nothing"])
def test_without_the_token_nothing_is_shown(served: Served, path: str) -> None:
    status, body, _ = served.request(path, token=False)
    assert status == 401
    assert b"terminal" in body


@pytest.mark.parametrize("path", ["/?token=", "/?token=wrong", "/?token=%ff%fe", "/settings?token=wrong"])
def test_a_wrong_token_is_no_token(served: Served, path: str) -> None:
    assert served.request(path, token=False)[0] == 401


def test_the_address_of_the_terminal_leaves_a_strict_cookie_and_takes_the_token_out_of_the_address(
    served: Served,
) -> None:
    status, _, headers = served.request(f"/?token={served.token}", token=False)
    assert (status, headers["location"]) == (303, "/")
    cookie = headers["set-cookie"]
    assert "HttpOnly" in cookie
    assert "SameSite=strict" in cookie
    status, body, _ = served.request("/", token=False, Cookie=cookie.split(";")[0])
    assert status == 200
    assert b"Companion" in body


def test_another_page_in_the_same_browser_cannot_command(served: Served) -> None:
    status, _, _ = served.request(
        "/command", method="POST", body=b'{"action": "start"}', Origin="http://evil.example.org"
    )
    assert status == 403
    assert served.asked.empty()


def test_a_websocket_needs_the_token_and_our_own_origin(served: Served) -> None:
    for options in ({"token": False}, {"origin": "http://evil.example.org"}):
        with pytest.raises(InvalidStatus, match="403"), served.live(**options):
            pass


def test_the_page_may_load_nothing_from_elsewhere(served: Served) -> None:
    _, body, headers = served.request("/")
    assert "default-src 'self'" in headers["content-security-policy"]
    for path in ("/static/page.js", "/static/page.css"):
        body += served.request(path)[1]
    assert b"//cdn" not in body
    assert b"https://" not in body


# -------------------------------------------------------------------------------------------------------------- commands


@pytest.mark.parametrize("action", ["start", "hold", "go_around", "abort", "return"])
def test_a_button_becomes_an_operators_command(served: Served, action: str) -> None:
    status, _, _ = served.request("/command", method="POST", body=json.dumps({"action": action}).encode())
    command = served.asked.get(timeout=BOUND_S)
    assert status == 202
    assert isinstance(command, OperatorCommand)
    assert command.action is OperatorAction(action)
    assert command.source == "page 127.0.0.1"
    assert abs(time.monotonic_ns() - command.t_ns) < 5e9


@pytest.mark.parametrize(
    "body",
    [b"", b"abort", b"{}", b"[]", b'{"action": "crash"}', b'{"action": "hold", "x": 1}', b"\xff" * 100, b"[" * 900]
    + [b'{"action": "hold"}' + b" " * 5000],
)
def test_a_hostile_body_is_refused_and_the_server_lives(served: Served, body: bytes) -> None:
    assert served.request("/command", method="POST", body=body)[0] == 400
    assert served.request("/settings")[0] == 200
    assert served.asked.empty()


@pytest.mark.parametrize(
    "raw", [b"\x00" * 200, b"GET / HTTP/9.9\r\n\r\n", b"GET /" + b"a" * 100_000 + b" HTTP/1.1\r\n\r\n"]
)
def test_what_is_not_http_does_not_stop_the_server(served: Served, raw: bytes) -> None:
    with socket.create_connection(("127.0.0.1", served.service.port), timeout=BOUND_S) as line:
        line.sendall(raw)
        line.shutdown(socket.SHUT_WR)
        while line.recv(65536):
            pass
    assert served.request("/settings")[0] == 200


def test_a_get_is_no_command(served: Served) -> None:
    assert served.request("/command?action=start")[0] == 405
    assert served.asked.empty()


@pytest.mark.parametrize("path", ["/static/../server.py", "/static/%2e%2e/server.py", "/static//etc/passwd"])
def test_no_file_but_the_pages_own_is_served(served: Served, path: str) -> None:
    assert served.request(path)[0] == 404


# ------------------------------------------------------------------------------------------------------------------ live


def test_the_live_view_sends_numbers_events_and_each_frame_once_with_its_corners(served: Served) -> None:
    served.tell(VIEW, CHANGE)
    served.service.frame("down", 8, 7, b"\xff\xd8 a picture")
    served.tell(SEEN)
    with served.live() as line:
        first = json.loads(line.recv(timeout=BOUND_S))
        assert line.recv(timeout=BOUND_S) == b"\xff\xd8 a picture"
        second = json.loads(line.recv(timeout=BOUND_S))
    assert first["mission"]["position_m"] == [3.0, 4.0, -5.0]
    assert first["events"][0]["text"] == "search → approach: pad in sight"
    assert first["shot"]["corners_px"] == [list(corner) for corner in CORNERS]
    assert second["events"] == []
    assert "shot" not in second


def test_updates_come_at_ten_hertz(served: Served) -> None:
    with served.live() as line:
        for _ in range(ATTEMPTS):
            line.recv(timeout=BOUND_S)
            began = time.monotonic()
            for _ in range(10):
                line.recv(timeout=BOUND_S)
            took_s = time.monotonic() - began
            if 0.9 <= took_s < 1.5:
                break
        assert 0.9 <= took_s < 3.0


def test_a_frame_that_comes_as_pixels_is_sent_as_jpeg(served: Served) -> None:
    served.service.frame("down", 8, 7, np.full((48, 64), 90, np.uint8))
    served.tell(PadNotSeen(7, "down", "aruco", "no marker"))
    with served.live() as line:
        assert json.loads(line.recv(timeout=BOUND_S))["shot"]["text"] == "no marker"
        assert line.recv(timeout=BOUND_S)[:2] == b"\xff\xd8"


def test_there_is_an_end_to_the_number_of_viewers(served: Served) -> None:
    lines = [served.live() for _ in range(MOST_VIEWERS)]
    opened = [line.__enter__() for line in lines]
    try:
        with pytest.raises(InvalidStatus), served.live():
            pass
    finally:
        for line in opened:
            line.close()


# --------------------------------------------------------------------------------------------------------------- picture


def test_the_log_of_events_is_bounded_and_nobody_sees_one_twice() -> None:
    picture = Picture(0)
    for number in range(2 * EVENTS_KEPT):
        picture.add(Health(number, "camera", 1, str(number)))
    events = picture.events_after(0)
    assert len(events) == EVENTS_KEPT
    assert picture.events_after(events[-1].number) == []


def test_health_shows_the_latest_of_each_subject() -> None:
    picture = Picture(0)
    picture.add(Health(1, "camera down", 2, "dead"))
    picture.add(Health(2, "mqtt", 0, "connected"))
    picture.add(Health(3, "camera down", 0, "no longer dead"))
    shown = {health["subject"]: health["level"] for health in picture.numbers()["health"]}
    assert shown == {"camera down": 0, "mqtt": 0}


def test_a_setpoint_that_has_expired_is_not_shown() -> None:
    picture = Picture(0)
    picture.add(VelocitySetpoint(1_000_000_000, 1_100_000_000, (1.0, 0.0, 0.0), 0.0))
    assert picture.numbers()["setpoint_m_s"] == [1.0, 0.0, 0.0]
    picture.add(Health(2_000_000_000, "x", 0, ""))
    assert picture.numbers()["setpoint_m_s"] is None


def test_a_frame_without_its_detection_is_not_shown_with_another_ones_corners() -> None:
    picture = Picture(0)
    picture.add_frame(99, b"another")
    picture.add(SEEN)
    assert picture.shot is None


def test_numbers_before_anything_was_heard_are_null_and_not_an_error() -> None:
    numbers = Picture(0).numbers()
    assert numbers["mission"] is numbers["vehicle"] is numbers["pad"] is numbers["status"] is None


# ---------------------------------------------------------------------------------------------------------------- safety


@pytest.mark.parametrize("host", ["0.0.0.0", "192.168.1.7", "::", "drone.local"])
def test_an_address_that_others_reach_needs_tls_or_an_explicit_word(host: str) -> None:
    with pytest.raises(ConfigError, match="insecure = true"):
        check_safety(Dashboard(host=host))
    check_safety(Dashboard(host=host, insecure=True))


def test_a_taken_port_is_an_error_at_the_start(served: Served) -> None:
    with pytest.raises(ConfigError, match="cannot be opened"):
        DashboardService(Config(dashboard=Dashboard(port=served.service.port)), title="second")


def test_a_short_token_is_refused_and_a_good_one_is_used(tmp_path: Path) -> None:
    file = tmp_path / "token"
    file.write_text("secret\n", encoding="ascii")
    with pytest.raises(ConfigError, match="at least 16"):
        DashboardService(Config(dashboard=Dashboard(port=0, token_file=str(file))), title="x")
    file.write_text("a-token-of-some-length\n", encoding="ascii")
    service = DashboardService(Config(dashboard=Dashboard(port=0, token_file=str(file))), title="x")
    assert service.address.endswith("token=a-token-of-some-length")
    service.close()


def test_with_a_certificate_the_page_is_served_over_tls(tmp_path: Path) -> None:
    ssl = pytest.importorskip("ssl")
    command = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-subj", "/CN=localhost", "-days", "2"]
    command += ["-addext", "subjectAltName=IP:127.0.0.1"]
    certificate, key = tmp_path / "cert.pem", tmp_path / "key.pem"
    try:
        subprocess.run([*command, "-keyout", str(key), "-out", str(certificate)], check=True, capture_output=True)
    except FileNotFoundError:
        pytest.skip("openssl is not installed")
    settings = Dashboard(host="0.0.0.0", port=0, certificate_file=str(certificate), key_file=str(key))
    running = Served(DashboardService(Config(dashboard=settings), title="x"))
    context = ssl.create_default_context(cafile=str(certificate))
    line = http.client.HTTPSConnection("127.0.0.1", running.service.port, context=context, timeout=BOUND_S)
    line.request("GET", "/settings", headers={"Authorization": f"Bearer {running.token}"})
    assert line.getresponse().status == 200
    line.close()
    running.service.close()


def test_the_service_ends_quickly_while_somebody_watches() -> None:
    for _ in range(ATTEMPTS):
        running = Served(DashboardService(Config(dashboard=Dashboard(port=0)), title="a test"))
        with running.live() as line:
            line.recv(timeout=BOUND_S)
            began = time.monotonic()
            running.service.close()
            took_s = time.monotonic() - began
        if took_s < 3.0:
            break
    assert took_s < 3.0
