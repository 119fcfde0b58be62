"""The pipeline alone against a vehicle that is a point with a lag: no MAVLink, no images, no simulator.

Fast, and independent of sitl_stub: what fails here is a mistake of the pipeline, not of a model of PX4.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import pytest

from companion.config import Config
from companion.geometry import Q_FRD_CAMERA_DOWN, Transform, quaternion_from_euler
from companion.messages import (
    AutopilotMode,
    CommandKind,
    CommandResult,
    LandedState,
    OperatorAction,
    OperatorCommand,
    Output,
    PadObservation,
    Phase,
    PhaseChanged,
    RangeMeasurement,
    ThrustReport,
    Tick,
    Vec3,
    VehicleCommand,
    VehicleState,
    VehicleStatus,
    VelocitySetpoint,
)
from companion.pipeline import Pipeline

DT_S = 0.02
LAG_S = 0.4
LEG_M = 0.22
VARIANCE = ((4e-4, 0.0, 0.0), (0.0, 4e-4, 0.0), (0.0, 0.0, 4e-4))


@dataclass
class PointMassWorld:
    """A vehicle that follows velocity setpoints with a first-order lag, and a pad at 1.5 m/s."""

    pipeline: Pipeline
    pad_velocity: Vec3 = (1.5, 0.0, 0.0)
    t_s: float = 0.0
    position: list[float] = field(default_factory=lambda: [-3.0, 2.0, -10.0])
    velocity: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    pad: list[float] = field(default_factory=lambda: [0.0, 0.0, -0.5])
    mode: AutopilotMode = AutopilotMode.HOLD
    armed: bool = True
    setpoint: VelocitySetpoint | None = None
    outputs: list[Output] = field(default_factory=list)
    marker_hidden: bool = False
    frozen_mode_reports: bool = False
    _mode_ns: int = 0

    @property
    def t_ns(self) -> int:
        return 7_000_000_000 + round(self.t_s * 1e9)

    @property
    def standing(self) -> bool:
        return self.position[2] >= self.pad[2] - LEG_M - 1e-6

    def handle(self, message: object) -> None:
        for output in self.pipeline.handle(message):  # type: ignore[arg-type]
            self.outputs.append(output)
            if isinstance(output, VelocitySetpoint):
                self.setpoint = output
            if isinstance(output, VehicleCommand):
                self._obey(output)

    def _obey(self, command: VehicleCommand) -> None:
        accepted = command.kind is not CommandKind.DISARM  # as PX4 on a deck that moves
        if command.kind is CommandKind.OFFBOARD:
            self.mode = AutopilotMode.OFFBOARD
        elif command.kind is CommandKind.HOLD:
            self.mode = AutopilotMode.HOLD
        elif command.kind is CommandKind.FORCE_DISARM:
            self.armed = False
        self.handle(CommandResult(self.t_ns, command.kind, accepted, "test", 1))

    def step(self) -> None:
        self.t_s += DT_S
        for i in range(3):
            self.pad[i] += self.pad_velocity[i] * DT_S
        self._fly()
        self._report()
        self.handle(Tick(self.t_ns))

    def _fly(self) -> None:
        alive = self.setpoint is not None and self.setpoint.valid_until_ns >= self.t_ns
        wanted = self.setpoint.velocity_ned_m_s if alive and self.setpoint else (0.0, 0.0, 0.0)
        for i in range(3):
            self.velocity[i] += (wanted[i] - self.velocity[i]) * DT_S / LAG_S
            self.position[i] += self.velocity[i] * DT_S
        if self.position[2] > self.pad[2] - LEG_M:
            self.position[2] = self.pad[2] - LEG_M
            self.velocity = list(self.pad_velocity)

    def _report(self) -> None:
        position, velocity = self._vec(self.position), self._vec(self.velocity)
        level = (1.0, 0.0, 0.0, 0.0)
        self.handle(VehicleState(self.t_ns, position, velocity, level, (0.0, 0.0, 0.0)))
        if not self.frozen_mode_reports:
            self._mode_ns = self.t_ns
        if round(self.t_s / DT_S) % 5 == 0:
            self.handle(self._status())
            self.handle(ThrustReport(self.t_ns, 0.2 if self.standing else 0.5))
            self.handle(RangeMeasurement(self.t_ns, self._range(), 0.05, 40.0))
        if round(self.t_s / DT_S) % 2 == 0 and not self.marker_hidden:
            self._show_pad()

    def _status(self) -> VehicleStatus:
        return VehicleStatus(
            t_ns=self._mode_ns,
            connected=True,
            armed=self.armed,
            mode=self.mode,
            intended_mode=self.mode,
            landed_state=LandedState.IN_AIR,
            failsafe=False,
            ready_to_arm=True,
            battery_fraction=0.9,
            home_position_ned_m=None,
            link_age_s=0.0,
        )

    def _range(self) -> float:
        over = math.hypot(self.position[0] - self.pad[0], self.position[1] - self.pad[1]) < 0.75
        return (self.pad[2] if over else 0.0) - self.position[2]

    def _show_pad(self) -> None:
        X_WC = Transform((1.0, 0.0, 0.0, 0.0), self._vec(self.position)) @ Transform(
            Q_FRD_CAMERA_DOWN, (0.0, 0.0, 0.05)
        )
        X_CP = X_WC.inverse() @ Transform(quaternion_from_euler(0.0, 0.0, 0.0), self._vec(self.pad))
        in_view = abs(X_CP.p[0]) < 0.85 * X_CP.p[2] and abs(X_CP.p[1]) < 0.5 * X_CP.p[2]
        if in_view:
            self.handle(PadObservation(self.t_ns, "down", "test", X_CP.p, VARIANCE, X_CP.q))

    @staticmethod
    def _vec(values: list[float]) -> Vec3:
        return (values[0], values[1], values[2])

    def run(self, seconds: float) -> None:
        """Until the time is over, or for a moment after the motors have stopped."""
        left = round(seconds / DT_S)
        while left > 0:
            left = left - 1 if self.armed else min(left - 1, 10)
            self.step()

    def phases(self) -> list[Phase]:
        return [output.after for output in self.outputs if isinstance(output, PhaseChanged)]


def started() -> PointMassWorld:
    world = PointMassWorld(Pipeline(Config()))
    world.run(0.5)
    world.handle(OperatorCommand(world.t_ns, OperatorAction.START, "test"))
    return world


def test_the_vehicle_finds_follows_touches_and_is_disarmed_on_the_pad() -> None:
    world = started()
    world.run(60.0)
    assert world.phases()[-1] is Phase.DONE
    assert math.hypot(world.position[0] - world.pad[0], world.position[1] - world.pad[1]) < 0.1


def test_the_forced_disarm_carries_its_evidence_and_follows_a_refused_plain_one() -> None:
    world = started()
    world.run(60.0)
    commands = [output for output in world.outputs if isinstance(output, VehicleCommand)]
    assert [command.kind for command in commands][-2:] == [CommandKind.DISARM, CommandKind.FORCE_DISARM]
    assert len(commands[-1].evidence) == 5
    assert world.standing


def test_same_inputs_same_outputs() -> None:
    first, second = started(), started()
    first.run(20.0)
    second.run(20.0)
    assert first.outputs == second.outputs


def test_without_fresh_mode_reports_no_setpoint_leaves() -> None:
    world = started()
    world.run(5.0)
    world.frozen_mode_reports = True
    world.run(1.0)
    world.outputs.clear()
    world.run(2.0)
    assert not [output for output in world.outputs if isinstance(output, VelocitySetpoint)]


def test_without_vehicle_state_no_setpoint_leaves() -> None:
    world = started()
    world.run(5.0)
    world.outputs.clear()
    for _ in range(50):
        world.t_s += DT_S
        world.handle(world._status())
        world.handle(Tick(world.t_ns))
    late = [o for o in world.outputs if isinstance(o, VelocitySetpoint) and o.t_ns > world.t_ns - 700_000_000]
    assert not late


def test_setpoints_die_soon_after_they_are_made() -> None:
    world = started()
    world.run(3.0)
    lives = {o.valid_until_ns - o.t_ns for o in world.outputs if isinstance(o, VelocitySetpoint)}
    assert lives == {100_000_000}


@pytest.mark.parametrize("hidden_s", [1.0, 2.0])
def test_a_marker_hidden_in_the_descent_delays_the_landing_and_does_not_spoil_it(hidden_s: float) -> None:
    world = started()
    while world.pipeline.phase is not Phase.DESCEND:
        world.step()
    world.run(1.0)
    world.marker_hidden = True
    world.run(hidden_s)
    assert world.armed
    world.marker_hidden = False
    world.run(60.0)
    assert world.phases()[-1] is Phase.DONE
    assert math.hypot(world.position[0] - world.pad[0], world.position[1] - world.pad[1]) < 0.15
