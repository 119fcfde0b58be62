"""HTTP and websocket of the page: routes and who may use them. Known to nobody but dashboard/service.py.

    GET  /            the page; with ?token=... it leaves a cookie and the token goes from the address bar
    GET  /static/...  its script and style; nothing comes from another computer
    GET  /settings    what does not change during a run
    WS   /live        10 times a second: a text message with numbers and new events, a binary one (JPEG) with each new frame
    POST /command     {"action": "start" | "hold" | "go_around" | "abort" | "return"}

Everything needs the token (cookie, or `Authorization: Bearer`); pages of other origins are refused, cookie or not.
"""

from __future__ import annotations

import asyncio
import hmac
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import cv2
import msgspec
from starlette.applications import Starlette
from starlette.datastructures import Headers
from starlette.requests import HTTPConnection, Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect

from companion.messages import OperatorAction, OperatorCommand
from companion.telemetry.dashboard.picture import Picture, Shot

STATIC = Path(__file__).parent / "static"
MOST_VIEWERS = 8
LARGEST_BODY = 1000
JPEG_QUALITY = 80
HEADERS = {
    b"content-security-policy": b"default-src 'self'; img-src 'self' blob:; frame-ancestors 'none'; base-uri 'none'",
    b"x-content-type-options": b"nosniff",
    b"referrer-policy": b"no-referrer",
    b"cache-control": b"no-store",
}


class Wanted(msgspec.Struct, forbid_unknown_fields=True):
    """Body of POST /command."""

    action: OperatorAction


class Gate:
    """Lets through who has the token and comes from our own page."""

    def __init__(self, app: ASGIApp, token: str, cookie: str) -> None:
        self._app, self._token, self._cookie = app, token.encode(), cookie

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            return
        connection = HTTPConnection(scope)
        if not _same_origin(connection.headers):
            await _refuse(scope, receive, send, 403, "pages of another origin may not talk to Companion")
        elif self._is_entry(connection):
            await self._welcome()(scope, receive, send)
        elif self._has_token(connection):
            await self._app(scope, receive, _with_headers(send))
        else:
            await _refuse(scope, receive, send, 401, "open the address with the token that Companion's terminal shows")

    def _is_entry(self, connection: HTTPConnection) -> bool:
        asked = connection.query_params.get("token")
        is_page = connection.scope["type"] == "http" and connection.url.path == "/"
        return is_page and asked is not None and self._matches(asked)

    def _welcome(self) -> Response:
        response = RedirectResponse("/", status_code=303, headers={"cache-control": "no-store"})
        response.set_cookie(self._cookie, self._token.decode(), httponly=True, samesite="strict")
        return response

    def _has_token(self, connection: HTTPConnection) -> bool:
        bearer = connection.headers.get("authorization", "").removeprefix("Bearer ")
        return self._matches(bearer) or self._matches(connection.cookies.get(self._cookie, ""))

    def _matches(self, text: str) -> bool:
        return hmac.compare_digest(text.encode("utf-8", "replace"), self._token)


def make_app(
    picture: Picture,
    settings: dict[str, Any],
    ask: Callable[[OperatorCommand], None],
    *,
    token: str,
    cookie: str,
    rate_hz: float,
) -> ASGIApp:
    """The whole server as an ASGI application."""
    viewers: set[WebSocket] = set()

    async def page(request: Request) -> Response:
        return FileResponse(STATIC / "index.html")

    async def show_settings(request: Request) -> Response:
        return JSONResponse(settings)

    async def command(request: Request) -> Response:
        body = await _body(request)
        try:
            action = msgspec.json.decode(body, type=Wanted).action
        except (msgspec.DecodeError, RecursionError) as error:
            return PlainTextResponse(f"not taken: {error}", status_code=400)
        client = request.client.host if request.client is not None else "?"
        ask(OperatorCommand(time.monotonic_ns(), action, f"page {client}"))
        return JSONResponse({"taken": str(action)}, status_code=202)

    async def live(socket: WebSocket) -> None:
        if len(viewers) >= MOST_VIEWERS:
            await socket.close(1013, f"{MOST_VIEWERS} viewers already")
            return
        await socket.accept()
        viewers.add(socket)
        try:
            await _watch(socket, picture, rate_hz)
        finally:
            viewers.discard(socket)

    routes = [
        Route("/", page),
        Route("/settings", show_settings),
        Route("/command", command, methods=["POST"]),
        WebSocketRoute("/live", live),
        Mount("/static", StaticFiles(directory=STATIC)),
    ]
    return Gate(Starlette(routes=routes), token, cookie)


async def _body(request: Request) -> bytes:
    """The first bytes; a longer body is cut and then is not JSON."""
    content = b""
    async for part in request.stream():
        content += part
        if len(content) > LARGEST_BODY:
            return b"too long"
    return content


async def _watch(socket: WebSocket, picture: Picture, rate_hz: float) -> None:
    """Send until the viewer is gone. A slow viewer gets fewer updates, not older ones."""
    gone = asyncio.create_task(_until_gone(socket))
    last_event, last_shot_ns = 0, None
    now_s = asyncio.get_running_loop().time
    due_s = now_s()
    try:
        while not gone.done():
            events = picture.events_after(last_event)
            last_event = events[-1].number if events else last_event
            shot = picture.shot
            is_new = shot is not None and shot.t_ns != last_shot_ns
            content = {**picture.numbers(), "events": [asdict(event) for event in events]}
            if shot is not None and is_new:
                last_shot_ns = shot.t_ns
                content["shot"] = {"corners_px": shot.corners_px, "text": shot.text}
            await socket.send_text(msgspec.json.encode(content).decode())
            if shot is not None and is_new:
                await socket.send_bytes(_jpeg(shot))
            due_s = max(due_s + 1.0 / rate_hz, now_s())
            await asyncio.wait((gone,), timeout=due_s - now_s())
    except (WebSocketDisconnect, RuntimeError):  # starlette: sending after the close
        pass
    finally:
        gone.cancel()


async def _until_gone(socket: WebSocket) -> None:
    """What a viewer says is of no interest; commands are POSTs."""
    while (await socket.receive())["type"] != "websocket.disconnect":
        pass


def _jpeg(shot: Shot) -> bytes:
    if isinstance(shot.content, bytes):
        return shot.content
    _, data = cv2.imencode(".jpg", shot.content, (cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY))
    return data.tobytes()


def _same_origin(headers: Headers) -> bool:
    """Browsers name the page that asks; programs that are no browsers do not."""
    origin = headers.get("origin")
    return origin is None or urlsplit(origin).netloc == headers.get("host")


def _with_headers(send: Send) -> Send:
    async def guarded(message: Message) -> None:
        if message["type"] == "http.response.start":
            message = {**message, "headers": [*message.get("headers", ()), *HEADERS.items()]}
        await send(message)

    return guarded


async def _refuse(scope: Scope, receive: Receive, send: Send, status: int, text: str) -> None:
    if scope["type"] == "websocket":
        await WebSocket(scope, receive, send).close(1008, text)
        return
    await PlainTextResponse(text + "\n", status_code=status)(scope, receive, send)
