"""PX4's custom mode: main mode in byte 2, sub mode of AUTO in byte 3 (px4_custom_mode.h)."""

from __future__ import annotations

from companion.messages import AutopilotMode

MAIN_OFFBOARD = 6
MAIN_AUTO = 4
SUB_LOITER, SUB_RTL, SUB_LAND = 3, 5, 6

_MAIN = {
    1: AutopilotMode.MANUAL,
    2: AutopilotMode.ALTITUDE,
    3: AutopilotMode.POSITION,
    5: AutopilotMode.ACRO,
    MAIN_OFFBOARD: AutopilotMode.OFFBOARD,
    7: AutopilotMode.STABILIZED,
    10: AutopilotMode.TERMINATION,
}
_AUTO = {
    0: AutopilotMode.MISSION,
    2: AutopilotMode.TAKEOFF,
    SUB_LOITER: AutopilotMode.HOLD,
    4: AutopilotMode.MISSION,
    SUB_RTL: AutopilotMode.RETURN,
    SUB_LAND: AutopilotMode.LAND,
    8: AutopilotMode.FOLLOW,
    9: AutopilotMode.PRECISION_LAND,
}


def mode_from_custom(custom_mode: int) -> AutopilotMode:
    """OTHER for what PX4 may add."""
    main, sub = custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF
    if main == MAIN_AUTO:
        return _AUTO.get(sub, AutopilotMode.OTHER)
    return _MAIN.get(main, AutopilotMode.OTHER)
