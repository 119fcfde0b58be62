"""What a report is drawn from: the series of one flight, gathered message by message. Times are seconds since the start."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Protocol

from companion.messages import (
    Health,
    Image,
    MeasurementVerdict,
    Message,
    MissionView,
    PadBeacon,
    PadEstimate,
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


SAMPLE_S = 1.0
MOST_SAMPLES = 48
"""Of camera frames kept for the strip; beyond it every other one goes and half as many come."""

DELAYED = {VehicleState: "vehicle state", PadObservation: "frames", PadNotSeen: "frames", PadBeacon: "beacon"}


class Journaled(Protocol):
    """A message as it was handled: see onboard.JournalEntry and mcap_log.LoggedEntry."""

    @property
    def arrived_ns(self) -> int: ...

    @property
    def message(self) -> Message: ...


@dataclass(frozen=True, slots=True)
class FrameSample:
    """A camera frame for the strip: pixels, or the JPEG as it came. `t_ns` is its capture."""

    t_s: float
    t_ns: int
    content: Image | bytes


@dataclass(slots=True)
class Values:
    """One number over time."""

    t_s: list[float] = field(default_factory=list)
    values: list[float] = field(default_factory=list)

    def add(self, t_s: float, value: float) -> None:
        self.t_s.append(t_s)
        self.values.append(value)


@dataclass(slots=True)
class FlightRecord:
    """Vehicle and pad as Companion believed them (`vehicle`, `pad` in NED; relative) and, in simulation, as they were
    (`true_*`, NED). `nis` is by source and number of components."""

    start_ns: int | None = None
    end_s: float = 0.0
    relative: Series = field(default_factory=Series)
    relative_velocity: Series = field(default_factory=Series)
    vehicle_velocity: Series = field(default_factory=Series)
    setpoint: Series = field(default_factory=Series)
    vehicle: Series = field(default_factory=Series)
    pad: Series = field(default_factory=Series)
    pad_sigma_m: Values = field(default_factory=Values)
    nis: dict[tuple[str, int], Values] = field(default_factory=dict)
    delays_s: dict[str, Values] = field(default_factory=dict)
    true_vehicle: Series = field(default_factory=Series)
    true_pad: Series = field(default_factory=Series)
    seen_s: list[float] = field(default_factory=list)
    not_seen_s: list[float] = field(default_factory=list)
    rejected_s: list[float] = field(default_factory=list)
    phases: list[tuple[float, Phase, str]] = field(default_factory=list)
    requests: list[tuple[float, str]] = field(default_factory=list)
    health: list[tuple[float, Health]] = field(default_factory=list)
    corners_px: dict[int, tuple[tuple[float, float], ...]] = field(default_factory=dict)
    samples: list[FrameSample] = field(default_factory=list)
    sample_every_s: float = SAMPLE_S

    def seconds(self, t_ns: int) -> float:
        if self.start_ns is None:
            self.start_ns = t_ns
        return (t_ns - self.start_ns) / 1e9

    def add_entries(self, entries: Iterable[Journaled]) -> None:
        """Messages with their arrival, which tells how late they came."""
        for entry in entries:
            self.add(entry.message)
            kind = DELAYED.get(type(entry.message))
            if kind is not None:
                late_s = (entry.arrived_ns - entry.message.t_ns) / 1e9
                self.delays_s.setdefault(kind, Values()).add(self.seconds(entry.arrived_ns), late_s)

    def add_frame(self, t_ns: int, content: Image | bytes) -> None:
        """Offered every frame, keeps one now and then."""
        t_s = self.seconds(t_ns)
        if self.samples and t_s - self.samples[-1].t_s < self.sample_every_s:
            return
        self.samples.append(FrameSample(t_s, t_ns, content))
        if len(self.samples) > MOST_SAMPLES:
            del self.samples[1::2]
            self.sample_every_s *= 2.0

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
                self.vehicle.add(t_s, message.position_ned_m)
                self.vehicle_velocity.add(t_s, message.velocity_ned_m_s)
            case PadEstimate():
                self.pad.add(t_s, message.position_ned_m)
                self.pad_sigma_m.add(t_s, message.position_sigma_m)
            case VelocitySetpoint():
                self.setpoint.add(t_s, message.velocity_ned_m_s)
            case PadObservation():
                self.seen_s.append(t_s)
                self.corners_px[message.t_ns] = message.corners_px
            case PadNotSeen():
                self.not_seen_s.append(t_s)
            case MeasurementVerdict():
                self._add_verdict(t_s, message)
            case Health() if message.level > 0:
                self.health.append((t_s, message))
            case PhaseChanged():
                self.phases.append((t_s, message.after, message.reason))
            case VehicleCommand():
                evidence = f" [{'; '.join(message.evidence)}]" if message.evidence else ""
                self.requests.append((t_s, f"{message.kind}: {message.reason}{evidence}"))
            case _:
                pass

    def _add_verdict(self, t_s: float, verdict: MeasurementVerdict) -> None:
        if not verdict.accepted:
            self.rejected_s.append(t_s)
        if verdict.nis is not None:
            components = max(1, len(verdict.innovation))
            self.nis.setdefault((str(verdict.source), components), Values()).add(t_s, verdict.nis)

    def add_truth(self, t_ns: int, vehicle_ned_m: Vec3, pad_ned_m: Vec3) -> None:
        """Simulation only: where vehicle and pad really are."""
        t_s = self.seconds(t_ns)
        self.true_vehicle.add(t_s, vehicle_ned_m)
        self.true_pad.add(t_s, pad_ned_m)
