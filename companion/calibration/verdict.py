"""Is this calibration good enough to land by, and if not, what to do. Limits in pixels of the calibrated image.

Half a pixel RMS with a board that fills the image is what a printed board on something flat gives; more is a bent board, a
moving camera or the wrong model. At 10 m height a focal length off by 1 % is 10 cm of height.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from companion.calibration.coverage import Coverage
from companion.calibration.solve import Calibration

PASS, WARN, FAIL = "pass", "warn", "fail"
TILTED_DEG = 15.0


@dataclass(frozen=True, slots=True)
class Finding:
    """One figure, its grade, and what to do where it is not a pass."""

    grade: str
    name: str
    value: str
    advice: str


def judge(result: Calibration, coverage: Coverage) -> list[Finding]:
    """All findings, in the order of reading."""
    tilted = sum(tilt >= TILTED_DEG for tilt in result.tilt_deg)
    side = coverage.missing()
    return [
        Finding(_low(result.rms_px, 0.5, 1.0), "reprojection error", f"{result.rms_px:.2f} px RMS", _BENT),
        Finding(
            _low(result.held_out_px, max(0.5, 1.5 * result.rms_px), max(1.0, 2.5 * result.rms_px)),
            "held-out views",
            f"{result.held_out_px:.2f} px RMS",
            "the lens fits only the views it was made from: take more, at other distances and tilts",
        ),
        Finding(
            _high(coverage.fraction, 0.8, 0.6),
            "coverage",
            f"{coverage.fraction:.0%} of the image",
            f"hold the board to the {side} of the image, right up to its edge" if side else "",
        ),
        Finding(_high(result.views, 15, 8), "views", str(result.views), "take 20 or more"),
        Finding(
            _high(tilted, 5, 3),
            "tilted views",
            f"{tilted} of {len(result.tilt_deg)} by {TILTED_DEG:g} degrees or more",
            "tilt the board to all four sides: seen from the front only, focal length and distance cannot be told apart",
        ),
    ]


def overall(findings: Sequence[Finding]) -> str:
    """The worst grade."""
    grades = [finding.grade for finding in findings]
    return FAIL if FAIL in grades else WARN if WARN in grades else PASS


_BENT = "put the board on something flat, hold it still, use light enough for a short exposure; for a wide lens try --model fisheye"


def _low(value: float, good: float, usable: float) -> str:
    return PASS if value <= good else WARN if value <= usable else FAIL


def _high(value: float, good: float, usable: float) -> str:
    return PASS if value >= good else WARN if value >= usable else FAIL
