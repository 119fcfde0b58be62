"""Do frames come, evenly, of the calibrated size, bright enough, and when were they taken?"""

from __future__ import annotations

from itertools import pairwise
from statistics import median

from companion.doctor.evidence import Evidence, Finding, Level, judged, percentile

DARK, BRIGHT = 25.0, 235.0
GOOD_HZ, LEAST_HZ = 20.0, 8.0


def check_camera(evidence: Evidence) -> list[Finding]:
    name = evidence.config.vision.camera
    if evidence.camera_error or len(evidence.frames) < 3:
        reason = evidence.camera_error or f"{len(evidence.frames)} frames in {evidence.duration_s:.0f} s"
        return [
            Finding("camera", Level.FAIL, f"{name}: {reason}", f"[cameras.{name}] source, cable, other program on it")
        ]
    return [_rate(evidence), _size(evidence), _exposure(evidence), _delay(evidence)]


def _rate(evidence: Evidence) -> Finding:
    gaps_s = [(later.arrived_ns - earlier.arrived_ns) / 1e9 for earlier, later in pairwise(evidence.frames)]
    rate_hz = 1.0 / max(1e-6, median(gaps_s))
    worst_s = percentile(gaps_s, 0.99)
    text = f"{rate_hz:.0f} frames a second, longest gap {1e3 * worst_s:.0f} ms"
    uneven = worst_s > 4.0 / rate_hz
    remedy = "shorter exposure, smaller picture, USB 3, less load on this computer"
    return judged("camera", text, remedy, fails=rate_hz < LEAST_HZ, warns=rate_hz < GOOD_HZ or uneven)


def _size(evidence: Evidence) -> Finding:
    camera = evidence.config.cameras[evidence.config.vision.camera]
    size, wanted = evidence.frames[-1].size_px, (camera.width_px, camera.height_px)
    text = f"{size[0]} x {size[1]} px, calibrated for {wanted[0]} x {wanted[1]} px"
    return judged(
        "camera",
        text,
        "calibrate again at the size that is used, or set the source's size",
        fails=size != wanted,
        warns=False,
    )


def _exposure(evidence: Evidence) -> Finding:
    level = median(frame.mean_level for frame in evidence.frames)
    text = f"mean grey level {level:.0f} of 255"
    return judged(
        "camera", text, "exposure, lens cap, sun in the lens", fails=level < 4.0, warns=not DARK < level < BRIGHT
    )


def _delay(evidence: Evidence) -> Finding:
    camera = evidence.config.cameras[evidence.config.vision.camera]
    delays_s = [frame.delay_s for frame in evidence.frames if frame.delay_s is not None]
    if not delays_s:
        text = f"no capture times; [cameras] delay_s = {camera.delay_s:g} is believed"
        return judged("camera", text, "measure the delay and set delay_s", fails=False, warns=camera.delay_s == 0.0)
    text = f"delay {1e3 * median(delays_s):.0f} ms, p99 {1e3 * percentile(delays_s, 0.99):.0f} ms, known from capture times"
    worst_s = percentile(delays_s, 0.9)
    return judged(
        "camera",
        text,
        "less buffering in the source",
        fails=worst_s > 0.5 or min(delays_s) < -0.02,
        warns=worst_s > 0.2,
    )
