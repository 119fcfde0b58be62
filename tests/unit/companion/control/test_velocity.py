"""The control law and its limits, with numbers that a person can check."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from companion.config import Control
from companion.control import YAW_LAWS, ControlInput, Reference, YawInput
from companion.control.limits import limited_length, limited_velocity, slewed
from companion.control.velocity import VelocityLaw

ABOVE = Reference((0.0, 0.0, -5.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
WITH_PAD = ControlInput(
    dt_s=0.02,
    relative_position_m=(0.0, 0.0, -5.0),
    relative_velocity_m_s=(0.0, 0.0, 0.0),
    reference=ABOVE,
    reference_ahead=ABOVE,
    pad_velocity_ahead_m_s=(4.0, 1.0, 0.0),
    pad_acceleration_ahead_m_s2=(0.0, 2.0, 0.0),
)


def law(**settings: float) -> VelocityLaw:
    return VelocityLaw(Control(**{"integral_gain_hz2": 0.0, **settings}))  # type: ignore[arg-type]


def test_on_its_reference_the_vehicle_flies_the_pads_motion_exactly() -> None:
    out = law().update(WITH_PAD)
    assert out.velocity_ned_m_s == (4.0, 1.0, 0.0)
    assert out.acceleration_ned_m_s2 == (0.0, 2.0, 0.0)


def test_a_vehicle_behind_the_pad_is_asked_to_fly_faster_by_the_gain() -> None:
    out = law(position_gain_hz=1.5, damping=0.0).update(replace(WITH_PAD, relative_position_m=(-2.0, 0.0, -5.0)))
    assert out.velocity_ned_m_s[0] == pytest.approx(4.0 + 1.5 * 2.0)


def test_only_relative_velocity_is_damped() -> None:
    still = law(damping=0.5).update(WITH_PAD).velocity_ned_m_s
    faster = law(damping=0.5).update(replace(WITH_PAD, relative_velocity_m_s=(1.0, 0.0, 0.0))).velocity_ned_m_s
    assert still[0] == 4.0
    assert faster[0] == pytest.approx(4.0 - 0.5)


def test_the_integral_learns_a_steady_error_up_to_its_limit() -> None:
    controller = law(integral_gain_hz2=0.5, max_integral_m_s=0.4, position_gain_hz=1.0)
    behind = replace(WITH_PAD, relative_position_m=(-0.5, 0.0, -5.0))
    for _ in range(1000):
        out = controller.update(behind)
    assert out.velocity_ned_m_s[0] == pytest.approx(4.0 + 0.5 + 0.4)
    controller.reset()
    assert controller.update(WITH_PAD).velocity_ned_m_s[0] == 4.0


@pytest.mark.parametrize(("sink_m_s", "learned_m_s"), [(0.0, 0.4), (0.5, 0.0)])
def test_the_lag_of_a_descent_is_not_integrated(sink_m_s: float, learned_m_s: float) -> None:
    controller = law(integral_gain_hz2=0.5, max_integral_m_s=0.4)
    sinking = Reference(ABOVE.position_m, (0.0, 0.0, sink_m_s), (0.0, 0.0, 0.0))
    for _ in range(1000):
        controller.update(replace(WITH_PAD, relative_position_m=(0.0, 0.0, -5.3), reference=sinking))
    assert controller.update(WITH_PAD).velocity_ned_m_s[2] == pytest.approx(learned_m_s)


def test_far_away_nothing_is_integrated() -> None:
    controller = law(integral_gain_hz2=0.5)
    for _ in range(100):
        controller.update(replace(WITH_PAD, relative_position_m=(-20.0, 0.0, -5.0)))
    assert controller.update(WITH_PAD).velocity_ned_m_s[0] == 4.0


def test_without_feedback_only_the_feed_forward_is_left() -> None:
    out = law().update(replace(WITH_PAD, relative_position_m=(9.0, 9.0, 9.0), feedback=False))
    assert out.velocity_ned_m_s == (4.0, 1.0, 0.0)


def test_on_the_deck_half_the_lean_of_the_curve_is_asked_for() -> None:
    curve = replace(WITH_PAD, pad_acceleration_ahead_m_s2=(0.0, 2.8, 0.0))
    flying, pressing = law().update(curve), law().update(replace(curve, feedback=False))
    assert flying.acceleration_ned_m_s2[1] == pytest.approx(2.8)
    assert pressing.acceleration_ned_m_s2[1] == pytest.approx(1.4)


def test_speed_is_cut_with_its_direction_kept() -> None:
    cut = limited_velocity((30.0, 40.0, 9.0), max_speed_m_s=10.0, max_climb_m_s=3.0, max_descent_m_s=1.5)
    assert cut == pytest.approx((6.0, 8.0, 1.5))


def test_climb_is_negative_down() -> None:
    assert limited_velocity((0.0, 0.0, -9.0), max_speed_m_s=1.0, max_climb_m_s=3.0, max_descent_m_s=1.0)[2] == -3.0


def test_a_step_is_slewed_and_arrives() -> None:
    velocity = (0.0, 0.0, 0.0)
    for _ in range(10):
        velocity = slewed(velocity, (1.0, 0.0, 0.0), max_rate=5.0, dt_s=0.02)
    assert velocity == pytest.approx((1.0, 0.0, 0.0))
    assert slewed((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), max_rate=5.0, dt_s=0.02) == pytest.approx((0.1, 0.0, 0.0))


def test_a_short_vector_is_left_alone() -> None:
    assert limited_length((1.0, 0.0, 0.0), 2.0) == (1.0, 0.0, 0.0)
    assert limited_length((3.0, 0.0, 4.0), 1.0) == pytest.approx((0.6, 0.0, 0.8))


@pytest.mark.parametrize(
    ("name", "error"), [("hold", -0.5), ("pad", 0.5), ("travel", math.pi / 2 - 0.5)]
)  # fmt: skip
def test_yaw_laws_point_where_they_say(name: str, error: float) -> None:
    yaw = YawInput(yaw_rad=0.5, initial_yaw_rad=0.0, pad_yaw_rad=1.0, velocity_ned_m_s=(0.0, 3.0, 0.0))
    assert YAW_LAWS[name](yaw) == pytest.approx(error)


def test_travel_yaw_stays_where_it_is_at_walking_pace() -> None:
    yaw = YawInput(yaw_rad=0.5, initial_yaw_rad=0.0, pad_yaw_rad=None, velocity_ned_m_s=(0.1, 0.1, 0.0))
    assert YAW_LAWS["travel"](yaw) == 0.0
