"""What a control law is given and what it gives. Everything is in W (NED), SI; `relative` is vehicle minus pad."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from companion.messages import Vec3


@dataclass(frozen=True, slots=True)
class Reference:
    """Where the vehicle should be relative to the pad (vehicle minus pad), and how that changes."""

    position_m: Vec3
    velocity_m_s: Vec3
    acceleration_m_s2: Vec3


@dataclass(frozen=True, slots=True)
class ControlInput:
    """All that a control law may look at.

    `relative_*` is vehicle minus pad now; `reference` is for now, `reference_ahead`, `pad_velocity_ahead_m_s` and
    `pad_acceleration_ahead_m_s2` are for the moment at which a setpoint sent now will act (`lead_s` later).
    """

    dt_s: float
    relative_position_m: Vec3
    relative_velocity_m_s: Vec3
    reference: Reference
    reference_ahead: Reference
    pad_velocity_ahead_m_s: Vec3
    pad_acceleration_ahead_m_s2: Vec3
    feedback: bool = True


@dataclass(frozen=True, slots=True)
class ControlOutput:
    """Velocity to ask for and the acceleration to send with it, before the limits of `limits.py`."""

    velocity_ned_m_s: Vec3
    acceleration_ned_m_s2: Vec3


@dataclass(frozen=True, slots=True)
class YawInput:
    """All that a yaw law may look at. Angles in rad, NED."""

    yaw_rad: float
    initial_yaw_rad: float
    pad_yaw_rad: float | None
    velocity_ned_m_s: Vec3


class Controller(Protocol):
    """A control law with its own small state (integrators)."""

    def update(self, control: ControlInput) -> ControlOutput:
        """The command for this instant."""

    def reset(self) -> None:
        """Forget integrators: called when control is taken up."""
