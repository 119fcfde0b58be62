"""Cameras over HTTP on asyncio streams: multipart/x-mixed-replace JPEG, one path a camera.

Each part carries `X-Capture-Time-Boot-Us` (middle of the exposure on the autopilot's boot clock) and `X-Frame-Sequence`.
Several clients may watch one camera; a client that is slow misses pictures and delays nobody. `/` lists the cameras.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Sequence
from dataclasses import dataclass

BOUNDARY = "frame"
_REQUEST_TIMEOUT_S = 5.0
_LARGEST_BACKLOG_BYTES = 65_536


@dataclass(frozen=True, slots=True)
class JpegFrame:
    """One compressed picture."""

    t_capture_us: int
    sequence: int
    data: bytes

    def part(self) -> bytes:
        head = (
            f"--{BOUNDARY}\r\nContent-Type: image/jpeg\r\nContent-Length: {len(self.data)}\r\n"
            f"X-Capture-Time-Boot-Us: {self.t_capture_us}\r\nX-Frame-Sequence: {self.sequence}\r\n\r\n"
        )
        return head.encode() + self.data + b"\r\n"


class Watcher:
    """One client: the newest picture it has not been sent."""

    __slots__ = ("_changed", "_frame", "missed")

    def __init__(self) -> None:
        self._changed = asyncio.Event()
        self._frame: JpegFrame | None = None
        self.missed = 0

    def offer(self, frame: JpegFrame) -> None:
        if self._frame is not None:
            self.missed += 1
        self._frame = frame
        self._changed.set()

    async def next(self) -> JpegFrame:
        while self._frame is None:
            self._changed.clear()
            await self._changed.wait()
        frame, self._frame = self._frame, None
        return frame


class CameraServer:
    """Serves named cameras; `publish` is called by whoever has a picture."""

    def __init__(self, cameras: Sequence[str]) -> None:
        self._watchers: dict[str, set[Watcher]] = {name: set() for name in cameras}
        self._tasks: set[asyncio.Task[None]] = set()
        self._server: asyncio.Server | None = None

    async def start(self, host: str, port: int) -> int:
        """Listen; returns the port (of use where 0 was asked for). Raises OSError where it cannot."""
        self._server = await asyncio.start_server(self._accept, host, port)
        return int(self._server.sockets[0].getsockname()[1])

    async def stop(self) -> None:
        if self._server is not None:
            self._server.close()
        for task in list(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def is_watched(self, camera: str) -> bool:
        return bool(self._watchers[camera])

    def publish(self, camera: str, frame: JpegFrame) -> None:
        for watcher in self._watchers[camera]:
            watcher.offer(frame)

    async def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._tasks.add(task)
        try:
            path = await asyncio.wait_for(_requested_path(reader), _REQUEST_TIMEOUT_S)
            await self._answer(path, writer)
        except asyncio.CancelledError:
            pass  # Only `stop` cancels, and the stream's own callback takes a cancelled task for an accident.
        except (OSError, TimeoutError, asyncio.IncompleteReadError, asyncio.LimitOverrunError, ValueError):
            pass  # The client went away or does not speak HTTP: nothing of ours is wrong.
        finally:
            self._tasks.discard(task)
            writer.close()

    async def _answer(self, path: str, writer: asyncio.StreamWriter) -> None:
        camera = path.strip("/").removesuffix(".mjpg")
        if camera in self._watchers:
            await self._stream(camera, writer)
            return
        found = path == "/"
        body = json.dumps({"cameras": [f"/{name}" for name in self._watchers]}).encode() + b"\n"
        status = "200 OK" if found else "404 Not Found"
        head = f"HTTP/1.1 {status}\r\nContent-Type: application/json\r\nContent-Length: {len(body)}\r\n"
        writer.write(head.encode() + b"Connection: close\r\n\r\n" + body)
        await writer.drain()

    async def _stream(self, camera: str, writer: asyncio.StreamWriter) -> None:
        watcher = Watcher()
        self._watchers[camera].add(watcher)
        # A small backlog: what the client has not taken is dropped here, not kept in buffers until it is old.
        writer.transport.set_write_buffer_limits(high=_LARGEST_BACKLOG_BYTES)
        try:
            content = f"multipart/x-mixed-replace; boundary={BOUNDARY}"
            head = f"HTTP/1.1 200 OK\r\nContent-Type: {content}\r\nCache-Control: no-store\r\nConnection: close\r\n\r\n"
            writer.write(head.encode())
            while not writer.is_closing():
                writer.write((await watcher.next()).part())
                await writer.drain()
        finally:
            self._watchers[camera].discard(watcher)


async def _requested_path(reader: asyncio.StreamReader) -> str:
    """The path of a GET request; ValueError for anything else. The headers are read and not looked at."""
    method, target, *_ = (await reader.readline()).decode("latin-1").split() + ["", ""]
    if method != "GET":
        raise ValueError(f"{method!r} is not GET")
    while (await reader.readline()).strip():
        pass
    return target.partition("?")[0]
