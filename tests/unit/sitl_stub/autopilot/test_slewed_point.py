"""The precision landing's setpoint in the approach, drawn through limits."""

from math import hypot

import pytest

from sitl_stub.autopilot.precland import SlewedPoint

STEP_S, SPEED_MAX_M_S, ACCELERATION_M_S2 = 0.05, 5.0, 3.0


@pytest.mark.parametrize("speed_m_s", [0.5, 1.0, 2.0])
def test_it_stays_behind_a_steady_target_by_the_way_that_braking_takes(speed_m_s: float) -> None:
    point = SlewedPoint(0.0, 0.0, 0.0, 0.0)
    for step in range(400):
        target_m = speed_m_s * STEP_S * step
        point.advance(target_m, 0.0, STEP_S, SPEED_MAX_M_S, ACCELERATION_M_S2)
    assert target_m - point.x_m == pytest.approx(speed_m_s**2 / ACCELERATION_M_S2, abs=speed_m_s * STEP_S + 0.02)


def test_it_never_exceeds_its_speed_and_comes_to_a_still_target() -> None:
    point = SlewedPoint(0.0, 0.0, 0.0, 0.0)
    fastest_m_s = 0.0
    for _ in range(400):
        x, y = point.x_m, point.y_m
        point.advance(30.0, -20.0, STEP_S, SPEED_MAX_M_S, ACCELERATION_M_S2)
        fastest_m_s = max(fastest_m_s, hypot(point.x_m - x, point.y_m - y) / STEP_S)
    assert fastest_m_s == pytest.approx(SPEED_MAX_M_S)
    assert hypot(point.x_m - 30.0, point.y_m + 20.0) < 0.1
