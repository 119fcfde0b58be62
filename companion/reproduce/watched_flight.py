"""A simulated flight and what is drawn or measured of it: truth, phases, estimates, setpoints, all on one time axis.

Time in s since the world began; W local NED, SI, angles in rad. Reproductions fly through `watched`; nothing here decides.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from companion.campaign.runner import CLOCK_OFFSET_NS, FlightResult, fly
from companion.config import Config, load_with
from companion.geometry import subtract, yaw_of
from companion.messages import (
    PadBearing,
    PadEstimate,
    PadNotSeen,
    PadObservation,
    Phase,
    PhaseChanged,
    Vec3,
    VehicleState,
)
from companion.onboard import JournalEntry
from sitl_stub.scenario import find, load, with_overrides
from sitl_stub.world import Truth


@dataclass(frozen=True, slots=True)
class Instant:
    """What was true at one time. `in_pad_m` is the vehicle in the pad's frame (x ahead, y right, z down)."""

    t_s: float
    phase: Phase
    vehicle_m: Vec3
    velocity_m_s: Vec3
    yaw_rad: float
    pad_m: Vec3
    pad_velocity_m_s: Vec3
    pad_yaw_rad: float
    in_pad_m: Vec3
    mode: str


class FlightWatch:
    """A Sink. `instants` come at 20 Hz, `estimates` with every tick, `sights` with every frame that was searched;
    `relative_velocities` are the estimated pad's minus the autopilot's own, W."""

    def __init__(self) -> None:
        self.phase = Phase.IDLE
        self.instants: list[Instant] = []
        self.changes: list[tuple[float, PhaseChanged]] = []
        self.estimates: list[tuple[float, PadEstimate]] = []
        self.relative_velocities: list[tuple[float, Vec3]] = []
        self.state: VehicleState | None = None
        self.sights: list[tuple[float, PadObservation | PadBearing]] = []
        self.misses: list[tuple[float, PadNotSeen]] = []

    def datagram(self, now_ns: int, data: bytes, *, outgoing: bool) -> None:
        pass

    def journal(self, entries: Sequence[JournalEntry]) -> None:
        for entry in entries:
            t_s = (entry.arrived_ns - CLOCK_OFFSET_NS) / 1e9
            match entry.message:
                case PhaseChanged() as change:
                    self.phase = change.after
                    self.changes.append((t_s, change))
                case VehicleState() as state:
                    self.state = state
                case PadEstimate() as estimate:
                    self.estimates.append((t_s, estimate))
                    if self.state is not None:
                        seen = subtract(estimate.velocity_ned_m_s, self.state.velocity_ned_m_s)
                        self.relative_velocities.append((t_s, seen))
                case PadObservation() | PadBearing() as sight:
                    self.sights.append((t_s, sight))
                case PadNotSeen() as miss:
                    self.misses.append((t_s, miss))
                case _:
                    pass

    def truth(self, now_ns: int, truth: Truth) -> None:
        self.instants.append(
            Instant(
                t_s=truth.t_us / 1e6,
                phase=self.phase,
                vehicle_m=truth.vehicle.position_ned_m,
                velocity_m_s=truth.vehicle.velocity_ned_m_s,
                yaw_rad=yaw_of(truth.vehicle.q_ned_frd),
                pad_m=truth.pad_position_ned_m,
                pad_velocity_m_s=truth.pad_velocity_ned_m_s,
                pad_yaw_rad=yaw_of(truth.pad_q_ned_pad),
                in_pad_m=truth.vehicle_in_pad_m,
                mode=truth.mode,
            )
        )

    def close(self) -> None:
        pass

    def entered_s(self, phase: Phase) -> float | None:
        """When the phase first began."""
        return next((t_s for t_s, change in self.changes if change.after is phase), None)


@dataclass(frozen=True, slots=True)
class WatchedFlight:
    """A flight and its watch."""

    result: FlightResult
    watch: FlightWatch

    @property
    def landed(self) -> bool:
        return self.result.outcome == "landed"

    def seconds(self, first: Phase, last: Phase) -> float | None:
        """From the first beginning of one phase to that of another."""
        begin, end = self.watch.entered_s(first), self.watch.entered_s(last)
        return None if begin is None or end is None else end - begin


def preset(key: str, overrides: Mapping[str, Any] | None = None) -> Config:
    """configs/papers/<key>.toml with other values for dotted keys."""
    from companion.reproduce.papers import preset_file

    return load_with([preset_file(key)], overrides or {})


def watched(config: Config, scenario: str, *, seed: int, world: Mapping[str, Any] | None = None) -> WatchedFlight:
    """Fly the scenario of that name (configs/scenarios/papers) once."""
    watch = FlightWatch()
    result = fly(
        with_overrides(load(find("scenarios/papers", scenario)), world or {}), config, seed=seed, sinks=[watch]
    )
    return WatchedFlight(result, watch)
