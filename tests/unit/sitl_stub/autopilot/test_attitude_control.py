"""PX4's attitude loop: tilt first, then a weighted yaw."""

from math import radians

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl_stub.autopilot.attitude_control import attitude_gains, control_attitude
from sitl_stub.autopilot.parameters import Parameters
from sitl_stub.rotation import from_euler, from_rotation_vector, multiply, roll_pitch_yaw, z_axis

GAINS = attitude_gains(Parameters().as_mapping())
LEVEL = from_euler(0.0, 0.0, 0.0)


def test_at_the_setpoint_nothing_turns() -> None:
    q = from_euler(0.3, -0.2, 2.0)
    assert control_attitude(q, q, 0.0, GAINS) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


@pytest.mark.parametrize(
    ("angles", "axis", "gain"), [((0.05, 0, 0), 0, 4.0), ((0, 0.05, 0), 1, 4.0), ((0, 0, 0.05), 2, 2.8)]
)
def test_small_errors_give_gain_times_angle(angles: tuple[float, float, float], axis: int, gain: float) -> None:
    rates = control_attitude(LEVEL, from_euler(*angles), 0.0, GAINS)
    assert rates[axis] == pytest.approx(gain * 0.05, rel=0.01)


@given(st.floats(-3.0, 3.0))
def test_yaw_does_not_disturb_the_correction_of_tilt(yaw: float) -> None:
    """Whatever heading is asked for, the thrust axis takes the shortest way."""
    tilt_only = control_attitude(LEVEL, from_euler(0.0, 0.4, 0.0), 0.0, GAINS)
    d = z_axis(from_euler(0.0, 0.4, 0.0))
    both = control_attitude(LEVEL, multiply(from_euler(0.0, 0.4, 0.0), from_euler(0.0, 0.0, yaw)), 0.0, GAINS)
    assert d[0] > 0.0
    assert both[1] > 0.5 * tilt_only[1]


def test_rates_are_limited() -> None:
    rates = control_attitude(LEVEL, from_euler(2.9, 0.0, 0.0), 0.0, GAINS)
    assert rates[0] == pytest.approx(radians(220.0))
    assert control_attitude(LEVEL, LEVEL, 4.0, GAINS)[2] == pytest.approx(radians(200.0))


def test_heading_rate_is_about_down_also_when_tilted() -> None:
    q = from_euler(0.0, radians(60.0), 0.0)
    p, _, r = control_attitude(q, q, 1.0, GAINS)
    assert (p, r) == pytest.approx((-0.8660254, 0.5))


def test_attitude_converges_from_far_off() -> None:
    """Kinematics only: the body turns as asked."""
    q, qd = from_euler(2.5, 0.5, -1.0), from_euler(0.1, -0.3, 2.0)
    for _ in range(4000):
        p, t, r = control_attitude(q, qd, 0.0, GAINS)
        q = multiply(q, from_rotation(p, t, r))
    assert roll_pitch_yaw(q) == pytest.approx(roll_pitch_yaw(qd), abs=1e-3)


def from_rotation(p: float, q: float, r: float) -> tuple[float, float, float, float]:
    return from_rotation_vector(p * 0.004, q * 0.004, r * 0.004)
