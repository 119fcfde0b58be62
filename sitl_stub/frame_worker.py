"""Renders and compresses captures in one thread beside the simulation, and publishes each when it is due.

OpenCV releases the interpreter while it paints, so the MAVLink stream goes on. When the thread is behind, captures are
dropped, newest kept, and counted: a late picture is worth less than none.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from sitl_stub.capture import Capture, jpeg
from sitl_stub.mjpeg import JpegFrame

_LARGEST_BACKLOG = 3


class FrameWorker:
    """`publish(camera, frame)` is called on the event loop."""

    def __init__(self, publish: Callable[[str, JpegFrame], None], quality: int) -> None:
        self.dropped = 0
        self._publish = publish
        self._quality = quality
        self._executor = ThreadPoolExecutor(max_workers=1, thread_name_prefix="render")
        self._backlog = 0
        self._ready: list[tuple[int, str, JpegFrame]] = []

    def take(self, capture: Capture) -> None:
        """Begin to render it, or drop it where the thread is behind."""
        if self._backlog >= _LARGEST_BACKLOG:
            self.dropped += 1
            return
        self._backlog += 1
        future = asyncio.get_running_loop().run_in_executor(self._executor, self._render, capture)
        future.add_done_callback(lambda done: self._done(capture, done))

    def _render(self, capture: Capture) -> JpegFrame:
        frame = capture.render()
        return JpegFrame(frame.t_capture_us, frame.sequence, jpeg(frame.image, self._quality))

    def _done(self, capture: Capture, done: asyncio.Future[JpegFrame]) -> None:
        self._backlog -= 1
        if not done.cancelled():
            self._ready.append((capture.due_us, capture.channel.name, done.result()))

    def publish_due(self, t_us: int) -> None:
        """Hand out what is rendered and due at simulated time `t_us`."""
        if not self._ready:
            return
        due = [entry for entry in self._ready if entry[0] <= t_us]
        self._ready = [entry for entry in self._ready if entry[0] > t_us]
        for _, camera, frame in due:
            self._publish(camera, frame)

    def close(self) -> None:
        self._executor.shutdown(wait=True, cancel_futures=True)
