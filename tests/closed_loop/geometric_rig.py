"""The simulator and the onboard program in lockstep, with a camera that knows where the pad is: fast enough for many faults.

Frames come from a tiny rendered camera, so that their times, delays and faults are the simulator's; what they show is
computed from the truth at capture: the pad's pose in the camera, with noise, where it is in the field of view and the
picture is not black. Everything else (MAVLink bytes, autopilot, contact, wind) is as in a whole flight.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from companion.config import Config
from companion.geometry import Q_FRD_CAMERA_DOWN, Transform
from companion.messages import (
    Health,
    Message,
    OperatorAction,
    PadNotSeen,
    PadObservation,
    Phase,
    PhaseChanged,
    VehicleCommand,
    VehicleStatus,
    VelocitySetpoint,
)
from companion.onboard import Onboard
from sitl_stub.datagram_faults import Datagram
from sitl_stub.scenario import load, with_overrides
from sitl_stub.world import Truth, World

STEP_S = 0.004
CLOCK_OFFSET_NS = 9_000_000_000_000
TINY_CAMERA = {"width_px": 64, "height_px": 48, "fx_px": 36.0, "fy_px": 36.0, "cx_px": 31.5, "cy_px": 23.5}
TAN_HALF_VIEW = (0.9, 0.57)
NOISE_M = 0.01
COVARIANCE = ((4e-4, 0.0, 0.0), (0.0, 4e-4, 0.0), (0.0, 0.0, 4e-4))
ROTATION = ((4e-4, 0.0, 0.0), (0.0, 4e-4, 0.0), (0.0, 0.0, 4e-4))
SETPOINT_ID = (84).to_bytes(3, "little")
KEPT = (Health, VehicleCommand, PhaseChanged, VehicleStatus, VelocitySetpoint)


@dataclass
class Rig:
    """One flight. `cut` drops every datagram of both directions, `deaf` those to the autopilot only; `paused` stops the onboard
    program's own timers. `sent` holds what left for the autopilot, with its time, also what was dropped."""

    world_changes: dict[str, Any]
    config: Config = field(default_factory=Config)
    seed: int = 1
    scenario: str = "line"
    cut: bool = False
    deaf: bool = False
    sent: list[tuple[float, bytes]] = field(default_factory=list)
    paused: bool = False
    kept: list[tuple[float, Message]] = field(default_factory=list)

    def __post_init__(self) -> None:
        changes = {"cameras.down": TINY_CAMERA, "place.pad_distance_m": 6.0, **self.world_changes}
        self.world = World(with_overrides(load(self.scenario), _nested(changes)), self.seed)
        self.onboard = Onboard(self.config, start_ns=CLOCK_OFFSET_NS)
        self._truths: deque[Truth] = deque(maxlen=150)
        self._rng = np.random.default_rng(self.seed)
        self._started = False

    @property
    def now_ns(self) -> int:
        return CLOCK_OFFSET_NS + self.world.t_us * 1000

    @property
    def now_s(self) -> float:
        return self.world.t_us / 1e6

    @property
    def phase(self) -> Phase:
        return self.onboard.pipeline.phase

    def turn(self) -> None:
        leaving = self.onboard.datagrams_to_send()
        self.sent += [(self.now_s, data) for data in leaving]
        outgoing = [] if self.cut or self.deaf else [Datagram("onboard", data) for data in leaving]
        stepped = self.world.step(STEP_S, outgoing)
        self._truths.append(self.world.truth())
        for datagram in stepped.datagrams:
            if datagram.link == "onboard" and not self.cut:
                self.onboard.receive_datagram(datagram.data, self.now_ns)
        for frame in stepped.frames:
            self._see(frame.t_capture_us, is_black=int(frame.image.max()) < 8)
        if not self._started and self.now_s > 2.0:
            self._started = True
            self.onboard.operate(OperatorAction.START, "test", self.now_ns)
        if not self.paused and self.now_ns >= self.onboard.next_timer_ns():
            self.onboard.handle_timers(self.now_ns)
        self.kept += [(self.now_s, e.message) for e in self.onboard.take_journal() if isinstance(e.message, KEPT)]

    def run(self, seconds: float, until: Callable[[], bool] = lambda: False) -> bool:
        """True where `until` came true in time."""
        end_s = self.now_s + seconds
        while self.now_s < end_s:
            self.turn()
            if until():
                return True
        return False

    def run_to(self, phase: Phase, seconds: float = 60.0) -> None:
        assert self.run(seconds, lambda: self.phase is phase), f"in {self.phase}: {self.onboard.pipeline.note}"

    def fly_out(self, seconds: float) -> str:
        """To the simulator's ending, or `seconds` on."""
        self.run(seconds, lambda: self.ending != "flying")
        self.run(0.5)
        return self.ending

    @property
    def ending(self) -> str:
        return str(self.world.verdict().ending)

    def messages(self, kind: type, *, after_s: float = 0.0) -> list[Any]:
        return [message for t_s, message in self.kept if isinstance(message, kind) and t_s > after_s]

    def setpoints_sent(self, after_s: float = 0.0) -> list[tuple[float, bytes]]:
        """Time and payload of each SET_POSITION_TARGET_LOCAL_NED on the wire (MAVLink 2)."""
        return [(t_s, data[10:-2]) for t_s, data in self.sent if t_s > after_s and data[7:10] == SETPOINT_ID]

    def phases(self) -> list[Phase]:
        return [change.after for change in self.messages(PhaseChanged)]

    def _see(self, t_capture_us: int, *, is_black: bool) -> None:
        t_ns = self.onboard.capture_time_ns("down", capture_boot_us=t_capture_us, arrived_ns=self.now_ns)
        truth = min(self._truths, key=lambda each: abs(each.t_us - t_capture_us))
        X_CP = _pad_in_camera(truth)
        x, y, z = X_CP.p
        visible = z > 0.15 and abs(x) < TAN_HALF_VIEW[0] * z and abs(y) < TAN_HALF_VIEW[1] * z
        if is_black or not visible:
            self.onboard.receive(PadNotSeen(t_ns, "down", "geometric"), self.now_ns)
            return
        noise = self._rng.normal(0.0, NOISE_M, 3)
        position = (x + float(noise[0]), y + float(noise[1]), z + float(noise[2]))
        seen = PadObservation(t_ns, "down", "geometric", position, COVARIANCE, X_CP.q, ROTATION)
        self.onboard.receive(seen, self.now_ns)


def _pad_in_camera(truth: Truth) -> Transform:
    X_WB = Transform(truth.vehicle.q_ned_frd, truth.vehicle.position_ned_m)
    X_WC = X_WB @ Transform(Q_FRD_CAMERA_DOWN, (0.0, 0.0, 0.05))
    return X_WC.inverse() @ Transform(truth.pad_q_ned_pad, truth.pad_position_ned_m)


def _nested(changes: dict[str, Any]) -> dict[str, Any]:
    nested: dict[str, Any] = {}
    for dotted, value in changes.items():
        *path, last = dotted.split(".")
        below = nested
        for part in path:
            below = below.setdefault(part, {})
        below[last] = value
    return nested


def distance_to_pad_m(truth: Truth) -> float:
    return math.hypot(truth.vehicle_in_pad_m[0], truth.vehicle_in_pad_m[1])
