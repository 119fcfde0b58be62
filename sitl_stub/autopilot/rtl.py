"""AUTO.RTL: climb, fly home, go down to RTL_DESCEND_ALT, land.

Inside RTL_MIN_DIST of home it flies back at its present height; further out it climbs to the cone of RTL_CONE_ANG around home, at most
to RTL_RETURN_ALT. Heading turns to home on the way.
"""

from __future__ import annotations

from enum import Enum, auto
from math import atan2, hypot, radians, tan

from sitl_stub.autopilot import events
from sitl_stub.autopilot.navigation import NavigationTarget, Situation, TargetKind


class _Leg(Enum):
    CLIMB = auto()
    RETURN = auto()
    DESCEND = auto()
    LAND = auto()


_SETTLE_US = 50_000


class Rtl:
    """State of the return."""

    done = False

    def __init__(self) -> None:
        self._leg = _Leg.CLIMB
        self._return_z_m = 0.0
        self._start: NavigationTarget | None = None
        self._entered_us = 0
        self._told = False

    def enter(self, situation: Situation, previous: NavigationTarget | None) -> None:
        self._leg = _Leg.CLIMB
        self._start = situation.stop_point()
        self._return_z_m = _return_z_m(situation)
        self._entered_us = situation.t_us
        self._told = False

    def update(self, situation: Situation) -> NavigationTarget:
        if situation.t_us - self._entered_us >= _SETTLE_US:
            self._tell_start(situation)
            self._advance(situation)
        return self._target(situation)

    def _tell_start(self, situation: Situation) -> None:
        if self._told:
            return
        self._told = True
        above = situation.home_ned_m[2] - self._return_z_m
        situation.tell(events.return_at(situation.home_altitude_amsl_m + above, above))

    def _advance(self, situation: Situation) -> None:
        near_height = situation.parameters.get("NAV_MC_ALT_RAD")
        z = situation.position_ned_m[2]
        if self._leg is _Leg.CLIMB and z <= self._return_z_m + near_height:
            self._leg = _Leg.RETURN
        if self._leg is _Leg.RETURN and _distance_home_m(situation) < situation.parameters.get("NAV_ACC_RAD"):
            self._leg = _Leg.DESCEND
        if self._leg is _Leg.DESCEND and z >= self._descend_z_m(situation) - near_height:
            self._leg = _Leg.LAND
            situation.tell(events.land_at_destination())

    def _descend_z_m(self, situation: Situation) -> float:
        return max(situation.home_ned_m[2] - situation.parameters.get("RTL_DESCEND_ALT"), self._return_z_m)

    def _target(self, situation: Situation) -> NavigationTarget:
        hx, hy, _ = situation.home_ned_m
        if self._leg is _Leg.CLIMB:
            assert self._start is not None
            return NavigationTarget(TargetKind.POSITION, self._start.x_m, self._start.y_m, self._return_z_m)
        if self._leg is _Leg.RETURN:
            x, y, _ = situation.position_ned_m
            far = _distance_home_m(situation) > situation.parameters.get("NAV_ACC_RAD")
            yaw = atan2(hy - y, hx - x) if far else None
            return NavigationTarget(TargetKind.POSITION, hx, hy, self._return_z_m, yaw)
        kind = TargetKind.LAND if self._leg is _Leg.LAND else TargetKind.POSITION
        return NavigationTarget(kind, hx, hy, self._descend_z_m(situation))


def _distance_home_m(situation: Situation) -> float:
    return hypot(
        situation.home_ned_m[0] - situation.position_ned_m[0], situation.home_ned_m[1] - situation.position_ned_m[1]
    )


def _return_z_m(situation: Situation) -> float:
    present = situation.position_ned_m[2]
    distance = _distance_home_m(situation)
    if distance <= situation.parameters.get("RTL_MIN_DIST"):
        return present
    highest = situation.parameters.get("RTL_RETURN_ALT")
    cone_deg = situation.parameters.get("RTL_CONE_ANG")
    height = min(distance / tan(radians(cone_deg)), highest) if cone_deg > 0.0 else highest
    return min(present, situation.home_ned_m[2] - height)
