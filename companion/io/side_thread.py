"""A thread with an event loop of its own, for what talks to people: broker, browser.

Whatever happens there, name look-ups and TLS handshakes included, the control loop's thread goes on. The two exchange frozen
messages only: in through thread-safe queues, out through the callable that the live app hands over.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Coroutine
from typing import Any

from companion.messages import Health, OperatorCommand, PadBeacon

Ask = Callable[[OperatorCommand | PadBeacon | Health], None]
"""Into the live app, from any thread."""

STOP_S = 3.0
"""How long the end of a run waits for a goodbye; then the thread is left behind (it is a daemon)."""


class SideThread:
    """`start(main)` runs a coroutine until it returns, or until `stop` cancels it."""

    def __init__(self, name: str) -> None:
        self._loop: asyncio.AbstractEventLoop | None = None
        self._task: asyncio.Task[None] | None = None
        self._started = threading.Event()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._main: Callable[[], Coroutine[Any, Any, None]] | None = None

    def start(self, main: Callable[[], Coroutine[Any, Any, None]]) -> None:
        self._main = main
        self._thread.start()
        self._started.wait()

    def call(self, function: Callable[..., object], *arguments: object) -> None:
        """Run in that thread, soon; nothing once it has ended."""
        if self._loop is not None and not self._loop.is_closed():
            try:
                self._loop.call_soon_threadsafe(function, *arguments)
            except RuntimeError:  # closed between the question and the call
                return

    def stop(self) -> None:
        if self._task is not None:
            self.call(self._task.cancel)
            self._thread.join(STOP_S)

    def join(self) -> bool:
        """Wait for it to end by itself; whether it has."""
        if self._task is not None:
            self._thread.join(STOP_S)
        return not self._thread.is_alive()

    def _run(self) -> None:
        with asyncio.Runner() as runner:
            try:
                runner.run(self._run_main())
            except asyncio.CancelledError:
                pass
            finally:
                self._started.set()

    async def _run_main(self) -> None:
        assert self._main is not None
        self._loop = asyncio.get_running_loop()
        self._task = asyncio.current_task()
        self._started.set()
        await self._main()
