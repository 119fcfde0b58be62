"""What automatic modes have in common: the situation they see and the target they set.

A route (take-off, loiter, land, return, precision landing) turns the situation into a `NavigationTarget` each step; `AutoFlight` draws
the smoothed point to it. `kind` is what EXTENDED_SYS_STATE tells: a target of kind LAND shows as LANDING, TAKEOFF as TAKEOFF. Local NED.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, auto
from math import hypot
from typing import Protocol

from sitl_stub.autopilot.events import Notice
from sitl_stub.autopilot.parameters import Parameters
from sitl_stub.autopilot.trajectory import braking_distance_m

Vector = tuple[float, float, float]


class TargetKind(Enum):
    """PX4's position setpoint type."""

    IDLE = auto()
    POSITION = auto()
    TAKEOFF = auto()
    LAND = auto()


@dataclass(frozen=True, slots=True)
class NavigationTarget:
    """Where to go; z is not used for LAND, which sinks until the ground is there."""

    kind: TargetKind
    x_m: float
    y_m: float
    z_m: float
    yaw_rad: float | None = None


@dataclass(slots=True)
class Situation:
    """What the vehicle knows of itself in this step (estimates, not truth)."""

    t_us: int
    dt_s: float
    position_ned_m: Vector
    velocity_ned_m_s: Vector
    yaw_rad: float
    height_above_ground_m: float | None
    home_ned_m: Vector
    home_altitude_amsl_m: float
    landed: bool
    parameters: Parameters
    tell: Callable[[Notice], None]

    def stop_point(self) -> NavigationTarget:
        """Hold where the vehicle comes to rest when it brakes now."""
        x, y, z = self.position_ned_m
        vx, vy, _ = self.velocity_ned_m_s
        speed = hypot(vx, vy)
        way = braking_distance_m(speed, self.parameters.get("MPC_ACC_HOR"))
        ux, uy = (vx / speed, vy / speed) if speed > 1e-3 else (0.0, 0.0)
        return NavigationTarget(TargetKind.POSITION, x + ux * way, y + uy * way, z)


class Route(Protocol):
    """One automatic mode."""

    def enter(self, situation: Situation, previous: NavigationTarget | None) -> None:
        """Start; `previous` is the target of the automatic mode that flew before, None after any other mode."""

    def update(self, situation: Situation) -> NavigationTarget:
        """Target of this step."""

    @property
    def done(self) -> bool:
        """The mode has reached its end and PX4 goes on to loiter."""
