"""A headless Chromium driven over its own debugging protocol: for screenshots and for the test that clicks on abort.

No driver program and no other package: the protocol is JSON over a websocket (https://chromedevtools.github.io/devtools-protocol).
"""

from __future__ import annotations

import base64
import contextlib
import json
import shutil
import subprocess
import time
import urllib.request
from pathlib import Path
from types import TracebackType
from typing import Any

from websockets.sync.client import ClientConnection, connect

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
START_S = 30.0
ANSWER_S = 30.0


def find_browser() -> str | None:
    """Path of a Chromium or Chrome; None where there is none."""
    return next((path for path in map(shutil.which, NAMES) if path is not None), None)


class Page:
    """One tab. `with` starts and ends the browser."""

    def __init__(self, browser: str, profile: Path, *, width_px: int = 1280, height_px: int = 900) -> None:
        self._profile = profile
        flags = ["--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run"]
        flags += ["--disable-background-networking", "--remote-debugging-port=0", f"--user-data-dir={profile}"]
        flags += [f"--window-size={width_px},{height_px}", "--hide-scrollbars", "--mute-audio"]
        self._command = [browser, *flags, "about:blank"]
        self._size = (width_px, height_px)
        self._asked = 0
        self._open = contextlib.ExitStack()

    def __enter__(self) -> Page:
        self._process = subprocess.Popen(self._command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            self._socket = self._connected()
            width, height = self._size
            metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
            self.call("Emulation.setDeviceMetricsOverride", **metrics)
        except BaseException:
            self._process.kill()
            self._process.wait()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._open.close()
        self._process.terminate()
        try:
            self._process.wait(10.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _connected(self) -> ClientConnection:
        port_file = self._profile / "DevToolsActivePort"
        deadline = time.monotonic() + START_S
        while not (port_file.exists() and "\n" in port_file.read_text()):
            if time.monotonic() > deadline or self._process.poll() is not None:
                raise RuntimeError("the browser does not start")
            time.sleep(0.05)
        port = port_file.read_text().split()[0]
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/json/list", timeout=10.0) as reply:
            targets = json.load(reply)
        address = next(target["webSocketDebuggerUrl"] for target in targets if target["type"] == "page")
        return self._open.enter_context(connect(address, max_size=None, open_timeout=START_S))

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """One question of the protocol and its answer."""
        self._asked += 1
        self._socket.send(json.dumps({"id": self._asked, "method": method, "params": parameters}))
        while True:
            answer = json.loads(self._socket.recv(timeout=ANSWER_S))
            if answer.get("id") == self._asked:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']}")
                return dict(answer["result"])

    def open(self, address: str) -> None:
        """Load the address and wait until it is there."""
        self.call("Page.navigate", url=address)
        self.until("location.href !== 'about:blank' && document.readyState === 'complete'", timeout_s=START_S)

    def value(self, script: str) -> Any:
        """Of a JavaScript expression in the page."""
        answer = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(f"{script}: {answer['exceptionDetails']}")
        return answer["result"].get("value")

    def until(self, script: str, *, timeout_s: float) -> Any:
        """Wait until the expression is true; what it gave."""
        deadline = time.monotonic() + timeout_s
        while True:
            value = self.value(script)
            if value:
                return value
            if time.monotonic() > deadline:
                raise TimeoutError(f"not within {timeout_s:.0f} s: {script}")
            time.sleep(0.05)

    def click(self, selector: str) -> None:
        """With the mouse, in the middle of the element, as a person would."""
        box = self.value(
            f"(() => {{ const e = document.querySelector({json.dumps(selector)}); e.scrollIntoView({{block: 'center'}});"
            " const b = e.getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2]; })()"
        )
        for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, x=box[0], y=box[1], button="left", clickCount=1)

    def screenshot(self, file: Path, *, whole: bool = False) -> None:
        """The visible part, or the whole page, as PNG."""
        data = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=whole)["data"]
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(base64.b64decode(data))
