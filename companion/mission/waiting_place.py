"""Where the vehicle waits for the descent: above the pad, or behind a pad whose upright marker a forward camera looks at.

Relative to the pad, NED axes, m. Asked by goals (where to fly) and guards (is it there).
"""

from __future__ import annotations

import math

from companion.config import Mission
from companion.messages import Vec3
from companion.mission.facts import Facts

BEHIND_STEP_RAD = math.radians(10.0)
"""The place behind the pad follows its heading in steps: a goal that moves with every estimate is never reached."""


def waiting_place_m(height_m: float, facts: Facts, mission: Mission) -> Vec3:
    """Above the pad, or above a point behind it; relative to the pad, NED axes."""
    behind_m = mission.follow_behind_m
    if behind_m == 0.0 or facts.pad is None:
        return (0.0, 0.0, -height_m)
    yaw_rad = BEHIND_STEP_RAD * round(facts.pad.yaw_rad / BEHIND_STEP_RAD)
    return (-behind_m * math.cos(yaw_rad), -behind_m * math.sin(yaw_rad), -height_m)
