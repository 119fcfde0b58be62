"""What gravity says about a pad's pose: it lies roughly level, its upper side up."""

from __future__ import annotations

import math

from companion.geometry import dot, rotate
from companion.messages import Quaternion
from companion.vision.detector import DetectionHint

MAX_TILT_RAD = math.radians(45.0)
"""No pad that a vehicle could land on is tilted further; a pose that says so is not the pad's."""


def is_possible(q_CP: Quaternion, hint: DetectionHint | None) -> bool:
    """False where the pad would stand on edge or hang upside down. True where gravity's direction is unknown."""
    if hint is None or hint.down_camera is None:
        return True
    return dot(rotate(q_CP, (0.0, 0.0, 1.0)), hint.down_camera) >= math.cos(MAX_TILT_RAD)
