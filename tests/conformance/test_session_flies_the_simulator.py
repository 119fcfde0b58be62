"""The session against the simulator's autopilot, through bytes, in lockstep: the commands of a flight and their true answers."""

from __future__ import annotations

from typing import Any

import pytest

from companion.config import Link
from companion.mavlink.session import Session
from companion.messages import (
    AutopilotMode,
    CommandKind,
    CommandResult,
    PadBeacon,
    VehicleCommand,
    VehicleState,
    VehicleStatus,
    VelocitySetpoint,
)
from sitl_stub.scenario import load
from sitl_stub.world import Datagram, World

T0_NS = 10**12
STEP_S = 0.004


class Flight:
    """One world and one session on one clock; `fly` lets time pass with or without a stream of setpoints."""

    def __init__(self) -> None:
        self.world = World(load("takeoff"), 1, render=False)
        self.session = Session(Link(), T0_NS)
        self.inputs: list[Any] = []
        self.setpoint_m_s: tuple[float, float, float] | None = None
        self._to_world: list[Datagram] = []

    @property
    def now_ns(self) -> int:
        return T0_NS + self.world.t_us * 1000

    def fly(self, seconds: float) -> None:
        for _ in range(round(seconds / STEP_S)):
            out = self.world.step(STEP_S, self._to_world)
            self.inputs += self.session.handle_timer(self.now_ns)
            for datagram in out.datagrams:
                if datagram.link == "onboard":
                    self.inputs += self.session.receive_datagram(datagram.data, self.now_ns)
            if self.setpoint_m_s is not None and self.world.t_us % 20_000 == 0:
                setpoint = VelocitySetpoint(self.now_ns, self.now_ns + 10**8, self.setpoint_m_s, 0.0)
                self.session.send_setpoint(setpoint, self.now_ns)
            self._to_world = [Datagram("onboard", frame) for frame in self.session.datagrams_to_send()]

    def ask(self, kind: CommandKind, **more: Any) -> CommandResult:
        """The answer, within a second."""
        self.session.send_command(VehicleCommand(self.now_ns, kind, "test", **more), self.now_ns)
        before = len(self.of(CommandResult))
        for _ in range(10):
            self.fly(0.1)
            results: list[CommandResult] = self.of(CommandResult)[before:]
            if results:
                return results[0]
        raise AssertionError(f"no answer to {kind}")

    def of(self, kind: type) -> list[Any]:
        return [m for m in self.inputs if isinstance(m, kind)]

    @property
    def status(self) -> VehicleStatus:
        return self.of(VehicleStatus)[-1]  # type: ignore[no-any-return]

    @property
    def state(self) -> VehicleState:
        return self.of(VehicleState)[-1]  # type: ignore[no-any-return]


@pytest.fixture(scope="module")
def flight() -> Flight:
    """Ready to arm on the ground, then flown by the tests below in their order."""
    ready = Flight()
    ready.fly(8.0)
    return ready


def test_a_whole_flight_by_command(flight: Flight) -> None:
    assert flight.status.ready_to_arm
    assert flight.session.clock.converged
    assert flight.ask(CommandKind.ARM).accepted
    assert flight.status.armed
    down_before = flight.state.position_ned_m[2]
    assert flight.ask(CommandKind.TAKEOFF, height_m=5.0).accepted
    flight.fly(15.0)
    assert flight.status.mode is AutopilotMode.HOLD
    assert down_before - flight.state.position_ned_m[2] == pytest.approx(5.0, abs=1.0)

    refused = flight.ask(CommandKind.OFFBOARD)
    assert (refused.accepted, refused.result) == (False, "temporarily_rejected")  # no stream
    flight.setpoint_m_s = (2.0, 0.0, 0.0)
    flight.fly(0.1)
    assert flight.ask(CommandKind.OFFBOARD).accepted
    assert not flight.status.failsafe
    flight.fly(4.0)
    assert flight.state.velocity_ned_m_s[0] == pytest.approx(2.0, abs=0.6)

    refused = flight.ask(CommandKind.DISARM)
    assert (refused.accepted, refused.result) == (False, "temporarily_rejected")  # in the air
    flight.setpoint_m_s = None
    flight.fly(1.5)
    assert flight.status.failsafe
    assert flight.status.intended_mode is AutopilotMode.OFFBOARD
    assert flight.ask(CommandKind.HOLD).accepted
    assert flight.status.mode is flight.status.intended_mode is AutopilotMode.HOLD

    forced = flight.ask(CommandKind.FORCE_DISARM, evidence=("a test",))
    assert forced.accepted
    assert not flight.status.armed


def test_state_comes_at_the_rate_that_was_asked_for_and_is_fresh(flight: Flight) -> None:
    began = len(flight.inputs)
    flight.fly(2.0)
    states = [m for m in flight.inputs[began:] if isinstance(m, VehicleState)]
    assert len(states) == pytest.approx(100, abs=5)
    assert flight.now_ns - states[-1].t_ns < 30_000_000


def test_the_beacon_is_near_the_pad(flight: Flight) -> None:
    flight.fly(1.0)
    beacons: list[PadBeacon] = flight.of(PadBeacon)
    truth = flight.world.truth()
    error = [a - b for a, b in zip(beacons[-1].position_ned_m, truth.pad_position_ned_m, strict=True)]
    assert all(abs(e) < 6.0 for e in error)
    assert beacons[-1].t_ns <= flight.now_ns


def test_every_frame_of_the_simulator_is_readable() -> None:
    flight = Flight()
    flight.fly(20.0)
    counters = flight.session.counters
    assert counters.bytes_skipped == 0
    assert counters.frames_received > 5_000


def test_two_flights_with_the_same_bytes_say_the_same() -> None:
    first, second = Flight(), Flight()
    first.fly(3.0)
    second.fly(3.0)
    assert list(map(repr, first.inputs)) == list(map(repr, second.inputs))
