"""MAVProxy, a real ground station, headless against the simulated vehicle over UDP: connect, arm, change mode, fetch parameters.

MAVProxy is GPL software and no dependency of this project; `make test` (`.ci/mavproxy`) installs it in an environment of its own. The
test runs what `MAVPROXY` names, or `.venv-mavproxy` or PATH has, and is skipped where there is none.
Modes go by `long DO_SET_MODE`: the `mode` command of 1.8.75 with pymavlink 2.4.50 fails by itself on PX4's three-part modes.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from px4_rig import Rig
from udp_vehicle import UdpVehicle, free_port

ROOT = Path(__file__).resolve().parents[2]
LOCAL = ROOT / ".venv-mavproxy" / "bin" / "mavproxy.py"


def mavproxy() -> str | None:
    named = os.environ.get("MAVPROXY")
    return named or (str(LOCAL) if LOCAL.exists() else shutil.which("mavproxy.py"))


pytestmark = [
    pytest.mark.sockets,
    pytest.mark.timeout(300),
    pytest.mark.skipif(
        mavproxy() is None, reason="MAVProxy is not installed (GPL, not a dependency; see the module's text)"
    ),
]


def wait_for(condition: Callable[[], bool], what: str, timeout_s: float = 60.0) -> None:
    end_s = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < end_s, f"{what}: not within {timeout_s} s"
        time.sleep(0.05)


def test_mavproxy_connects_fetches_parameters_arms_and_changes_mode(tmp_path: Path) -> None:
    port = free_port()
    script = mavproxy()
    assert script is not None
    rig = Rig(options={"ground_link": True})
    with UdpVehicle(port, link="ground", speed=2.0, rig=rig):
        interpreter = Path(script).with_name("python")
        prefix = [str(interpreter)] if interpreter.exists() else []
        process = subprocess.Popen(
            [
                *prefix,
                script,
                f"--master=udpin:127.0.0.1:{port}",
                "--default-modules=link,param,cmdlong,mode,arm,misc",
                f"--state-basedir={tmp_path}",
                "--source-system=255",
            ],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            cwd=tmp_path,
        )
        try:
            assert process.stdin is not None

            def say(line: str) -> None:
                assert process.stdin is not None
                process.stdin.write(line + "\n")
                process.stdin.flush()

            wait_for(lambda: rig.autopilot.endpoint.ground_station_seen_us is not None, "heartbeat")
            say("param fetch")
            wait_for(lambda: any(tmp_path.rglob("mav.parm")), "parameters")
            say("arm throttle")
            wait_for(lambda: rig.is_armed, "arming")
            say("long NAV_TAKEOFF 0 0 0 nan nan nan nan")
            wait_for(lambda: rig.height_m > 1.0, "take-off")
            say("long DO_SET_MODE 1 4 6 0 0 0 0")
            wait_for(lambda: rig.autopilot.mode_name == "AUTO_LAND", "mode")
            wait_for(lambda: not rig.is_armed, "landing")
            parameters = next(tmp_path.rglob("mav.parm")).read_text()
        finally:
            process.kill()
            output = process.communicate(timeout=30.0)[0]
    assert "MPC_XY_VEL_MAX" in parameters, output[-2000:]
