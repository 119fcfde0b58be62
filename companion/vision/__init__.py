"""Frames to observations of the pad. One detector per file behind one Protocol; `DETECTORS` names them for the config."""

from __future__ import annotations

from collections.abc import Callable

from companion import config
from companion.vision.aruco import ArucoDetector
from companion.vision.blind import BlindDetector
from companion.vision.camera_model import CameraModel
from companion.vision.colour import ColourDetector
from companion.vision.cross import CrossDetector
from companion.vision.detector import Detection, DetectionHint, Detector
from companion.vision.lens import CAMERA_MODELS
from companion.vision.stereo_pair import StereoDetector
from companion.vision.vertical import vertical_detector

DETECTORS: dict[str, Callable[[config.Vision, config.Pad, CameraModel], Detector]] = {
    "aruco": ArucoDetector,
    "colour": ColourDetector,
    "cross": CrossDetector,
    "none": BlindDetector,
    "stereo": StereoDetector,
    "vertical": vertical_detector,
}
"""Name in `[vision] detector` to the factory (vision, pad, lens)."""

__all__ = ["CAMERA_MODELS", "DETECTORS", "CameraModel", "Detection", "DetectionHint", "Detector"]
