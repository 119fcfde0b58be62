"""A camera over HTTP: multipart JPEG with the capture time of every frame in its headers.

Headers of a part: `X-Capture-Time-Boot-Us` (middle of the exposure on the autopilot's boot clock), `X-Frame-Sequence`. Cameras that
do not send them work too: the frame then counts as taken when it arrived, less the configured delay.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from dataclasses import dataclass
from urllib.parse import urlsplit

MAX_HEADER_BYTES = 16_384
MAX_FRAME_BYTES = 20_000_000


class CameraError(OSError):
    """The camera cannot be read; the text says which and why."""


@dataclass(frozen=True, slots=True)
class JpegFrame:
    """A compressed frame as it came."""

    jpeg: bytes
    sequence: int | None
    capture_boot_us: int | None


async def frames(url: str) -> AsyncIterator[JpegFrame]:
    """Frames until the stream ends; CameraError where it cannot be opened or is not multipart JPEG."""
    parts = urlsplit(url)
    try:
        reader, writer = await asyncio.open_connection(parts.hostname, parts.port or 80)
    except OSError as error:
        raise CameraError(f"{url}: cannot connect: {error.strerror or error}") from error
    try:
        path = parts.path or "/"
        writer.write(
            f"GET {path} HTTP/1.1\r\nHost: {parts.netloc}\r\nAccept: multipart/x-mixed-replace\r\n\r\n".encode()
        )
        await writer.drain()
        await _check_response(reader, url)
        while True:
            frame = await _part(reader, url)
            if frame is None:
                return
            yield frame
    finally:
        writer.close()


async def _check_response(reader: asyncio.StreamReader, url: str) -> None:
    status = (await reader.readline()).decode("latin-1").strip()
    headers = await _headers(reader)
    if " 200 " not in f"{status} ":
        raise CameraError(f"{url}: the camera answered {status!r}, expected 200")
    content = headers.get("content-type", "")
    if "multipart" not in content:
        raise CameraError(f"{url}: content type {content!r}, expected multipart/x-mixed-replace")


async def _part(reader: asyncio.StreamReader, url: str) -> JpegFrame | None:
    """The next part: boundary line, headers, body."""
    try:
        line = await reader.readline()
        while line.strip() == b"":
            if line == b"":
                return None
            line = await reader.readline()
        headers = await _headers(reader)
        length = _integer(headers.get("content-length"))
        if length is None or not 0 < length <= MAX_FRAME_BYTES:
            raise CameraError(f"{url}: a frame without a usable Content-Length ({headers.get('content-length')!r})")
        body = await reader.readexactly(length)
    except asyncio.IncompleteReadError:
        return None
    return JpegFrame(body, _integer(headers.get("x-frame-sequence")), _integer(headers.get("x-capture-time-boot-us")))


async def _headers(reader: asyncio.StreamReader) -> dict[str, str]:
    headers: dict[str, str] = {}
    size = 0
    while True:
        line = await reader.readline()
        size += len(line)
        if line in (b"\r\n", b"\n", b"") or size > MAX_HEADER_BYTES:
            return headers
        name, _, value = line.decode("latin-1").partition(":")
        headers[name.strip().lower()] = value.strip()


def _integer(text: str | None) -> int | None:
    try:
        return None if text is None else int(text)
    except ValueError:
        return None
