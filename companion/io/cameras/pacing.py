"""Recordings as if they were live: every frame waits for its time. Without pace, the loop still gets its turn."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Iterator
from dataclasses import replace

from companion.io.cameras.frame import CameraFrame


async def paced(frames: Iterator[CameraFrame], *, keep_pace: bool) -> AsyncIterator[CameraFrame]:
    """The frames in order; with `keep_pace` the first at once, the others as far apart as their capture times."""
    offset_ns: int | None = None
    for frame in frames:
        if not keep_pace:
            await asyncio.sleep(0)
            yield frame
            continue
        if offset_ns is None:
            offset_ns = time.monotonic_ns() - frame.capture_ns
        due_ns = frame.capture_ns + offset_ns
        await asyncio.sleep(max(0.0, (due_ns - time.monotonic_ns()) / 1e9))
        yield replace(frame, arrived_ns=due_ns)
