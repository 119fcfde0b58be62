"""Allocation of thrust and torque to four motors, and what gives way when they saturate."""

from math import sqrt

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl_stub.autopilot.mixer import mix

torques = st.tuples(*(st.floats(-1.0, 1.0),) * 3)


def _given(motors: tuple[float, float, float, float]) -> tuple[float, float, float]:
    a, b, c, d = motors
    h = sqrt(0.5) / 2.0
    return h * (b + c - a - d), h * (a + c - b - d), 0.25 * (a + b - c - d)


def test_one_recorded_row_is_reproduced() -> None:
    """From the recorded flight: torque and thrust setpoint of one instant and the motors that PX4 gave for them."""
    motors, _ = mix(0.5368, (0.0171, -0.0172, -0.0009))
    assert motors == pytest.approx((0.5116, 0.5602, 0.5377, 0.5378), abs=2e-4)


@given(st.floats(0.3, 0.7), st.tuples(*(st.floats(-0.05, 0.05),) * 3))
def test_small_demands_are_given_in_full(thrust: float, torque: tuple[float, float, float]) -> None:
    motors, missing = mix(thrust, torque)
    assert sum(motors) / 4.0 == pytest.approx(thrust)
    assert _given(motors) == pytest.approx(torque, abs=1e-12)
    assert missing == (0.0, 0.0, 0.0)


@given(st.floats(0.0, 1.0), torques)
def test_motors_stay_between_zero_and_one(thrust: float, torque: tuple[float, float, float]) -> None:
    motors, _ = mix(thrust, torque)
    assert all(0.0 <= motor <= 1.0 for motor in motors)


@given(st.floats(0.0, 1.0), torques)
def test_thrust_is_never_raised_for_torque(thrust: float, torque: tuple[float, float, float]) -> None:
    motors, _ = mix(thrust, torque)
    assert sum(motors) / 4.0 <= thrust + 0.08


def test_at_full_thrust_roll_is_kept_by_lowering_thrust() -> None:
    motors, missing = mix(1.0, (0.2, 0.0, 0.0))
    assert _given(motors)[0] == pytest.approx(0.2)
    assert max(motors) == pytest.approx(1.0)
    assert missing[0] == 0.0


def test_yaw_gives_way_before_roll_and_pitch() -> None:
    motors, missing = mix(0.5, (0.5, 0.0, 0.9))
    assert _given(motors)[0] == pytest.approx(0.5)
    assert _given(motors)[2] < 0.9
    assert missing == (0.0, 0.0, 1.0)


def test_without_thrust_there_is_no_torque() -> None:
    motors, missing = mix(0.0, (0.3, -0.3, 0.0))
    assert sum(motors) < 0.3
    assert missing[0] == 1.0
    assert missing[1] == -1.0
