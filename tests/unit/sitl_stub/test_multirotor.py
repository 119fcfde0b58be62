"""Rigid-body motion of the vehicle, against closed forms."""

from math import exp, pi

import pytest

from sitl_stub.airframe import Airframe, Drag, Rotors
from sitl_stub.multirotor import GRAVITY_M_S2, Multirotor
from sitl_stub.rotation import from_euler, roll_pitch_yaw

SIH = Airframe(
    mass_kg=1.0,
    inertia_kg_m2=(0.025, 0.025, 0.03),
    rotors=Rotors(max_thrust_n=5.0, max_torque_nm=0.1, arm_forward_m=0.2, arm_right_m=0.2, time_constant_s=0.05),
    drag=Drag(linear_n_s_m=(1.0, 1.0, 1.0), angular_nm_s=0.025),
)
STILL = (0.0, 0.0, 0.0)
HOVER = SIH.hover_signal


def _hovering(**start: object) -> Multirotor:
    return Multirotor(SIH, motors=(HOVER, HOVER, HOVER, HOVER), **start)  # type: ignore[arg-type]


def _run(vehicle: Multirotor, commands: tuple[float, float, float, float], seconds: float, **loads: object) -> None:
    for _ in range(round(seconds / 0.004)):
        vehicle.step(0.004, commands, **loads)  # type: ignore[arg-type]


def test_hover_thrust_carries_the_weight() -> None:
    vehicle = _hovering()
    _run(vehicle, (HOVER,) * 4, 2.0)
    assert vehicle.position_ned_m == pytest.approx(STILL, abs=1e-9)
    assert pytest.approx(GRAVITY_M_S2 / 20.0) == HOVER


def test_falling_without_motors_approaches_the_speed_at_which_drag_carries_the_weight() -> None:
    vehicle = Multirotor(SIH)
    _run(vehicle, STILL + (0.0,), 2.0)
    assert vehicle.velocity_ned_m_s[2] == pytest.approx(GRAVITY_M_S2 * (1.0 - exp(-2.0)), rel=0.005)


def test_still_vehicle_is_carried_by_the_wind() -> None:
    vehicle = _hovering()
    _run(vehicle, (HOVER,) * 4, 1.0, wind_ned_m_s=(0.0, 4.0, 0.0))
    assert vehicle.velocity_ned_m_s[1] == pytest.approx(4.0 * (1.0 - exp(-1.0)), rel=0.005)


def test_motor_signal_follows_its_command_with_first_order_lag() -> None:
    vehicle = Multirotor(SIH)
    for _ in range(100):
        vehicle.step(0.001, (1.0, 1.0, 1.0, 1.0))
    assert vehicle.motors[0] == pytest.approx(1.0 - exp(-2.0), abs=0.005)


@pytest.mark.parametrize(
    ("commands", "axis", "sign"),
    [
        ((-1, 1, 1, -1), 0, 1),
        ((1, -1, 1, -1), 1, 1),
        ((1, 1, -1, -1), 2, 1),
    ],
)
def test_motors_turn_the_body_as_px4s_quad_x(commands: tuple[int, ...], axis: int, sign: int) -> None:
    vehicle = _hovering()
    a, b, c, d = (HOVER + 0.05 * part for part in commands)
    _run(vehicle, (a, b, c, d), 0.1)
    rates = vehicle.rates_frd_rad_s
    assert sign * rates[axis] > 0.02
    assert [rates[i] for i in range(3) if i != axis] == pytest.approx([0.0, 0.0], abs=1e-9)


def test_a_steady_turn_is_integrated_exactly() -> None:
    airframe = Airframe(mass_kg=1.0, inertia_kg_m2=(0.02, 0.02, 0.03), rotors=SIH.rotors)
    vehicle = Multirotor(airframe, rates_frd_rad_s=(0.0, 0.0, 1.0), motors=(HOVER,) * 4)
    _run(vehicle, (HOVER,) * 4, 1.0)
    assert roll_pitch_yaw(vehicle.q_ned_frd)[2] == pytest.approx(1.0, abs=1e-9)


def test_accelerometer_reads_minus_gravity_at_hover_and_nothing_in_free_fall() -> None:
    vehicle = _hovering()
    vehicle.step(0.004, (HOVER,) * 4)
    assert vehicle.truth().specific_force_frd_m_s2 == pytest.approx((0.0, 0.0, -GRAVITY_M_S2), abs=1e-9)
    falling = Multirotor(SIH)
    falling.step(0.004, (0.0,) * 4)
    assert falling.truth().specific_force_frd_m_s2 == pytest.approx(STILL, abs=1e-9)


def test_accelerometer_is_in_body_axes() -> None:
    vehicle = Multirotor(SIH, q_ned_frd=from_euler(pi / 2, 0.0, 0.0))
    vehicle.step(0.001, (0.0,) * 4, external_force_ned_n=(0.0, 2.0, 0.0))
    assert vehicle.truth().specific_force_frd_m_s2 == pytest.approx((0.0, 0.0, -2.0), abs=1e-6)


def test_a_weak_motor_gives_less_lift_and_tips_the_vehicle_over_itself() -> None:
    vehicle = _hovering()
    vehicle.motor_health = (0.7, 1.0, 1.0, 1.0)
    _run(vehicle, (HOVER,) * 4, 0.1)
    roll, pitch, _ = roll_pitch_yaw(vehicle.q_ned_frd)
    assert roll > 0.0
    assert pitch < 0.0
    assert vehicle.velocity_ned_m_s[2] > 0.0


def test_external_force_and_torque_act() -> None:
    vehicle = _hovering()
    vehicle.step(0.004, (HOVER,) * 4, STILL, (1.0, 0.0, 0.0), (0.0, 0.05, 0.0))
    assert vehicle.velocity_ned_m_s[0] == pytest.approx(0.004)
    assert vehicle.rates_frd_rad_s[1] == pytest.approx(0.05 / 0.025 * 0.004)
