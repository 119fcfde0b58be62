"""The press on the deck after the touch: gentle while the vehicle comes level, then whole."""

from __future__ import annotations

import pytest

from companion.config import Mission
from companion.mission.press import GROWTH_S, RIGHTING_S, press

MISSION = Mission(final_descent_speed_m_s=0.5, press_speed_m_s=1.4, press_acceleration_m_s2=2.0)


def test_at_first_the_vehicle_sinks_no_faster_than_it_came_down() -> None:
    assert press(0.0, MISSION) == pytest.approx((0.5, 1.5))
    assert press(RIGHTING_S, MISSION) == pytest.approx((0.5, 1.5))


def test_the_press_then_grows_to_the_whole_and_stays() -> None:
    assert press(RIGHTING_S + 0.5 * GROWTH_S, MISSION) == pytest.approx((0.95, 1.75))
    assert press(RIGHTING_S + GROWTH_S, MISSION) == pytest.approx((1.4, 2.0))
    assert press(9.0, MISSION) == pytest.approx((1.4, 2.0))


def test_a_press_that_is_gentler_than_the_descent_is_never_exceeded() -> None:
    assert press(0.0, Mission(press_speed_m_s=0.2))[0] == 0.2
