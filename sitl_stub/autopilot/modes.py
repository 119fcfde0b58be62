"""PX4's flight modes: navigation states, their MAVLink custom modes, and what each needs.

Numbers of `NavState` are PX4's own (they appear in events). Facts from a recorded PX4 v1.17: base_mode per mode, DESCEND is
shown as ALTCTL, the AUTO sub modes, and the modes that can't be armed in.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

MAV_MODE_CUSTOM = 1
MAV_MODE_AUTO = 4
MAV_MODE_GUIDED = 8
MAV_MODE_STABILIZE = 16
MAV_MODE_MANUAL = 64
MAV_MODE_ARMED = 128


class NavState(IntEnum):
    """PX4's vehicle_status.nav_state."""

    MANUAL = 0
    ALTCTL = 1
    POSCTL = 2
    AUTO_MISSION = 3
    AUTO_LOITER = 4
    AUTO_RTL = 5
    ACRO = 10
    DESCEND = 12
    TERMINATION = 13
    OFFBOARD = 14
    STABILIZED = 15
    AUTO_TAKEOFF = 17
    AUTO_LAND = 18
    AUTO_FOLLOW = 19
    AUTO_PRECLAND = 20


_AUTO = MAV_MODE_CUSTOM | MAV_MODE_AUTO | MAV_MODE_GUIDED | MAV_MODE_STABILIZE
_PILOT = MAV_MODE_CUSTOM | MAV_MODE_MANUAL | MAV_MODE_STABILIZE


@dataclass(frozen=True, slots=True)
class Mode:
    """What MAVLink shows of a mode and what the mode needs to run or to arm in."""

    nav_state: NavState
    main: int
    sub: int
    base_flags: int
    can_arm: bool = True
    needs_sticks: bool = False
    needs_mission: bool = False
    needs_offboard: bool = False
    needs_position: bool = True

    @property
    def custom_mode(self) -> int:
        """HEARTBEAT.custom_mode."""
        return self.sub << 24 | self.main << 16


MODES: dict[NavState, Mode] = {
    mode.nav_state: mode
    for mode in (
        Mode(NavState.MANUAL, 1, 0, _PILOT, needs_sticks=True, needs_position=False),
        Mode(NavState.ALTCTL, 2, 0, _PILOT, needs_sticks=True, needs_position=False),
        Mode(NavState.POSCTL, 3, 0, _PILOT, needs_sticks=True),
        Mode(NavState.AUTO_MISSION, 4, 4, _AUTO, needs_mission=True),
        Mode(NavState.AUTO_LOITER, 4, 3, _AUTO),
        Mode(NavState.AUTO_RTL, 4, 5, _AUTO, can_arm=False),
        Mode(NavState.ACRO, 5, 0, MAV_MODE_CUSTOM | MAV_MODE_MANUAL, needs_sticks=True, needs_position=False),
        Mode(NavState.DESCEND, 2, 0, _PILOT, can_arm=False, needs_position=False),
        Mode(NavState.TERMINATION, 10, 0, MAV_MODE_CUSTOM, can_arm=False, needs_position=False),
        Mode(NavState.OFFBOARD, 6, 0, MAV_MODE_CUSTOM | MAV_MODE_STABILIZE, needs_offboard=True),
        Mode(NavState.STABILIZED, 7, 0, _PILOT, needs_sticks=True, needs_position=False),
        Mode(NavState.AUTO_TAKEOFF, 4, 2, _AUTO),
        Mode(NavState.AUTO_LAND, 4, 6, _AUTO, can_arm=False),
        Mode(NavState.AUTO_FOLLOW, 4, 8, MAV_MODE_CUSTOM | MAV_MODE_STABILIZE, can_arm=False),
        Mode(NavState.AUTO_PRECLAND, 4, 9, _AUTO, can_arm=False),
    )
}

_AUTO_SUB_MODES = {
    0: NavState.AUTO_MISSION,
    2: NavState.AUTO_TAKEOFF,
    3: NavState.AUTO_LOITER,
    4: NavState.AUTO_MISSION,
    5: NavState.AUTO_RTL,
    6: NavState.AUTO_LAND,
    8: NavState.AUTO_FOLLOW,
    9: NavState.AUTO_PRECLAND,
}
_MAIN_MODES = {
    1: NavState.MANUAL,
    2: NavState.ALTCTL,
    3: NavState.POSCTL,
    5: NavState.ACRO,
    6: NavState.OFFBOARD,
    7: NavState.STABILIZED,
}
MAIN_AUTO = 4


def mode_from_custom(main: int, sub: int) -> NavState | None:
    """Mode a client asks for; None for a main mode PX4 takes without effect.

    Raises:
        ValueError: an AUTO sub mode PX4 calls unsupported.
    """
    if main != MAIN_AUTO:
        return _MAIN_MODES.get(main)
    if sub not in _AUTO_SUB_MODES:
        raise ValueError(f"unsupported auto mode {sub}")
    return _AUTO_SUB_MODES[sub]
