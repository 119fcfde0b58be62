"""PX4's land detector: what counts as ground, and what never does."""

from __future__ import annotations

from typing import Any

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


def test_landing_takes_a_second() -> None:
    assert time_to_landing(STANDING) == pytest.approx(1.0, abs=0.03)
    assert time_to_landing(STANDING._replace(height_above_ground_m=0.05)) == pytest.approx(1.0, abs=0.03)


def test_landing_takes_three_seconds_when_a_range_sensor_sees_nothing_on_the_ground() -> None:
    detector = LandDetector(Parameters())
    detector.begin_in_air(0)
    detector.update(0, True, STANDING._replace(thrust_command=0.5, height_above_ground_m=0.3))
    times = [t_us for t_us in range(8_000, 5_000_000, 8_000) if detector.update(t_us, True, STANDING)]
    assert times[0] * 1e-6 == pytest.approx(3.0, abs=0.03)


def test_the_derivative_of_height_speaks_for_standing_when_the_velocity_is_biased() -> None:
    biased = STANDING._replace(velocity_ned_m_s=(0.0, 0.0, 0.45))
    assert time_to_landing(biased) is None
    assert time_to_landing(biased._replace(height_rate_m_s=0.1)) == pytest.approx(1.0, abs=0.03)


def test_a_known_hover_thrust_lets_a_higher_thrust_count_as_contact() -> None:
    pushing = STANDING._replace(thrust_command=0.3)
    for hover_thrust, contact in ((None, False), (0.5, True)):
        detector = LandDetector(Parameters())
        detector.begin_in_air(0)
        for t_us in range(0, 1_000_000, 8_000):
            detector.update(t_us, True, pushing._replace(hover_thrust=hover_thrust))
        assert detector.ground_contact is contact


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"velocity_ned_m_s": (1.6, 0.0, 0.0)}, "the deck moves faster than 1.5 m/s"),
        ({"velocity_ned_m_s": (0.0, 0.0, 0.3)}, "the deck heaves faster than 0.25 m/s"),
        ({"descent_setpoint_m_s": 0.0}, "no descent is commanded, however low the thrust"),
        ({"thrust_command": 0.3}, "the thrust is above the minimum"),
        ({"angular_rate_xy_rad_s": (0.4, 0.0)}, "the vehicle rotates"),
        ({"height_above_ground_m": 2.0}, "the ground is 2 m below"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_nothing_is_detected_when(change: dict[str, Any], why: str) -> None:
    assert time_to_landing(STANDING._replace(**change)) is None, why


def test_a_disarmed_vehicle_is_landed_whatever_moves() -> None:
    detector = LandDetector(Parameters())
    detector.begin_in_air(0)
    assert detector.update(1_000_000, False, LandDetectorInput((9.0, 0.0, 9.0), (5.0, 0.0), None, 0.9, 50.0))
