"""What a report is drawn from: the series of one flight, gathered message by message. Times are seconds since the start."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from companion.messages import (
    MeasurementVerdict,
    Message,
    MissionView,
    PadNotSeen,
    PadObservation,
    Phase,
    PhaseChanged,
    Vec3,
    VehicleCommand,
    VehicleState,
    VelocitySetpoint,
)


@dataclass(slots=True)
class Series:
    """One quantity over time."""

    t_s: list[float] = field(default_factory=list)
    values: list[Vec3] = field(default_factory=list)

    def add(self, t_s: float, value: Vec3) -> None:
        self.t_s.append(t_s)
        self.values.append(value)

    def axis(self, index: int) -> list[float]:
        return [value[index] for value in self.values]


@dataclass(slots=True)
class FlightRecord:
    """Vehicle and pad as Companion believed them (relative) and, in simulation, as they were (`true_*`, NED)."""

    start_ns: int | None = None
    end_s: float = 0.0
    relative: Series = field(default_factory=Series)
    relative_velocity: Series = field(default_factory=Series)
    vehicle_velocity: Series = field(default_factory=Series)
    setpoint: Series = field(default_factory=Series)
    true_vehicle: Series = field(default_factory=Series)
    true_pad: Series = field(default_factory=Series)
    seen_s: list[float] = field(default_factory=list)
    not_seen_s: list[float] = field(default_factory=list)
    rejected_s: list[float] = field(default_factory=list)
    phases: list[tuple[float, Phase, str]] = field(default_factory=list)
    requests: list[tuple[float, str]] = field(default_factory=list)

    def seconds(self, t_ns: int) -> float:
        if self.start_ns is None:
            self.start_ns = t_ns
        return (t_ns - self.start_ns) / 1e9

    def add_all(self, messages: Iterable[Message]) -> None:
        for message in messages:
            self.add(message)

    def add(self, message: Message) -> None:
        """Take one message into account."""
        t_s = self.seconds(message.t_ns)
        self.end_s = max(self.end_s, t_s)
        match message:
            case MissionView():
                if message.relative_position_ned_m is not None and message.relative_velocity_ned_m_s is not None:
                    self.relative.add(t_s, message.relative_position_ned_m)
                    self.relative_velocity.add(t_s, message.relative_velocity_ned_m_s)
            case VehicleState():
                self.vehicle_velocity.add(t_s, message.velocity_ned_m_s)
            case VelocitySetpoint():
                self.setpoint.add(t_s, message.velocity_ned_m_s)
            case PadObservation():
                self.seen_s.append(t_s)
            case PadNotSeen():
                self.not_seen_s.append(t_s)
            case MeasurementVerdict() if not message.accepted:
                self.rejected_s.append(t_s)
            case PhaseChanged():
                self.phases.append((t_s, message.after, message.reason))
            case VehicleCommand():
                evidence = f" [{'; '.join(message.evidence)}]" if message.evidence else ""
                self.requests.append((t_s, f"{message.kind}: {message.reason}{evidence}"))
            case _:
                pass

    def add_truth(self, t_ns: int, vehicle_ned_m: Vec3, pad_ned_m: Vec3) -> None:
        """Simulation only: where vehicle and pad really are."""
        t_s = self.seconds(t_ns)
        self.true_vehicle.add(t_s, vehicle_ned_m)
        self.true_pad.add(t_s, pad_ned_m)
