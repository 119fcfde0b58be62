"""Yaw laws: which way the nose should point. Each gives the yaw error in rad."""

from __future__ import annotations

import math

from companion.control.law import YawInput
from companion.geometry import horizontal_norm, wrap_pi

TRAVEL_SPEED_M_S = 0.5
"""Below this speed the direction of travel is noise and the nose stays where it is."""


def hold_yaw(yaw: YawInput) -> float:
    """Keep the heading that the vehicle had when control was taken up.

    `yaw_rate = 0` would not: PX4 then follows its own drifting yaw (measured: 7 degrees in 14 s at 3 m/s).
    """
    return wrap_pi(yaw.initial_yaw_rad - yaw.yaw_rad)


def yaw_to_pad(yaw: YawInput) -> float:
    """Point where the pad points; hold while its heading is unknown."""
    return hold_yaw(yaw) if yaw.pad_yaw_rad is None else wrap_pi(yaw.pad_yaw_rad - yaw.yaw_rad)


def yaw_to_travel(yaw: YawInput) -> float:
    """Point where the vehicle flies."""
    if horizontal_norm(yaw.velocity_ned_m_s) < TRAVEL_SPEED_M_S:
        return 0.0
    return wrap_pi(math.atan2(yaw.velocity_ned_m_s[1], yaw.velocity_ned_m_s[0]) - yaw.yaw_rad)
