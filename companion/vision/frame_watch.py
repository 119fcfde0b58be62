"""Notices and names a camera that has gone bad: dead, stalling, frozen, black, of the wrong size. Pure: frames and times in.

`ArrivalWatch` looks at when frames come (the shell's loop feeds it every arrival and asks it from time to time);
`PictureWatch` looks at what is in them (whoever decompresses feeds it). Each change of state gives one `Health` message, worse
or better; what stays as it is says nothing again. A picture that shows nothing of now must not become a measurement:
`PictureWatch.look` says so in words.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from statistics import median

import numpy as np

from companion.messages import CameraImage, Health, Image

FINE, WARN, FAIL = 0, 1, 2
FROZEN_AFTER_NS = 300_000_000
"""Sensor noise makes two frames of the same scene differ; one repetition may be a hiccup of the driver, this long is not."""

BLACK_MEAN, BLACK_MAX = 4.0, 20
"""Grey levels. A sensor in the dark shows noise of 1 to 3 levels; the faintest scene has something brighter in it."""

STALL_FACTOR = 3.0
"""An interval of so many usual ones is a stall ..."""
STALLS = 3
"""... and so many of them among the last WINDOW intervals make a stalling camera."""
WINDOW = 60
STRIDE = 8
"""Every eighth pixel each way decides first; all of them only where those are equal."""


@dataclass(slots=True)
class Conditions:
    """Named conditions with their levels; gives a message when one begins or ends."""

    camera: str
    active: dict[str, str] = field(default_factory=dict)

    def begin(self, t_ns: int, name: str, level: int, text: str, value: float | None = None) -> list[Health]:
        if name in self.active:
            return []
        self.active[name] = text
        return [Health(t_ns, f"camera {self.camera}", level, f"{name}: {text}", value)]

    def end(self, t_ns: int, name: str, text: str) -> list[Health]:
        if self.active.pop(name, None) is None:
            return []
        return [Health(t_ns, f"camera {self.camera}", FINE, f"no longer {name}: {text}")]


class ArrivalWatch:
    """When frames come. `timeout_ns` without one is a dead camera; counted from `start_ns` where none ever came."""

    def __init__(self, camera: str, *, timeout_ns: int, start_ns: int) -> None:
        self._conditions = Conditions(camera)
        self._timeout_ns = timeout_ns
        self._last_ns = start_ns
        self._has_begun = False
        self._intervals: deque[int] = deque(maxlen=WINDOW)

    def arrived(self, now_ns: int) -> list[Health]:
        """A frame came."""
        health = self._conditions.end(now_ns, "dead", "frames come again")
        if self._has_begun and not health:
            self._intervals.append(now_ns - self._last_ns)
        self._has_begun, self._last_ns = True, now_ns
        return health + self._judge_pace(now_ns)

    def check(self, now_ns: int) -> list[Health]:
        """Time has passed."""
        silent_ns = now_ns - self._last_ns
        if silent_ns <= self._timeout_ns:
            return []
        seconds = silent_ns / 1e9
        text = f"no frame for {seconds:.1f} s" if self._has_begun else f"not one frame in {seconds:.1f} s"
        return self._conditions.begin(now_ns, "dead", FAIL, text, seconds)

    def _judge_pace(self, now_ns: int) -> list[Health]:
        if len(self._intervals) < WINDOW // 4:
            return []
        usual_ns = median(self._intervals)
        stalls = sum(interval > STALL_FACTOR * usual_ns for interval in self._intervals)
        if stalls >= STALLS:
            worst_s = max(self._intervals) / 1e9
            text = f"{stalls} gaps among {len(self._intervals)} frames, up to {worst_s:.2f} s; usual {usual_ns / 1e6:.0f} ms"
            return self._conditions.begin(now_ns, "stalling", WARN, text, worst_s)
        return [] if stalls else self._conditions.end(now_ns, "stalling", "frames come evenly")


class PictureWatch:
    """What frames show. `width_px` and `height_px` are the configured (calibrated) size."""

    def __init__(self, camera: str, *, width_px: int, height_px: int) -> None:
        self._conditions = Conditions(camera)
        self._size = (width_px, height_px)
        self._last: Image | None = None
        self._sample: Image | None = None
        self._changed_ns: int | None = None

    def look(self, frame: CameraImage) -> tuple[str | None, list[Health]]:
        """Why this frame is no measurement of now (None: it may be one), and what has changed."""
        sample = np.ascontiguousarray(frame.image[::STRIDE, ::STRIDE])
        judgements = (self._judge_size(frame), self._judge_black(frame, sample), self._judge_frozen(frame, sample))
        reasons = [reason for reason, _ in judgements if reason is not None]
        return (reasons[0] if reasons else None), [message for _, messages in judgements for message in messages]

    def unreadable(self, t_ns: int, text: str) -> list[Health]:
        """A frame came that is no picture."""
        return self._conditions.begin(t_ns, "unreadable", FAIL, text)

    def _judge_size(self, frame: CameraImage) -> tuple[str | None, list[Health]]:
        health = self._conditions.end(frame.t_ns, "unreadable", "pictures come again")
        height, width = frame.image.shape[:2]
        if (width, height) == self._size:
            return None, health + self._conditions.end(frame.t_ns, "wrong size", "as calibrated")
        text = f"{width} x {height} px, but its calibration is for {self._size[0]} x {self._size[1]} px"
        return f"wrong size: {text}", health + self._conditions.begin(frame.t_ns, "wrong size", FAIL, text)

    def _judge_black(self, frame: CameraImage, sample: Image) -> tuple[str | None, list[Health]]:
        mean = float(sample.mean())
        if mean >= BLACK_MEAN or int(sample.max()) >= BLACK_MAX:
            return None, self._conditions.end(frame.t_ns, "black", "there is light again")
        text = f"mean grey level {mean:.1f} of 255: lens cap, no light, or a dead sensor"
        return "black picture", self._conditions.begin(frame.t_ns, "black", FAIL, text, mean)

    def _judge_frozen(self, frame: CameraImage, sample: Image) -> tuple[str | None, list[Health]]:
        is_same = self._is_same(frame.image, sample)
        self._last, self._sample = frame.image, sample
        if not is_same or self._changed_ns is None:
            self._changed_ns = frame.t_ns
            return None, self._conditions.end(frame.t_ns, "frozen", "the picture changes again")
        frozen_ns = frame.t_ns - self._changed_ns
        reason = "the same picture as before"
        if frozen_ns < FROZEN_AFTER_NS:
            return reason, []
        text = f"identical pictures for {frozen_ns / 1e9:.1f} s"
        return reason, self._conditions.begin(frame.t_ns, "frozen", FAIL, text, frozen_ns / 1e9)

    def _is_same(self, image: Image, sample: Image) -> bool:
        if self._sample is None or self._last is None or self._last.shape != image.shape:
            return False
        if self._last is image:
            return True
        return bool(np.array_equal(sample, self._sample) and np.array_equal(image, self._last))
