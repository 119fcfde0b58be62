"""The page as a sink of the live app: gathers, and serves from a thread with its own loop (measured: benchmarks/setpoint_timing.py).

The socket is opened here, at once, so that a taken port is an error at the start and not silence later. In a thread that is
not the main one uvicorn leaves signals alone.
"""

from __future__ import annotations

import secrets
import socket
import ssl
import time
from collections.abc import Sequence
from pathlib import Path

import uvicorn

from companion import config
from companion.config import Config, ConfigError
from companion.io.mqtt import is_loopback
from companion.io.side_thread import Ask, SideThread
from companion.messages import Image
from companion.onboard import JournalEntry
from companion.telemetry.dashboard.picture import Picture, settings_of
from companion.telemetry.dashboard.server import make_app

SHORTEST_TOKEN = 16


class DashboardService:
    """Opens its port when it is made. `ConfigError` where the section cannot be used or the port is taken."""

    def __init__(self, settings: Config, *, title: str) -> None:
        check_safety(settings.dashboard)
        self._settings = settings.dashboard
        self._about = settings_of(settings, title)
        self._picture = Picture(time.monotonic_ns())
        self._token = _token(settings.dashboard)
        self._socket = _listening(settings.dashboard)
        self._thread = SideThread("dashboard")
        self._server: uvicorn.Server | None = None

    @property
    def port(self) -> int:
        return int(self._socket.getsockname()[1])

    @property
    def address(self) -> str:
        """For a person's browser, token included."""
        scheme = "https" if self._settings.certificate_file else "http"
        host = "127.0.0.1" if self._settings.host in ("0.0.0.0", "::") else self._settings.host
        host = f"[{host}]" if ":" in host else host
        return f"{scheme}://{host}:{self.port}/?token={self._token}"

    def start(self, ask: Ask) -> None:
        app = make_app(
            self._picture,
            self._about,
            ask,
            token=self._token,
            cookie=f"companion_{self.port}",
            rate_hz=self._settings.rate_hz,
        )
        options = uvicorn.Config(
            app,
            log_config=None,
            access_log=False,
            lifespan="off",
            ws_max_size=1000,
            ws_per_message_deflate=False,
            timeout_graceful_shutdown=1,
            ssl_certfile=self._settings.certificate_file,
            ssl_keyfile=self._settings.key_file,
        )
        server = uvicorn.Server(options)
        self._server = server
        self._thread.start(lambda: server.serve(sockets=[self._socket]))

    def datagram(self, now_ns: int, data: bytes, *, outgoing: bool) -> None:
        """Bytes are of no interest here."""

    def journal(self, entries: Sequence[JournalEntry]) -> None:
        for entry in entries:
            self._picture.add(entry.message)

    def frame(self, camera: str, arrived_ns: int, t_ns: int, content: Image | bytes) -> None:
        self._picture.add_frame(t_ns, content)

    def close(self) -> None:
        if self._server is not None:
            self._server.should_exit = True
            if not self._thread.join():
                self._thread.stop()
        self._socket.close()


def check_safety(settings: config.Dashboard) -> None:
    """Who reaches the page with its token can fly: over the network only with TLS, or by an explicit word."""
    if (settings.certificate_file is None) != (settings.key_file is None):
        raise ConfigError("[dashboard] certificate_file and key_file belong together")
    if settings.certificate_file is not None and settings.key_file is not None:
        _check_certificate(settings.certificate_file, settings.key_file)
    elif not is_loopback(settings.host) and not settings.insecure:
        raise ConfigError(
            f"[dashboard] host = {settings.host!r} can be reached from other computers: set certificate_file and "
            f"key_file, or insecure = true where the network is yours alone"
        )


def _check_certificate(certificate_file: str, key_file: str) -> None:
    try:
        ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(certificate_file, key_file)
    except OSError as error:
        raise ConfigError(f"[dashboard] certificate_file, key_file: {error}") from error


def _token(settings: config.Dashboard) -> str:
    if settings.token_file is None:
        return secrets.token_urlsafe(24)
    try:
        token = Path(settings.token_file).read_text(encoding="ascii").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"[dashboard] token_file = {settings.token_file!r}: {error}") from error
    if len(token) < SHORTEST_TOKEN or not all(c.isalnum() or c in "-_" for c in token):
        raise ConfigError(
            f"[dashboard] token_file = {settings.token_file!r}: at least {SHORTEST_TOKEN} letters, digits, - and _"
        )
    return token


def _listening(settings: config.Dashboard) -> socket.socket:
    family = socket.AF_INET6 if ":" in settings.host else socket.AF_INET
    try:
        return socket.create_server((settings.host, settings.port), family=family)
    except OSError as error:
        raise ConfigError(
            f"[dashboard] {settings.host}:{settings.port} cannot be opened: {error.strerror or error}; "
            f"port = 0 takes a free one"
        ) from error
