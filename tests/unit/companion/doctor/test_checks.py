"""Each check on made-up evidence: what passes, what warns, what fails, and that a remedy is named. And doctor as a whole on the simulator."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
from dataclasses import replace

import pytest

from companion.config import Config, Mission, load
from companion.doctor import CHECKS, Evidence, Level, diagnose
from companion.doctor.command import as_json, exit_status
from companion.doctor.evidence import FrameSample
from companion.mavlink.timesync import ClockQuality
from companion.messages import AutopilotMode, LandedState, VehicleStatus

GOOD_PARAMETERS = {
    "MPC_XY_VEL_MAX": 12.0,
    "MPC_TILTMAX_AIR": 45.0,
    "MPC_Z_VEL_MAX_DN": 1.5,
    "MPC_Z_VEL_MAX_UP": 3.0,
    "COM_OF_LOSS_T": 1.0,
    "COM_OBL_RC_ACT": 5,
    "COM_DISARM_LAND": 2.0,
    "LNDMC_XY_VEL_MAX": 1.5,
    "LNDMC_Z_VEL_MAX": 0.25,
    "GF_ACTION": 3,
    "GF_MAX_HOR_DIST": 300.0,
    "GF_MAX_VER_DIST": 50.0,
}
STATUS = VehicleStatus(
    0, True, False, AutopilotMode.HOLD, None, LandedState.ON_GROUND, False, True, 0.9, (0.0, 0.0, 0.0), 0.0
)


def good(**changes: object) -> Evidence:
    """A vehicle that is ready, with what the test changes."""
    evidence = Evidence(Config(), 3.0, 5.0)
    evidence.message_counts = {"VehicleState": 250, "RangeMeasurement": 100, "PadBeacon": 25}
    evidence.status = STATUS
    evidence.clock = ClockQuality(True, 0.0005, 0.0001, 0.001, 60, 0, 0)
    evidence.offset_jitter_s = 0.0003
    evidence.parameters = GOOD_PARAMETERS
    evidence.frames = [FrameSample(n * 33_000_000, 0.05, (752, 480), 110.0) for n in range(60)]
    evidence.marker_ids_seen = {7, 45}
    evidence.reprojection_errors_px = [0.2]
    evidence.detect_s = [0.008] * 10
    evidence.tick_late_s = [0.001] * 100
    evidence.disk_free_bytes = 50_000_000_000
    for name, value in changes.items():
        setattr(evidence, name, value)
    return evidence


def worst(check: str, evidence: Evidence) -> Level:
    levels = [finding.level for finding in CHECKS[check](evidence)]
    return max(levels, key=list(Level).index)


def test_a_vehicle_that_is_ready_passes_every_check() -> None:
    findings = diagnose(good())
    assert {finding.level for finding in findings} == {Level.PASS}
    assert {finding.check for finding in findings} == set(CHECKS)
    assert exit_status(findings) == 0


PARAMETER_CASES = [
    ("MPC_XY_VEL_MAX", 3.0, Level.FAIL),
    ("MPC_XY_VEL_MAX", 4.0, Level.WARN),
    ("MPC_TILTMAX_AIR", 15.0, Level.FAIL),
    ("MPC_TILTMAX_AIR", 22.0, Level.WARN),
    ("MPC_Z_VEL_MAX_DN", 0.7, Level.WARN),
    ("MPC_Z_VEL_MAX_UP", 0.3, Level.FAIL),
    ("COM_OF_LOSS_T", 0.1, Level.FAIL),
    ("COM_OF_LOSS_T", 60.0, Level.FAIL),
    ("COM_OF_LOSS_T", 3.0, Level.WARN),
    ("COM_OBL_RC_ACT", 0, Level.WARN),
    ("COM_OBL_RC_ACT", 4, Level.WARN),
    ("COM_OBL_RC_ACT", 7, Level.FAIL),
    ("COM_DISARM_LAND", 30.0, Level.WARN),
    ("COM_DISARM_LAND", -1.0, Level.PASS),
    ("LNDMC_Z_VEL_MAX", 0.6, Level.WARN),
]


@pytest.mark.parametrize(("name", "value", "level"), PARAMETER_CASES)
def test_a_parameter_that_breaks_the_mission_is_named(name: str, value: float, level: Level) -> None:
    findings = CHECKS["parameters"](good(parameters={**GOOD_PARAMETERS, name: value}))
    judged = next(finding for finding in findings if finding.text.startswith(name))
    assert judged.level is level
    assert bool(judged.remedy) is (level is not Level.PASS)


def test_a_fast_deck_needs_companion_to_stop_the_motors() -> None:
    never = Config(mission=Mission(disarm="never"))
    assert worst("parameters", good(pad_speed_m_s=5.0, config=never)) is Level.FAIL
    assert worst("parameters", good(pad_speed_m_s=5.0)) is Level.PASS
    assert worst("parameters", good(pad_speed_m_s=1.0, config=never)) is Level.PASS


def test_parameters_that_were_not_answered_are_listed() -> None:
    findings = CHECKS["parameters"](good(parameters={}))
    assert [finding.level for finding in findings] == [Level.WARN]
    assert "MPC_XY_VEL_MAX" in findings[0].text


CASES = {
    "slow state": ("link", {"message_counts": {"VehicleState": 90}}, Level.FAIL),
    "no range sensor, no beacon": ("link", {"message_counts": {"VehicleState": 250}}, Level.WARN),
    "noise": ("link", {"bytes_skipped": 900}, Level.WARN),
    "port taken": ("link", {"link_error": "cannot be opened"}, Level.FAIL),
    "clock unknown": ("clock", {"clock": None}, Level.FAIL),
    "clock jitters": ("clock", {"offset_jitter_s": 0.006}, Level.WARN),
    "clock wild": ("clock", {"offset_jitter_s": 0.020}, Level.FAIL),
    "no frames": ("camera", {"frames": []}, Level.FAIL),
    "camera error": ("camera", {"camera_error": "cannot connect"}, Level.FAIL),
    "slow camera": (
        "camera",
        {"frames": [FrameSample(n * 200_000_000, 0.05, (752, 480), 110.0) for n in range(9)]},
        Level.FAIL,
    ),
    "wrong size": (
        "camera",
        {"frames": [FrameSample(n * 33_000_000, 0.05, (640, 480), 110.0) for n in range(9)]},
        Level.FAIL,
    ),
    "lens cap": (
        "camera",
        {"frames": [FrameSample(n * 33_000_000, 0.05, (752, 480), 1.0) for n in range(9)]},
        Level.FAIL,
    ),
    "old pictures": (
        "camera",
        {"frames": [FrameSample(n * 33_000_000, 0.7, (752, 480), 110.0) for n in range(9)]},
        Level.FAIL,
    ),
    "no capture times": (
        "camera",
        {"frames": [FrameSample(n * 33_000_000, None, (752, 480), 110.0) for n in range(9)]},
        Level.WARN,
    ),
    "no pad": ("pad", {"marker_ids_seen": set()}, Level.WARN),
    "another pad": ("pad", {"foreign_ids_seen": {3}}, Level.WARN),
    "wrong size of the pad": ("pad", {"reprojection_errors_px": [2.5]}, Level.WARN),
    "half charged": ("battery", {"status": replace(STATUS, battery_fraction=0.35)}, Level.WARN),
    "empty": ("battery", {"status": replace(STATUS, battery_fraction=0.1)}, Level.FAIL),
    "unknown charge": ("battery", {"status": replace(STATUS, battery_fraction=None)}, Level.WARN),
    "no home": ("home", {"status": replace(STATUS, home_position_ned_m=None)}, Level.WARN),
    "would not arm": ("home", {"status": replace(STATUS, ready_to_arm=False)}, Level.FAIL),
    "no fence": ("geofence", {"parameters": {**GOOD_PARAMETERS, "GF_ACTION": 0}}, Level.WARN),
    "low fence": ("geofence", {"parameters": {**GOOD_PARAMETERS, "GF_MAX_VER_DIST": 8.0}}, Level.FAIL),
    "full disk": ("disk", {"disk_free_bytes": 1000}, Level.FAIL),
    "late ticks": ("cpu", {"tick_late_s": [0.001] * 90 + [0.030] * 10}, Level.FAIL),
    "slow detector": ("cpu", {"detect_s": [0.05] * 10}, Level.WARN),
}


@pytest.mark.parametrize(("check", "changes", "level"), CASES.values(), ids=CASES.keys())
def test_what_is_wrong_is_found_and_a_remedy_is_named(check: str, changes: dict, level: Level) -> None:
    evidence = good(**changes)
    assert worst(check, evidence) is level
    assert all(finding.remedy for finding in CHECKS[check](evidence) if finding.level is not Level.PASS)


def test_without_a_vehicle_nothing_is_said_about_its_parameters() -> None:
    findings = diagnose(good(status=None))
    assert exit_status(findings) == 1
    assert not {"parameters", "battery", "home", "clock"} & {finding.check for finding in findings}


def test_the_json_names_level_text_and_remedy() -> None:
    told = json.loads(as_json(diagnose(good(disk_free_bytes=1000))))
    assert told["status"] == 1
    assert {"check": "disk", "level": "fail"}.items() <= told["findings"][-3].items()


def _free_port(kind: socket.SocketKind) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.mark.sockets
def test_doctor_on_the_simulator_finds_the_vehicle_the_camera_and_a_speed_limit_below_the_pads_speed() -> None:
    app, camera = _free_port(socket.SOCK_DGRAM), _free_port(socket.SOCK_STREAM)
    ports = [_free_port(socket.SOCK_DGRAM) for _ in range(3)]
    stub = subprocess.Popen(
        [sys.executable, "-m", "sitl_stub", "line", "--quiet", "--onboard", f"{ports[0]}:{app}"]
        + ["--ground", f"{ports[1]}:{ports[2]}", "--camera-port", str(camera)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        told = _doctor(app, camera)
    finally:
        stub.terminate()
        stub.wait()
    assert told["status"] == 1
    found = {(finding["check"], finding["text"].split(" =")[0]): finding["level"] for finding in told["findings"]}
    assert found["parameters", "MPC_XY_VEL_MAX"] == "fail"
    assert found["parameters", "COM_OBL_RC_ACT"] == "warn"
    assert found["camera", "752 x 480 px, calibrated for 752 x 480 px"] == "pass"
    assert found["home", "home known"] == "pass"


ASKED = ("MPC_XY_VEL_MAX", "COM_OBL_RC_ACT")


def _doctor(app: int, camera: int) -> dict:
    """Asked again while the simulator is still starting: its link, its camera, or parameters that a busy machine lost."""
    for _ in range(8):
        ended = subprocess.run(
            [sys.executable, "-m", "companion", "doctor", "--json", "--seconds", "3", "--pad-speed", "12"]
            + ["--set", f"link.url=udpin://127.0.0.1:{app}"]
            + ["--set", f"cameras.down.source=http://127.0.0.1:{camera}/down"],
            capture_output=True,
            text=True,
            check=False,
            env={**os.environ, "OMP_NUM_THREADS": "1"},
        )
        told = json.loads(ended.stdout)
        assert ended.returncode == told["status"]
        texts = [finding["text"] for finding in told["findings"]]
        is_heard = not any("nothing heard" in text or "cannot connect" in text for text in texts)
        has_parameters = all(any(text.startswith(f"{name} =") for text in texts) for name in ASKED)
        if is_heard and has_parameters and any("calibrated for" in text for text in texts):
            break
    return dict(told)


def test_a_vehicle_with_another_signing_key_is_not_called_silent() -> None:
    config = load([], {"link.signing_key_file": "link.key"})
    (finding,) = CHECKS["link"](good(config=config, status=None, frames_refused=312))
    assert finding.level is Level.FAIL
    assert finding.text == "all 312 frames refused: not signed with the key in link.key"
    assert "same key in the autopilot" in finding.remedy
