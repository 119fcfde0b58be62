"""MQTT 5: telemetry out, commands and pad beacon in, by the table of telemetry/topics.py.

The control loop only puts messages into a bounded queue; a thread with its own loop connects, encodes, publishes and
reconnects with growing pauses. A dead or slow broker fills the queue: then the oldest goes and is counted. Nothing here raises
into the flight. A command kept by the broker from an earlier time (retained) is never acted on.
"""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import ssl
import time
from collections import deque
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import aiomqtt

from companion import config
from companion.config import ConfigError
from companion.io.side_thread import Ask, SideThread
from companion.messages import Health, Message, OperatorCommand, PadBeacon
from companion.onboard import JournalEntry
from companion.telemetry.topics import (
    BY_CONTENT,
    INCOMING,
    Online,
    RateLimits,
    Refusal,
    Refused,
    Topic,
    name_of,
    payload_of,
    taken,
)

FIRST_PAUSE_S = 0.2
STEADY_S = 5.0
"""A connection that held so long starts with short pauses again."""
GOODBYE_S = 1.0


class Outbox:
    """Messages on their way out. The oldest goes where it is full; `dropped` counts. One thread puts, one takes."""

    def __init__(self, size: int) -> None:
        self.dropped = 0
        self._waiting: deque[Any] = deque(maxlen=size)

    def put(self, message: Any) -> None:
        if len(self._waiting) == self._waiting.maxlen:
            self.dropped += 1
        self._waiting.append(message)

    def take(self) -> Any | None:
        """The oldest; None where there is none."""
        with contextlib.suppress(IndexError):
            return self._waiting.popleft()
        return None

    def __len__(self) -> int:
        return len(self._waiting)


class MqttService:
    """A sink of the live app that also listens. `ConfigError` where the section cannot be used."""

    def __init__(self, settings: config.Mqtt) -> None:
        check_safety(settings)
        self.outbox = Outbox(settings.queue)
        self.published = 0
        self.connections = 0
        self.refused = 0
        self._settings = settings
        self._tls = _tls(settings)
        self._password = _password(settings)
        self._limits = RateLimits()
        self._thread = SideThread("mqtt")
        self._wake = asyncio.Event()
        self._ask: Ask = _nobody
        self._unix_minus_monotonic_ns = time.time_ns() - time.monotonic_ns()
        self._under_way: Any | None = None
        self._kept: dict[str, Any] = {}
        self._told: str | None = None
        self._told_dropped = 0

    # ------------------------------------------------------------------------------------------- in the control thread

    def start(self, ask: Ask) -> None:
        """Begin to connect; commands, beacons and our own health go to `ask`."""
        self._ask = ask
        self._thread.start(self._serve)

    def datagram(self, now_ns: int, data: bytes, *, outgoing: bool) -> None:
        """Bytes are of no interest here."""

    def journal(self, entries: Sequence[JournalEntry]) -> None:
        self.put(*(entry.message for entry in entries))

    def put(self, *messages: Message) -> None:
        """Queue what is due; never waits."""
        due = [message for message in messages if self._limits.passes(message)]
        for message in due:
            self.outbox.put(message)
        if due:
            self._thread.call(self._wake.set)

    def close(self) -> None:
        self._thread.stop()

    # ---------------------------------------------------------------------------------------------- in the side thread

    async def _serve(self) -> None:
        """Connect for ever."""
        pause_s = FIRST_PAUSE_S
        while True:
            began = time.monotonic()
            try:
                await self._converse()
            except Exception as error:  # whatever it is, it must not end telemetry for the rest of the flight
                self._tell(1, f"{self._address}: {str(error) or type(error).__name__}; trying again")
            if time.monotonic() - began > STEADY_S:
                pause_s = FIRST_PAUSE_S
            await asyncio.sleep(pause_s)
            pause_s = min(2.0 * pause_s, self._settings.max_backoff_s)

    async def _converse(self) -> None:
        """One connection, until it breaks."""
        async with self._client() as client:
            self.connections += 1
            for message in (Online(True), *self._kept.values()):
                await self._publish(client, message)
            for name in self._settings.accept:
                await client.subscribe(self._full(name), qos=INCOMING[name].qos)
            self._tell(0, f"{self._address}: connected")
            listener = asyncio.create_task(self._listen(client))
            try:
                await self._publish_all(client, listener)
            finally:
                listener.cancel()
                await self._say_goodbye(client)

    def _client(self) -> aiomqtt.Client:
        settings = self._settings
        online = BY_CONTENT[Online]
        return aiomqtt.Client(
            settings.host,
            settings.port,
            protocol=aiomqtt.ProtocolVersion.V5,
            identifier=settings.client_id or None,
            username=settings.user,
            password=self._password,
            tls_context=self._tls,
            keepalive=settings.keepalive_s,
            timeout=settings.timeout_s,
            clean_start=True,
            max_queued_outgoing_messages=20,
            will=aiomqtt.Will(
                self._full(online.name), self._payload(Online(False)), qos=online.qos, retain=online.is_retained
            ),
        )

    async def _publish_all(self, client: aiomqtt.Client, listener: asyncio.Task[None]) -> None:
        while not listener.done():
            self._under_way = self._under_way or self.outbox.take()
            if self._under_way is None:
                self._wake.clear()
                if not len(self.outbox):
                    await self._until_something(listener)
                continue
            await self._publish(client, self._under_way)
            self._keep(self._under_way)
            self._under_way = None
            self._tell_dropped()
        listener.result()

    async def _until_something(self, listener: asyncio.Task[None]) -> None:
        waiting = asyncio.create_task(self._wake.wait())
        try:
            await asyncio.wait((waiting, listener), return_when=asyncio.FIRST_COMPLETED)
        finally:
            waiting.cancel()

    async def _publish(self, client: aiomqtt.Client, message: Any) -> None:
        topic: Topic = BY_CONTENT[type(message)]
        name = self._full(name_of(topic, message))
        await client.publish(name, self._payload(message), qos=topic.qos, retain=topic.is_retained)
        self.published += 1

    def _keep(self, message: Any) -> None:
        """A broker that was restarted may have forgotten what it should retain: it is told again."""
        topic = BY_CONTENT[type(message)]
        if topic.is_retained:
            self._kept[name_of(topic, message)] = message

    async def _listen(self, client: aiomqtt.Client) -> None:
        async for received in client.messages:
            name = received.topic.value.removeprefix(f"{self._settings.prefix}/")
            try:
                if received.retain:
                    raise Refused("kept by the broker from an earlier time (retained)")
                self._ask(self._taken(name, received.payload))
            except Refused as error:
                self._refuse(name, str(error))

    def _taken(self, name: str, payload: object) -> OperatorCommand | PadBeacon:
        content = bytes(payload) if isinstance(payload, bytes | bytearray) else str(payload or "").encode()
        return taken(name, content, now_ns=time.monotonic_ns(), unix_minus_monotonic_ns=self._unix_minus_monotonic_ns)

    def _refuse(self, name: str, reason: str) -> None:
        self.refused += 1
        self.outbox.put(Refusal(time.time_ns(), name, reason[:200]))
        self._wake.set()

    async def _say_goodbye(self, client: aiomqtt.Client) -> None:
        """An orderly end does not trigger the last will: say it ourselves, if the broker still listens."""
        with contextlib.suppress(aiomqtt.MqttError, OSError, TimeoutError):
            async with asyncio.timeout(GOODBYE_S):
                await self._publish(client, Online(False))

    def _payload(self, message: Any) -> bytes:
        return payload_of(message, unix_minus_monotonic_ns=self._unix_minus_monotonic_ns)

    def _full(self, name: str) -> str:
        return f"{self._settings.prefix}/{name}"

    @property
    def _address(self) -> str:
        return f"{self._settings.host}:{self._settings.port}"

    def _tell(self, level: int, text: str) -> None:
        """Once for each change: a broker that is away for an hour is one line."""
        if text != self._told:
            self._told = text
            self._ask(Health(time.monotonic_ns(), "mqtt", level, text))

    def _tell_dropped(self) -> None:
        """Once the queue has emptied again, how many were lost."""
        if len(self.outbox) or self.outbox.dropped == self._told_dropped:
            return
        lost, self._told_dropped = self.outbox.dropped - self._told_dropped, self.outbox.dropped
        text = f"{lost} messages dropped while the broker was slow or away"
        self._ask(Health(time.monotonic_ns(), "mqtt queue", 1, text, float(lost)))


def check_safety(settings: config.Mqtt) -> None:
    """Who reaches the broker can start and abort flights: elsewhere than here, only with TLS and a user."""
    if is_loopback(settings.host) or settings.insecure or (settings.tls and settings.user):
        return
    raise ConfigError(
        f"[mqtt] host = {settings.host!r} is another computer: set tls = true, user and password_file, "
        f"or insecure = true where the network is yours alone"
    )


def is_loopback(host: str) -> bool:
    """Whether the address stays on this computer."""
    if host == "localhost":
        return True
    with contextlib.suppress(ValueError):
        return ipaddress.ip_address(host).is_loopback
    return False


def _tls(settings: config.Mqtt) -> ssl.SSLContext | None:
    if not settings.tls:
        return None
    try:
        context = ssl.create_default_context(cafile=settings.ca_file)
        if settings.certificate_file is not None:
            context.load_cert_chain(settings.certificate_file, settings.key_file)
    except OSError as error:
        raise ConfigError(f"[mqtt] ca_file, certificate_file, key_file: {error}") from error
    return context


def _password(settings: config.Mqtt) -> str | None:
    if settings.password_file is None:
        return None
    try:
        return Path(settings.password_file).read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"[mqtt] password_file = {settings.password_file!r}: {error}") from error


def _nobody(message: object) -> None:
    """Before `start`."""
