"""What a control law is given and what it gives. Everything is in W (NED), SI; `relative` is vehicle minus pad."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from companion.geometry import IDENTITY_QUATERNION, ZERO
from companion.messages import Quaternion, Vec3


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
    `pad_acceleration_ahead_m_s2` are for the moment at which a setpoint sent now will act (`lead_s` later). The vehicle's own
    velocity, position and attitude are for laws that look at more than the difference; `goal_position_m` (vehicle minus pad) is where
    the reference leads to, for laws that know no reference; `pad_yaw_rad` is None until the pad has been seen.
    """

    dt_s: float
    relative_position_m: Vec3
    relative_velocity_m_s: Vec3
    reference: Reference
    reference_ahead: Reference
    pad_velocity_ahead_m_s: Vec3
    pad_acceleration_ahead_m_s2: Vec3
    feedback: bool = True
    velocity_ned_m_s: Vec3 = ZERO
    position_ned_m: Vec3 = ZERO
    q_ned_frd: Quaternion = IDENTITY_QUATERNION
    goal_position_m: Vec3 | None = None
    pad_yaw_rad: float | None = None


@dataclass(frozen=True, slots=True)
class ControlOutput:
    """Velocity to ask for and the acceleration to send with it, before the limits of `limits.py`."""

    velocity_ned_m_s: Vec3
    acceleration_ned_m_s2: Vec3


@dataclass(frozen=True, slots=True)
class YawInput:
    """All that a yaw law may look at. Angles in rad, NED. `relative_position_m` is vehicle minus pad, None without a pad.
    `pad_yaw_rad` is known once the pad has been seen; `announced_yaw_rad` is what its beacon says before."""

    yaw_rad: float
    initial_yaw_rad: float
    pad_yaw_rad: float | None
    velocity_ned_m_s: Vec3
    yaw_rate_rad_s: float = 0.0
    commanded_velocity_ned_m_s: Vec3 = ZERO
    relative_position_m: Vec3 | None = None
    announced_yaw_rad: float | None = None


class Controller(Protocol):
    """A control law with its own small state (integrators)."""

    def update(self, control: ControlInput) -> ControlOutput:
        """The command for this instant."""

    def reset(self) -> None:
        """Forget integrators: called when control is taken up."""
