"""The simulator and `companion run` as two processes on free ports: for screenshots and for tests that need a live flight."""

from __future__ import annotations

import re
import signal
import socket
import subprocess
import sys
from pathlib import Path
from types import TracebackType

END_S = 15.0


def free_port(kind: socket.SocketKind = socket.SOCK_DGRAM) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class SimulatedFlight:
    """`with` starts both and ends them. `page` is the address of the page, token included."""

    def __init__(self, folder: Path, *, scenario: str = "line", settings: dict[str, str] | None = None) -> None:
        self._folder = folder
        app_port, camera_port = free_port(), free_port(socket.SOCK_STREAM)
        self._stub_command = [sys.executable, "-m", "sitl_stub", scenario, "--seed", "1", "--quiet"]
        self._stub_command += ["--onboard", f"{free_port()}:{app_port}", "--ground", f"{free_port()}:{free_port()}"]
        self._stub_command += ["--camera-port", str(camera_port)]
        chosen = {
            "link.url": f"udpin://127.0.0.1:{app_port}",
            "cameras.down.source": f"http://127.0.0.1:{camera_port}/down",
            "dashboard.port": "0",
            **(settings or {}),
        }
        self._app_command = [sys.executable, "-u", "-m", "companion", "run", "--dashboard", "--quiet"]
        self._app_command += ["--runs", str(folder / "runs")]
        for key, value in chosen.items():
            self._app_command += ["--set", f"{key}={value}"]

    def __enter__(self) -> SimulatedFlight:
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        self._stub = subprocess.Popen(self._stub_command, **quiet)
        self.app = subprocess.Popen(self._app_command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        try:
            self.page = self._read_address()
        except BaseException:
            self.__exit__(None, None, None)
            raise
        return self

    def _read_address(self) -> str:
        assert self.app.stdout is not None
        said = []
        for line in self.app.stdout:
            said.append(line)
            found = re.search(r"https?://\S+token=\S+", line)
            if found:
                return found.group()
        raise RuntimeError("companion run ended: " + "".join(said))

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for process, number in ((self.app, signal.SIGINT), (self._stub, signal.SIGTERM)):
            process.send_signal(number)
            try:
                process.communicate(timeout=END_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.communicate()
