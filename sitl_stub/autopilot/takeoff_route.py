"""AUTO.TAKEOFF: straight up to an altitude above sea level, or MIS_TAKEOFF_ALT above the present one.

A target below the present altitude is refused in words only: the vehicle stays where it is. Ends when the altitude is reached within
NAV_MC_ALT_RAD.
"""

from __future__ import annotations

from sitl_stub.autopilot import events
from sitl_stub.autopilot.navigation import NavigationTarget, Situation, TargetKind

_SAME_HEIGHT_M = 0.2


class TakeoffRoute:
    """Climbs to `altitude_amsl_m` (None: the default height above where it is when armed)."""

    def __init__(self, altitude_amsl_m: float | None = None) -> None:
        self._altitude_amsl_m = altitude_amsl_m
        self._target: NavigationTarget | None = None
        self._reached = False

    @property
    def done(self) -> bool:
        return self._reached

    def enter(self, situation: Situation, previous: NavigationTarget | None) -> None:
        self._target = None
        self._reached = False

    def update(self, situation: Situation) -> NavigationTarget:
        if self._target is None:
            self._target = self._aim(situation)
        height_left = situation.position_ned_m[2] - self._target.z_m
        self._reached = not situation.landed and height_left < situation.parameters.get("NAV_MC_ALT_RAD")
        return self._target

    def _aim(self, situation: Situation) -> NavigationTarget:
        x, y, z = situation.position_ned_m
        if self._altitude_amsl_m is None:
            height = situation.parameters.get("MIS_TAKEOFF_ALT")
            situation.tell(events.default_takeoff_altitude(height))
            return NavigationTarget(TargetKind.TAKEOFF, x, y, z - height)
        target_z = situation.home_ned_m[2] - (self._altitude_amsl_m - situation.home_altitude_amsl_m)
        if target_z > z - _SAME_HEIGHT_M:
            situation.tell(events.already_higher())
            return NavigationTarget(TargetKind.IDLE if situation.landed else TargetKind.TAKEOFF, x, y, z)
        return NavigationTarget(TargetKind.TAKEOFF, x, y, target_z)
