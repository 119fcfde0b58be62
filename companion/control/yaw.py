"""Yaw laws: which way the nose should point. Each gives the yaw error in rad; the loop around them multiplies by `yaw_gain_hz`."""

from __future__ import annotations

import math

from companion.control.law import YawInput
from companion.geometry import horizontal_norm, wrap_pi
from companion.messages import Vec3

TRAVEL_SPEED_M_S = 0.5
"""Below this speed the direction of travel is noise and the nose stays where it is."""

DAMPING_S = 0.5 / 2.5
"""`dalang`: yaw rate = 2.5 (alpha_r - alpha) - 0.5 omega, with `yaw_gain_hz = 2.5` taken out of both."""

BOX_AHEAD_M, BOX_BEHIND_M, BOX_HALF_ACROSS_M, BOX_HEIGHT_M = 0.15, 0.10, 0.25, 0.60
"""`guo`'s box around the landing point. The paper says 50 cm long, 25 cm wide, 60 cm high, 15 cm to the front plane and 10 cm to
the rear one; read as 15 + 10 = 25 cm along the pad's heading, 50 cm across it, and from the deck 60 cm up."""


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


def yaw_to_command(yaw: YawInput) -> float:
    """`dalang`: point along the velocity that is asked for, with the yaw rate damped."""
    damping = DAMPING_S * yaw.yaw_rate_rad_s
    north, east, _ = yaw.commanded_velocity_ned_m_s
    if math.hypot(north, east) < TRAVEL_SPEED_M_S:
        return -damping
    return wrap_pi(math.atan2(east, north) - yaw.yaw_rad) - damping


def yaw_in_box(yaw: YawInput) -> float:
    """`guo`: turn to the announced heading while the pad has not been seen, then leave the nose alone until inside the box
    around the landing point, and there turn to the heading that is seen."""
    if yaw.pad_yaw_rad is None and yaw.announced_yaw_rad is not None:
        return wrap_pi(yaw.announced_yaw_rad - yaw.yaw_rad)
    if yaw.pad_yaw_rad is None or yaw.relative_position_m is None:
        return 0.0
    return yaw_to_pad(yaw) if _is_in_box(yaw.relative_position_m, yaw.pad_yaw_rad) else 0.0


def _is_in_box(relative_m: Vec3, pad_yaw_rad: float) -> bool:
    cos, sin = math.cos(pad_yaw_rad), math.sin(pad_yaw_rad)
    along = cos * relative_m[0] + sin * relative_m[1]
    across = cos * relative_m[1] - sin * relative_m[0]
    level = 0.0 <= -relative_m[2] <= BOX_HEIGHT_M
    return level and -BOX_BEHIND_M <= along <= BOX_AHEAD_M and abs(across) <= BOX_HALF_ACROSS_M
