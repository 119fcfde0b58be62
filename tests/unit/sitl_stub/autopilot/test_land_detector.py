"""PX4's land detector: what counts as ground, and what never does."""

from __future__ import annotations

import pytest

from sitl_stub.autopilot.land_detector import LandDetector, LandDetectorInput
from sitl_stub.autopilot.parameters import Parameters

STANDING = LandDetectorInput((0.0, 0.0, 0.0), (0.0, 0.0), 0.7, 0.12, None)


def time_to_landing(seen: LandDetectorInput, timeout_s: float = 10.0) -> float | None:
    detector = LandDetector(Parameters())
    detector.begin_in_air(0)
    for t_us in range(0, round(timeout_s * 1e6), 8_000):
        if detector.update(t_us, True, seen):
            return t_us * 1e-6
    return None


def test_landing_takes_a_second_and_three_with_a_range_sensor() -> None:
    assert time_to_landing(STANDING) == pytest.approx(1.0, abs=0.03)
    with_sensor = LandDetectorInput((0.0, 0.0, 0.0), (0.0, 0.0), 0.7, 0.12, 0.05)
    assert time_to_landing(with_sensor) == pytest.approx(3.0, abs=0.03)


@pytest.mark.parametrize(
    ("seen", "why"),
    [
        (LandDetectorInput((1.6, 0.0, 0.0), (0.0, 0.0), 0.7, 0.12, None), "the deck moves faster than 1.5 m/s"),
        (LandDetectorInput((0.0, 0.0, 0.3), (0.0, 0.0), 0.7, 0.12, None), "the deck heaves faster than 0.25 m/s"),
        (LandDetectorInput((0.0, 0.0, 0.0), (0.0, 0.0), 0.0, 0.5, None), "no descent is commanded at hover thrust"),
        (LandDetectorInput((0.0, 0.0, 0.0), (0.0, 0.0), 0.7, 0.3, None), "the thrust is above the minimum"),
        (LandDetectorInput((0.0, 0.0, 0.0), (0.4, 0.0), 0.7, 0.12, None), "the vehicle rotates"),
        (LandDetectorInput((0.0, 0.0, 0.0), (0.0, 0.0), 0.7, 0.12, 2.0), "the ground is 2 m below"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_nothing_is_detected_when(seen: LandDetectorInput, why: str) -> None:
    assert time_to_landing(seen) is None, why


def test_a_disarmed_vehicle_is_landed_whatever_moves() -> None:
    detector = LandDetector(Parameters())
    detector.begin_in_air(0)
    assert detector.update(1_000_000, False, LandDetectorInput((9.0, 0.0, 9.0), (5.0, 0.0), None, 0.9, 50.0))
