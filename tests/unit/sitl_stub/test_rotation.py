"""The simulator's own quaternions: Hamilton, w x y z, q_WB takes B to W."""

from math import pi, radians

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl_stub.rotation import (
    from_euler,
    from_rotation_vector,
    inverse,
    multiply,
    normalise,
    roll_pitch_yaw,
    rotate,
    rotate_back,
    wrap,
    yaw_of,
    z_axis,
)

angles = st.floats(-3.1, 3.1)
tilts = st.floats(-1.5, 1.5)


def test_yaw_ninety_degrees_turns_the_nose_east() -> None:
    assert rotate(from_euler(0.0, 0.0, pi / 2), (1.0, 0.0, 0.0)) == pytest.approx((0.0, 1.0, 0.0))


def test_pitch_up_lifts_the_nose() -> None:
    north, east, down = rotate(from_euler(0.0, radians(30.0), 0.0), (1.0, 0.0, 0.0))
    assert (north, east, down) == pytest.approx((0.8660254, 0.0, -0.5))


def test_roll_right_lowers_the_right_side() -> None:
    assert rotate(from_euler(radians(90.0), 0.0, 0.0), (0.0, 1.0, 0.0)) == pytest.approx((0.0, 0.0, 1.0))


@given(angles, tilts, angles)
def test_euler_angles_come_back(roll: float, pitch: float, yaw: float) -> None:
    assert roll_pitch_yaw(from_euler(roll, pitch, yaw)) == pytest.approx((roll, pitch, yaw), abs=1e-6)


@given(angles, tilts, angles)
def test_rotating_there_and_back_changes_nothing(roll: float, pitch: float, yaw: float) -> None:
    q = from_euler(roll, pitch, yaw)
    assert rotate_back(q, rotate(q, (1.0, -2.0, 3.0))) == pytest.approx((1.0, -2.0, 3.0))
    assert multiply(q, inverse(q)) == pytest.approx((1.0, 0.0, 0.0, 0.0))
    assert z_axis(q) == pytest.approx(rotate(q, (0.0, 0.0, 1.0)))


def test_products_turn_in_the_frame_that_the_first_made() -> None:
    yaw, pitch = from_euler(0.0, 0.0, 1.0), from_euler(0.0, 0.3, 0.0)
    assert multiply(yaw, pitch) == pytest.approx(from_euler(0.0, 0.3, 1.0))


def test_a_rotation_vector_turns_about_itself_by_its_length() -> None:
    assert yaw_of(from_rotation_vector(0.0, 0.0, 0.7)) == pytest.approx(0.7)
    assert from_rotation_vector(0.0, 0.0, 1e-12)[3] == pytest.approx(5e-13)


def test_normalising_gives_unit_length_and_positive_w() -> None:
    assert normalise((-2.0, 0.0, 0.0, 0.0)) == (1.0, 0.0, 0.0, 0.0)


def test_wrap_keeps_pi_and_folds_the_rest() -> None:
    assert wrap(3 * pi) == pytest.approx(pi)
    assert wrap(-pi) == pytest.approx(pi)
    assert wrap(3.5) == pytest.approx(3.5 - 2 * pi)
