"""What the service manager is told, over a real datagram socket."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from companion.io.service_manager import ServiceManager, service_manager
from companion.messages import Message, Phase, PhaseChanged, Tick
from companion.onboard import JournalEntry

pytestmark = pytest.mark.sockets
PERIOD_NS = 20_000_000


@pytest.fixture
def systemd(tmp_path: Path) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        listening.bind(str(tmp_path / "notify"))
        listening.settimeout(20.0)
        yield listening


def told(systemd: socket.socket) -> list[str]:
    """Everything that waits."""
    systemd.setblocking(False)
    said = []
    while True:
        try:
            said.append(systemd.recv(4096).decode())
        except BlockingIOError:
            return said


def entry(message: Message) -> JournalEntry:
    return JournalEntry(1, message.t_ns, "in", None, message)


def ticks(seconds: float, *, start_ns: int = 0) -> list[JournalEntry]:
    return [entry(Tick(start_ns + i * PERIOD_NS)) for i in range(round(seconds * 50))]


def manager(systemd: socket.socket, timeout_us: int | None = 2_000_000) -> closing[ServiceManager]:
    return closing(ServiceManager(systemd.getsockname(), timeout_us=timeout_us))


def test_ready_comes_with_the_first_tick_and_signs_of_life_four_times_a_timeout(systemd: socket.socket) -> None:
    with manager(systemd) as telling:
        telling.journal(ticks(2.0))
        said = told(systemd)
    assert said[0].startswith("READY=1")
    assert said[1:] == ["WATCHDOG=1"] * 4


def test_without_ticks_there_is_no_sign_of_life_whatever_else_happens(systemd: socket.socket) -> None:
    with manager(systemd) as telling:
        telling.journal([entry(PhaseChanged(t, Phase.IDLE, Phase.HOLD, "test")) for t in range(0, 10**10, 2 * 10**9)])
        telling.datagram(10**10, b"heartbeat", outgoing=False)
        assert told(systemd) == ["STATUS=hold: test"] * 5


def test_without_a_watchdog_it_says_ready_and_stopping_only(systemd: socket.socket) -> None:
    with manager(systemd, None) as telling:
        telling.journal(ticks(5.0))
    assert [text.split("\n")[0] for text in told(systemd)] == ["READY=1", "STOPPING=1"]


def test_a_manager_that_is_gone_or_does_not_read_disturbs_nobody(systemd: socket.socket) -> None:
    with manager(systemd, 4) as telling:
        telling.journal(ticks(60.0))
        systemd.close()
        telling.journal(ticks(60.0, start_ns=10**12))


def test_the_environment_decides() -> None:
    assert service_manager({}) is None
    assert service_manager({"NOTIFY_SOCKET": "vsock:2:1234"}) is None
    found = service_manager({"NOTIFY_SOCKET": "@abstract", "WATCHDOG_USEC": "100"})
    assert found is not None
    found.close()


def test_a_service_that_is_frozen_falls_silent_and_ends_in_order(systemd: socket.socket, tmp_path: Path) -> None:
    environment = {**os.environ, "NOTIFY_SOCKET": systemd.getsockname(), "WATCHDOG_USEC": "400000"}
    command = [sys.executable, "-m", "companion", "run", "--quiet", "--runs", str(tmp_path)]
    command += [
        "--set",
        f"link.url=udpin://127.0.0.1:{free_port()}",
        "--set",
        "cameras.down.source=http://127.0.0.1:9/down",
    ]
    with subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL) as app:
        try:
            assert systemd.recv(4096).startswith(b"READY=1")
            assert [systemd.recv(4096) for _ in range(5)] == [b"WATCHDOG=1"] * 5
            app.send_signal(signal.SIGSTOP)
            told(systemd)
            systemd.settimeout(0.6)
            with pytest.raises(TimeoutError):
                systemd.recv(4096)
            app.send_signal(signal.SIGCONT)
            systemd.settimeout(20.0)
            assert systemd.recv(4096) == b"WATCHDOG=1"
            app.send_signal(signal.SIGTERM)
            said = b""
            while said != b"STOPPING=1":
                said = systemd.recv(4096)
            assert app.wait(20.0) == 1
        finally:
            app.kill()


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
