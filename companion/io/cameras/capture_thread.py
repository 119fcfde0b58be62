"""A blocking source in a thread of its own, read from asyncio: the newest frame waits, older ones are dropped.

OpenCV's `read()` blocks for a frame time, for ever on a hung driver. The thread is a daemon: a driver that never returns
keeps neither the loop nor the end of the program waiting.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncIterator, Callable, Iterator

from companion.io.cameras.frame import CameraError, CameraFrame

Opener = Callable[[], Iterator[CameraFrame]]
"""Opens the source and yields its frames, all in the thread; raises CameraError."""


async def threaded_frames(open_source: Opener) -> AsyncIterator[CameraFrame]:
    """Frames until the source ends. Its error is raised here."""
    mailbox = _Mailbox(asyncio.get_running_loop())
    stop = threading.Event()
    threading.Thread(target=_run, args=(open_source, mailbox, stop), name="camera", daemon=True).start()
    try:
        while (frame := await mailbox.next()) is not None:
            yield frame
    finally:
        stop.set()


class _Mailbox:
    """One place for a frame. Written from the thread through the loop, read in the loop."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._ready = asyncio.Event()
        self._frame: CameraFrame | None = None
        self._is_over = False
        self._error: CameraError | None = None

    def put(self, frame: CameraFrame) -> None:
        self._loop.call_soon_threadsafe(self._set, frame)

    def end(self, error: CameraError | None) -> None:
        self._loop.call_soon_threadsafe(self._finish, error)

    async def next(self) -> CameraFrame | None:
        """The newest frame; None at the end."""
        await self._ready.wait()
        frame, self._frame = self._frame, None
        if frame is not None:
            if not self._is_over:
                self._ready.clear()
            return frame
        if self._error is not None:
            raise self._error
        return None

    def _set(self, frame: CameraFrame) -> None:
        self._frame = frame
        self._ready.set()

    def _finish(self, error: CameraError | None) -> None:
        self._is_over, self._error = True, error
        self._ready.set()


def _run(open_source: Opener, mailbox: _Mailbox, stop: threading.Event) -> None:
    error: CameraError | None = None
    try:
        source = open_source()
        try:
            for frame in source:
                if stop.is_set():
                    break
                mailbox.put(frame)
        finally:
            _close(source)
    except CameraError as caught:
        error = caught
    except RuntimeError:
        return  # the loop is closed: nobody waits any more
    try:
        mailbox.end(error)
    except RuntimeError:
        return


def _close(source: Iterator[CameraFrame]) -> None:
    close = getattr(source, "close", None)
    if close is not None:
        close()
