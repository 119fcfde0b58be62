"""MQTT against a real mosquitto: out, in, killed and restarted, stalled, TLS and password. Virtual time does not apply: waits are for
events, each with a bound."""

from __future__ import annotations

import asyncio
import contextlib
import json
import queue
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import aiomqtt
import pytest

from companion.config import ConfigError, Mqtt
from companion.io.mqtt import MqttService, Outbox, check_safety
from companion.messages import Health, OperatorAction, OperatorCommand, PadBeacon, Phase, PhaseChanged, VehicleState
from companion.telemetry.topics import INCOMING

MOSQUITTO = shutil.which("mosquitto", path="/usr/sbin:/usr/local/sbin:/usr/bin:/usr/local/bin:/opt/homebrew/sbin")
BOUND_S = 30.0
needs_mosquitto = pytest.mark.skipif(
    MOSQUITTO is None, reason="mosquitto is not installed (.ci/system-packages installs it)"
)


class Broker:
    """mosquitto on a free port of the loopback."""

    def __init__(self, folder: Path, extra: str = "") -> None:
        self._file = folder / "mosquitto.conf"
        self._extra = extra or "allow_anonymous true\n"
        self._choose_port()
        self._process: subprocess.Popen[bytes] | None = None

    def _choose_port(self) -> None:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.port = int(probe.getsockname()[1])
        self._file.write_text(f"listener {self.port} 127.0.0.1\n{self._extra}", encoding="utf-8")

    def start(self) -> None:
        assert MOSQUITTO is not None
        command = [MOSQUITTO, "-c", str(self._file)]
        self._process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        deadline = time.monotonic() + BOUND_S
        while True:
            assert time.monotonic() < deadline, "mosquitto does not listen"
            assert self._process.poll() is None, f"mosquitto ended: is port {self.port} taken?"
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", self.port), timeout=1.0):
                return
            time.sleep(0.02)

    def send(self, number: signal.Signals) -> None:
        assert self._process is not None
        self._process.send_signal(number)

    def kill(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None


class Inbox:
    """What the service handed in. What a wait passes over is kept for the next one: two threads do not agree on an order."""

    def __init__(self) -> None:
        self._queue: queue.Queue[OperatorCommand | PadBeacon | Health] = queue.Queue()
        self._passed_over: list[OperatorCommand | PadBeacon | Health] = []

    def __call__(self, message: OperatorCommand | PadBeacon | Health) -> None:
        self._queue.put(message)

    def until(self, wanted: Callable[[object], bool]) -> object:
        for message in self._passed_over:
            if wanted(message):
                self._passed_over.remove(message)
                return message
        deadline = time.monotonic() + BOUND_S
        while True:
            message = self._queue.get(timeout=max(0.01, deadline - time.monotonic()))
            if wanted(message):
                return message
            self._passed_over.append(message)


class Watcher:
    """Another client, in its own thread: everything below the prefix."""

    def __init__(self, broker: Broker, **options: object) -> None:
        self._queue: queue.Queue[tuple[str, dict]] = queue.Queue()
        self._options = options
        self._port = broker.port
        self._ready = threading.Event()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=lambda: self._loop.run_until_complete(self._watch()), daemon=True)

    def __enter__(self) -> Watcher:
        self._thread.start()
        assert self._ready.wait(BOUND_S)
        return self

    def __exit__(self, *_: object) -> None:
        self._loop.call_soon_threadsafe(self._task.cancel)
        self._thread.join(BOUND_S)
        self._loop.close()

    async def _watch(self) -> None:
        self._task = asyncio.current_task()
        try:
            async with aiomqtt.Client("127.0.0.1", self._port, **self._options) as self._client:
                await self._client.subscribe("companion/#")
                self._ready.set()
                async for message in self._client.messages:
                    if message.topic.value.removeprefix("companion/") not in INCOMING:
                        self._queue.put((message.topic.value, json.loads(message.payload)))
        except (asyncio.CancelledError, aiomqtt.MqttError):
            pass

    def say(self, topic: str, payload: bytes, *, retain: bool = False) -> None:
        future = asyncio.run_coroutine_threadsafe(self._client.publish(topic, payload, 1, retain), self._loop)
        future.result(BOUND_S)

    def until(self, topic: str, wanted: Callable[[dict], bool] = lambda content: True) -> dict:
        deadline = time.monotonic() + BOUND_S
        while True:
            name, content = self._queue.get(timeout=max(0.01, deadline - time.monotonic()))
            if name == f"companion/{topic}" and wanted(content):
                return content


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Broker]:
    running = Broker(tmp_path)
    running.start()
    yield running
    running.kill()


@pytest.fixture
def inbox() -> Inbox:
    return Inbox()


@pytest.fixture
def service(broker: Broker, inbox: Inbox) -> Iterator[MqttService]:
    running = MqttService(Mqtt(enabled=True, port=broker.port, max_backoff_s=0.5, timeout_s=1.0))
    running.start(inbox)
    inbox.until(is_connected)
    yield running
    running.close()


def is_connected(message: object) -> bool:
    return isinstance(message, Health) and "connected" in message.text


def state(t_ns: int) -> VehicleState:
    return VehicleState(t_ns, (1.0, 2.0, -3.0), (0.1, 0.2, 0.3), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


CHANGE = PhaseChanged(1, Phase.SEARCH, Phase.APPROACH, "pad in sight")


@needs_mosquitto
def test_state_and_phase_reach_a_subscriber(broker: Broker, service: MqttService) -> None:
    with Watcher(broker) as watcher:
        assert watcher.until("online") == {"online": True}
        service.put(state(1), CHANGE)
        assert watcher.until("state")["position_ned_m"] == [1.0, 2.0, -3.0]
        assert watcher.until("phase")["after"] == "approach"


@needs_mosquitto
def test_who_comes_late_is_told_the_phase(broker: Broker, service: MqttService) -> None:
    with Watcher(broker) as first:
        service.put(CHANGE)
        first.until("phase")
    with Watcher(broker) as late:
        assert late.until("phase")["reason"] == "pad in sight"


@needs_mosquitto
def test_a_command_and_a_beacon_come_in(broker: Broker, service: MqttService, inbox: Inbox) -> None:
    with Watcher(broker) as watcher:
        watcher.say("companion/command", b'{"action": "abort", "source": "tower"}')
        command = inbox.until(lambda message: isinstance(message, OperatorCommand))
        assert (command.action, command.source) == (OperatorAction.ABORT, "tower")
        watcher.say("companion/pad", b'{"position_ned_m": [4, 5, 0], "velocity_ned_m_s": [1, 0, 0]}')
        beacon = inbox.until(lambda message: isinstance(message, PadBeacon))
        assert beacon.position_ned_m == (4.0, 5.0, 0.0)


@needs_mosquitto
def test_a_hostile_message_is_refused_aloud_and_the_next_good_one_is_taken(
    broker: Broker, service: MqttService, inbox: Inbox
) -> None:
    with Watcher(broker) as watcher:
        watcher.say("companion/command", b"\xff\x00" * 1000)
        assert watcher.until("event/refused")["topic"] == "command"
        watcher.say("companion/command", b'{"action": "hold"}')
        command = inbox.until(lambda message: isinstance(message, OperatorCommand))
        assert command.action is OperatorAction.HOLD
    assert service.refused == 1


@needs_mosquitto
def test_a_retained_start_of_yesterday_starts_nothing(broker: Broker, inbox: Inbox) -> None:
    with Watcher(broker) as watcher:
        watcher.say("companion/command", b'{"action": "start"}', retain=True)
        service = MqttService(Mqtt(enabled=True, port=broker.port))
        service.start(inbox)
        assert "retained" in watcher.until("event/refused")["reason"]
        watcher.say("companion/command", b'{"action": "hold"}')
        first = inbox.until(lambda message: isinstance(message, OperatorCommand))
        service.close()
    assert first.action is OperatorAction.HOLD


@needs_mosquitto
def test_the_broker_is_killed_and_restarted_and_both_directions_work_again(
    broker: Broker, service: MqttService, inbox: Inbox
) -> None:
    service.put(CHANGE)
    with Watcher(broker) as watcher:
        watcher.until("phase")
    broker.kill()
    inbox.until(lambda message: isinstance(message, Health) and message.level == 1)
    for index in range(1000):
        service.put(state(index * 1_000_000_000))
    assert len(service.outbox) == 256
    broker.start()
    inbox.until(is_connected)
    with Watcher(broker) as watcher:
        assert watcher.until("phase")["after"] == "approach", "the new broker has been told again"
        watcher.say("companion/command", b'{"action": "return"}')
        command = inbox.until(lambda message: isinstance(message, OperatorCommand))
        assert command.action is OperatorAction.RETURN
    lost = inbox.until(lambda message: isinstance(message, Health) and message.subject == "mqtt queue")
    assert lost.value == service.outbox.dropped >= 1000 - 256 - 1
    assert service.connections >= 2


@needs_mosquitto
def test_a_broker_that_stalls_delays_nobody_and_the_oldest_go(
    broker: Broker, service: MqttService, inbox: Inbox
) -> None:
    broker.send(signal.SIGSTOP)
    longest_s = [longest_put_s(service, 4000) for _ in range(5)]
    assert service.outbox.dropped > 0
    assert len(service.outbox) <= 256
    broker.send(signal.SIGCONT)
    inbox.until(lambda message: isinstance(message, Health) and message.subject == "mqtt queue")
    # The broker is stopped: a put that waited for it could end with the time-out of 1 s only, in each of the five rounds. In one of
    # them a busy machine may let this thread wait as long.
    assert min(longest_s) < 0.9, "a put never waits for the broker, whose timeout is 1 s"


def longest_put_s(service: MqttService, count: int) -> float:
    longest_s = 0.0
    for index in range(count):
        began = time.perf_counter()
        service.put(PhaseChanged(index, Phase.FOLLOW, Phase.DESCEND, "x" * 1000))
        longest_s = max(longest_s, time.perf_counter() - began)
    return longest_s


@needs_mosquitto
def test_the_last_will_says_that_companion_is_gone(broker: Broker, tmp_path: Path) -> None:
    program = (
        "import time\nfrom companion.config import Mqtt\nfrom companion.io.mqtt import MqttService\n"
        f"service = MqttService(Mqtt(enabled=True, port={broker.port}))\nservice.start(lambda message: None)\n"
        "time.sleep(60)\n"
    )
    with Watcher(broker) as watcher:
        child = subprocess.Popen([sys.executable, "-c", program])
        watcher.until("online", lambda content: content["online"])
        child.kill()
        child.wait()
        watcher.until("online", lambda content: not content["online"])


@needs_mosquitto
def test_an_orderly_end_says_so_too(broker: Broker, service: MqttService) -> None:
    with Watcher(broker) as watcher:
        watcher.until("online", lambda content: content["online"])
        service.close()
        watcher.until("online", lambda content: not content["online"])


def _certificate(folder: Path) -> None:
    subprocess.run(
        ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=localhost"]
        + ["-addext", "subjectAltName=DNS:localhost,IP:127.0.0.1"]
        + ["-keyout", str(folder / "key.pem"), "-out", str(folder / "cert.pem")],
        check=True,
        capture_output=True,
    )


@needs_mosquitto
@pytest.mark.skipif(
    shutil.which("openssl") is None or shutil.which("mosquitto_passwd") is None,
    reason="needs openssl and mosquitto_passwd",
)
def test_tls_with_user_and_password_works_and_a_wrong_password_says_so(tmp_path: Path, inbox: Inbox) -> None:
    _certificate(tmp_path)
    passwords = tmp_path / "passwords"
    subprocess.run(["mosquitto_passwd", "-b", "-c", str(passwords), "drone", "right"], check=True, capture_output=True)
    passwords.chmod(0o644)
    (tmp_path / "key.pem").chmod(0o644)
    tmp_path.chmod(0o755)
    for parent in tmp_path.parents[:3]:
        if parent != Path("/tmp"):
            parent.chmod(0o755)  # mosquitto gives up its rights before it reads the files
    broker = Broker(
        tmp_path,
        f"allow_anonymous false\npassword_file {passwords}\ncafile {tmp_path}/cert.pem\n"
        f"certfile {tmp_path}/cert.pem\nkeyfile {tmp_path}/key.pem\n",
    )
    secret = tmp_path / "secret"
    secret.write_text("wrong\n", encoding="utf-8")
    settings = {
        "enabled": True,
        "port": broker.port,
        "tls": True,
        "ca_file": str(tmp_path / "cert.pem"),
        "user": "drone",
    }
    broker.start()
    try:
        mistaken = MqttService(Mqtt(**settings, password_file=str(secret)))
        mistaken.start(inbox)
        refusal = inbox.until(lambda message: isinstance(message, Health) and message.level == 1)
        mistaken.close()
        secret.write_text("right\n", encoding="utf-8")
        service = MqttService(Mqtt(**settings, password_file=str(secret)))
        service.start(inbox)
        inbox.until(is_connected)
        service.close()
    finally:
        broker.kill()
    assert "authori" in refusal.text.lower()


def test_without_a_broker_the_end_of_a_run_does_not_wait(inbox: Inbox) -> None:
    took_s = []
    for _ in range(5):  # a busy machine may spoil one
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            service = MqttService(Mqtt(enabled=True, port=probe.getsockname()[1]))
            service.start(inbox)
            inbox.until(lambda message: isinstance(message, Health) and message.level == 1)
            began = time.monotonic()
            service.close()
            took_s.append(time.monotonic() - began)
    assert min(took_s) < 2.0


def test_a_full_outbox_lets_the_oldest_go_and_counts() -> None:
    outbox = Outbox(3)
    for number in range(10):
        outbox.put(number)
    assert [outbox.take() for _ in range(4)] == [7, 8, 9, None]
    assert outbox.dropped == 7


@pytest.mark.parametrize(
    ("settings", "is_fine"),
    [
        (Mqtt(host="localhost"), True),
        (Mqtt(host="::1"), True),
        (Mqtt(host="broker.example.org"), False),
        (Mqtt(host="192.168.1.2", tls=True), False),
        (Mqtt(host="192.168.1.2", tls=True, user="drone"), True),
        (Mqtt(host="192.168.1.2", insecure=True), True),
    ],
)
def test_a_broker_elsewhere_needs_tls_and_a_user_or_an_explicit_word(settings: Mqtt, is_fine: bool) -> None:
    if is_fine:
        check_safety(settings)
        return
    with pytest.raises(ConfigError, match="insecure = true"):
        check_safety(settings)


def test_files_that_are_not_there_are_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="password_file"):
        MqttService(Mqtt(password_file=str(tmp_path / "none")))
    with pytest.raises(ConfigError, match="ca_file"):
        MqttService(Mqtt(tls=True, ca_file=str(tmp_path / "none")))
