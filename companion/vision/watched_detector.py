"""A detector behind a watch on its camera: a picture that shows nothing of now is never searched.

Both shells search frames through it, so that a frozen or mis-sized camera is refused in the simulator as in the air.
"""

from __future__ import annotations

from companion.messages import CameraImage, Health, PadNotSeen
from companion.vision.detector import Detection, DetectionHint, Detector
from companion.vision.frame_watch import PictureWatch

SEARCHED_ANYWAY = 10
"""One frame in so many is searched even where the pad cannot be expected: the beacon may be wrong."""

UNSEEN_PERIOD = 2
"""Until the pad has been seen, every second frame is searched: a whole frame costs several tracked ones."""


class WatchedDetector:
    """A `Detector`. `take_health` gives what the watch noticed since it was asked last."""

    def __init__(self, detector: Detector, name: str, watch: PictureWatch) -> None:
        self._detector = detector
        self._name = name
        self._watch = watch
        self._health: list[Health] = []

    def detect(self, frame: CameraImage, hint: DetectionHint | None) -> Detection:
        reason, health = self._watch.look(frame)
        self._health += health
        if reason is not None:
            return PadNotSeen(frame.t_ns, frame.camera, self._name, reason)
        if hint is not None and frame.sequence % _period(hint):
            return PadNotSeen(
                frame.t_ns, frame.camera, self._name, "not searched: the pad is not expected in this frame"
            )
        return self._detector.detect(frame, hint)

    def unreadable(self, t_ns: int, camera: str, text: str) -> Detection:
        """A frame that is no picture."""
        self._health += self._watch.unreadable(t_ns, text)
        return PadNotSeen(t_ns, camera, self._name, text)

    def take_health(self) -> tuple[Health, ...]:
        health, self._health = tuple(self._health), []
        return health


def _period(hint: DetectionHint) -> int:
    """One frame in how many is searched."""
    if not hint.is_expected:
        return SEARCHED_ANYWAY
    return UNSEEN_PERIOD if hint.X_CP is None else 1
