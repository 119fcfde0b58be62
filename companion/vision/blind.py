"""The detector that looks at nothing: for landings by the pad's own report alone (`mission.sight = "beacon"`)."""

from __future__ import annotations

from companion import config
from companion.messages import CameraImage, PadNotSeen
from companion.vision.camera_model import CameraModel
from companion.vision.detector import DetectionHint


class BlindDetector:
    """`detector = "none"`."""

    def __init__(self, vision: config.Vision, pad: config.Pad, lens: CameraModel) -> None:
        """Takes what every detector takes."""

    def detect(self, frame: CameraImage, hint: DetectionHint | None) -> PadNotSeen:
        return PadNotSeen(frame.t_ns, frame.camera, "none", "not looked at")
