"""http://host[:port]/path - multipart JPEG, with the capture time of every frame in its headers where the camera sends it.

Headers of a part: `X-Capture-Time-Boot-Us` (middle of the exposure on the autopilot's boot clock), `X-Frame-Sequence`. Cameras
that do not send them work too: the frame then counts as taken half a frame before it arrived, and what the network adds is the
camera's configured delay.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator
from dataclasses import dataclass
from urllib.parse import urlsplit

from companion.io.cameras.arrival import ArrivalStamps
from companion.io.cameras.frame import CameraError, CameraFrame, CaptureClock

MAX_HEADER_BYTES = 16_384
MAX_FRAME_BYTES = 20_000_000
STAMP_UNCERTAINTY_NS = 1_000_000
"""Of a capture time in a header: the autopilot's clock is known to a fraction of a millisecond."""


@dataclass(frozen=True, slots=True)
class JpegPart:
    """One part of the stream as it came."""

    jpeg: bytes
    sequence: int | None
    capture_boot_us: int | None


async def mjpeg_frames(url: str) -> AsyncIterator[CameraFrame]:
    """Frames until the stream ends; CameraError where it cannot be opened or is not multipart JPEG."""
    arrivals = ArrivalStamps()
    async for part in _parts(url):
        arrived_ns = time.monotonic_ns()
        captured_ns, uncertainty_ns = arrivals.stamp(arrived_ns)
        clock = CaptureClock.MONOTONIC
        if part.capture_boot_us is not None:
            captured_ns, uncertainty_ns = part.capture_boot_us * 1000, STAMP_UNCERTAINTY_NS
            clock = CaptureClock.AUTOPILOT
        yield CameraFrame(part.jpeg, captured_ns, uncertainty_ns, clock, arrived_ns, part.sequence)


async def _parts(url: str) -> AsyncIterator[JpegPart]:
    parts = urlsplit(url)
    try:
        reader, writer = await asyncio.open_connection(parts.hostname, parts.port or 80)
    except (OSError, ValueError) as error:
        raise CameraError(f"{url}: cannot connect: {getattr(error, 'strerror', None) or error}") from error
    try:
        target = (parts.path or "/") + (f"?{parts.query}" if parts.query else "")
        writer.write(
            f"GET {target} HTTP/1.1\r\nHost: {parts.netloc}\r\nAccept: multipart/x-mixed-replace\r\n\r\n".encode()
        )
        await writer.drain()
        await _check_response(reader, url)
        while (part := await _part(reader, url)) is not None:
            yield part
    except asyncio.IncompleteReadError:
        return
    except CameraError:
        raise
    except OSError as error:
        raise CameraError(f"{url}: the connection broke: {error.strerror or error}") from error
    except ValueError as error:
        raise CameraError(f"{url}: not a stream of JPEG parts: {error}") from error
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


async def _part(reader: asyncio.StreamReader, url: str) -> JpegPart | None:
    """The next part: boundary line, headers, body. None at the end of the stream."""
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
    return JpegPart(body, _integer(headers.get("x-frame-sequence")), _integer(headers.get("x-capture-time-boot-us")))


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
