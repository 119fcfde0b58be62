"""What every detector promises: one frame in, one message out.

A detector is a deterministic function of the frame, the hint and its own configuration. Tracking comes from the hint, which
the caller predicts to the frame's capture time; a detector itself remembers nothing between frames.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from companion.geometry import Transform
from companion.messages import CameraImage, PadBearing, PadNotSeen, PadObservation, Vec3

Detection = PadObservation | PadBearing | PadNotSeen


@dataclass(frozen=True, slots=True)
class DetectionHint:
    """What is known before the frame is looked at.

    `X_CP` is the predicted pose of the pad in the camera at the capture time (None: no idea) and `position_sigma_m` the
    standard deviation of its position on each axis. `down_camera` is the unit direction of gravity in C, from the vehicle's
    attitude: a pad is nearly level, which tells the two poses of a planar target apart. `is_expected` is False where what is
    known puts the pad surely outside the picture: such frames need not all be searched.
    """

    X_CP: Transform | None = None
    position_sigma_m: float = 1.0e3
    down_camera: Vec3 | None = None
    is_expected: bool = True


class Detector(Protocol):
    """Finds the pad. Never raises on image content: a frame without a pad is a `PadNotSeen` that says why."""

    def detect(self, frame: CameraImage, hint: DetectionHint | None) -> Detection: ...
