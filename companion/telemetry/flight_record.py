"""What a report is drawn from: the series of one flight, gathered message by message. Times are seconds since the start."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, Protocol

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

MOST_POINTS = 8000
"""Of one series: four times what a chart draws. A long flight is kept with fewer points a second, so that memory stays."""


@dataclass(slots=True)
class Series:
    """One quantity over time."""

    t_s: list[float] = field(default_factory=list)
    values: list[Vec3] = field(default_factory=list)
    thinning: Thinning = field(default_factory=lambda: Thinning())

    def add(self, t_s: float, value: Vec3) -> None:
        if self.thinning.takes(self.t_s, self.values):
            self.t_s.append(t_s)
            self.values.append(value)

    def axis(self, index: int) -> list[float]:
        return [value[index] for value in self.values]


PAUSE_S = (0.1, 2.0)
"""Between two setpoints: longer is a pause, still longer is that nothing was to be sent."""

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
    thinning: Thinning = field(default_factory=lambda: Thinning())

    def add(self, t_s: float, value: float) -> None:
        if self.thinning.takes(self.t_s, self.values):
            self.t_s.append(t_s)
            self.values.append(value)


@dataclass(slots=True)
class Thinning:
    """Every `stride`-th point is taken; a full series loses every other point and the stride doubles."""

    stride: int = 1
    offered: int = 0

    def takes(self, *columns: list[Any]) -> bool:
        """Whether the point that comes next belongs into the columns, for which room is made."""
        self.offered += 1
        if (self.offered - 1) % self.stride:
            return False
        if len(columns[0]) >= MOST_POINTS:
            for column in columns:
                del column[1::2]
            self.stride *= 2
        return True


@dataclass(slots=True)
class FlightRecord:
    """Vehicle and pad as Companion believed them (`vehicle`, `pad` in NED; relative) and, in simulation, as they were
    (`true_*`, NED). `nis` and `innovations` are by source and number of components, `judged` counts verdicts by source and reason,
    `model_probabilities` are by model."""

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
    innovations: dict[tuple[str, int], list[Values]] = field(default_factory=dict)
    judged: dict[tuple[str, bool, str], int] = field(default_factory=dict)
    model_probabilities: dict[str, Values] = field(default_factory=dict)
    delays_s: dict[str, Values] = field(default_factory=dict)
    true_vehicle: Series = field(default_factory=Series)
    true_pad: Series = field(default_factory=Series)
    seen_s: list[float] = field(default_factory=list)
    not_seen_s: list[float] = field(default_factory=list)
    rejected_s: list[float] = field(default_factory=list)
    phases: list[tuple[float, Phase, str]] = field(default_factory=list)
    requests: list[tuple[float, str]] = field(default_factory=list)
    health: list[tuple[float, Health]] = field(default_factory=list)
    setpoint_gaps_s: Values = field(default_factory=Values)
    setpoint_pauses_s: list[float] = field(default_factory=list)
    last_setpoint_s: float | None = None
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
                for model, probability in message.model_probabilities:
                    self.model_probabilities.setdefault(model, Values()).add(t_s, probability)
            case VelocitySetpoint():
                self._add_setpoint(t_s, message)
            case PadObservation():
                self.seen_s.append(t_s)
                if any(sample.t_ns == message.t_ns for sample in self.samples):
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

    def _add_setpoint(self, t_s: float, setpoint: VelocitySetpoint) -> None:
        self.setpoint.add(t_s, setpoint.velocity_ned_m_s)
        gap_s = None if self.last_setpoint_s is None else t_s - self.last_setpoint_s
        self.last_setpoint_s = t_s
        if gap_s is not None:
            self.setpoint_gaps_s.add(t_s, gap_s)
            if PAUSE_S[0] < gap_s < PAUSE_S[1]:
                self.setpoint_pauses_s.append(gap_s)

    def _add_verdict(self, t_s: float, verdict: MeasurementVerdict) -> None:
        judged = (str(verdict.source), verdict.accepted, verdict.reason)
        self.judged[judged] = self.judged.get(judged, 0) + 1
        if not verdict.accepted:
            self.rejected_s.append(t_s)
        if verdict.nis is not None:
            key = (str(verdict.source), max(1, len(verdict.innovation)))
            self.nis.setdefault(key, Values()).add(t_s, verdict.nis)
            each = self.innovations.setdefault(key, [Values() for _ in verdict.innovation])
            for series, value in zip(each, verdict.innovation, strict=True):
                series.add(t_s, value)

    def add_truth(self, t_ns: int, vehicle_ned_m: Vec3, pad_ned_m: Vec3) -> None:
        """Simulation only: where vehicle and pad really are."""
        t_s = self.seconds(t_ns)
        self.true_vehicle.add(t_s, vehicle_ned_m)
        self.true_pad.add(t_s, pad_ned_m)
