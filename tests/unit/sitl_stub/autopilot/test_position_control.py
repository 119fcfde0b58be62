"""PX4's position and velocity loops, by behaviour."""

from itertools import product
from math import acos, cos, degrees, hypot, isfinite, nan, radians, sin, sqrt

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl_stub.autopilot.parameters import Parameters
from sitl_stub.autopilot.position_control import (
    GRAVITY_M_S2,
    UNSET_MOTION,
    Motion,
    PositionDemand,
    PositionLimits,
    attitude_from_thrust,
    constrain_xy,
    control_position,
    is_flyable,
    position_gains,
)
from sitl_stub.rotation import roll_pitch_yaw, z_axis

PX4 = Parameters().as_mapping()
GAINS = position_gains(PX4)
LIMITS = PositionLimits(12.0, 3.0, 1.5, radians(45.0), 0.12, 1.0)
AT_REST = Motion(*(0.0,) * 9)
HOVER = 0.5
numbers = st.floats(-30.0, 30.0)


def _control(
    sp: Motion,
    at: Motion = AT_REST,
    integral: tuple[float, float, float] = (0.0, 0.0, 0.0),
    limits: PositionLimits = LIMITS,
) -> PositionDemand:
    return control_position(sp, at, integral, HOVER, GAINS, limits, 0.008)


def _velocity(vx: float, vy: float, vz: float) -> Motion:
    return UNSET_MOTION._replace(vx=vx, vy=vy, vz=vz)


def test_every_combination_of_set_and_unset_is_flyable_by_the_four_rules() -> None:
    for mask in product((False, True), repeat=9):
        sp = Motion(*(1.0 if is_set else nan for is_set in mask))
        every_axis = all(mask[i] or mask[i + 3] or mask[i + 6] for i in range(3))
        pairs = all(mask[i] == mask[i + 1] for i in (0, 3, 6))
        assert is_flyable(sp, AT_REST) == (every_axis and pairs)


def test_what_is_controlled_needs_an_estimate() -> None:
    assert not is_flyable(_velocity(0.0, 0.0, 0.0), AT_REST._replace(vx=nan, vy=nan))
    assert not is_flyable(UNSET_MOTION._replace(x=0.0, y=0.0, z=0.0), AT_REST._replace(z=nan))
    assert is_flyable(_velocity(0.0, 0.0, 0.0), AT_REST._replace(x=nan, y=nan, z=nan))


def test_hover_needs_hover_thrust_straight_up() -> None:
    demand = _control(_velocity(0.0, 0.0, 0.0))
    assert (demand.tx, demand.ty, demand.tz) == pytest.approx((0.0, 0.0, -HOVER))


def test_velocity_error_becomes_acceleration_by_p_and_the_measured_slope_by_d() -> None:
    demand = _control(_velocity(1.0, 0.0, 0.0), AT_REST._replace(ax=2.0))
    assert demand.ax == pytest.approx(1.8 * 1.0 - 0.2 * 2.0)


def test_small_accelerations_are_produced_exactly_in_both_axes() -> None:
    demand = _control(_velocity(0.5, -0.3, 0.0))
    scale = GRAVITY_M_S2 / HOVER
    assert (demand.tx * scale, demand.ty * scale) == pytest.approx((demand.ax, demand.ay))


def test_position_error_becomes_velocity_and_feed_forward_is_added() -> None:
    demand = _control(Motion(2.0, 0.0, 0.0, 1.0, 0.0, nan, nan, nan, nan))
    assert demand.vx == pytest.approx(0.95 * 2.0 + 1.0)
    assert demand.vz == pytest.approx(0.0)


def test_acceleration_feed_forward_is_added_to_the_velocity_loop() -> None:
    plain = _control(_velocity(1.0, 0.0, 0.0))
    fed = _control(_velocity(1.0, 0.0, 0.0)._replace(ax=0.7, ay=0.0))
    assert fed.ax - plain.ax == pytest.approx(0.7)


def test_acceleration_alone_needs_no_velocity() -> None:
    demand = _control(UNSET_MOTION._replace(ax=1.0, ay=0.0, az=0.0))
    assert demand.ax == 1.0
    assert (demand.ix, demand.iy, demand.iz) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(("asked", "given"), [(-5.0, -3.0), (-2.0, -2.0), (1.0, 1.0), (2.0, 1.5)])
def test_vertical_speed_is_clipped_to_the_limits(asked: float, given: float) -> None:
    assert _control(_velocity(0.0, 0.0, asked)).vz == given


def test_take_off_ramp_may_ask_for_less_than_hover() -> None:
    demand = _control(_velocity(0.0, 0.0, -1.0), limits=LIMITS._replace(climb=-1.0))
    assert demand.vz == 1.0
    assert -demand.tz < HOVER


@given(numbers, numbers, numbers, numbers, st.floats(0.5, 20.0))
def test_limited_sum_keeps_its_length_and_the_first_vectors_priority(
    x0: float, y0: float, x1: float, y1: float, limit: float
) -> None:
    x, y = constrain_xy(x0, y0, x1, y1, limit)
    assert hypot(x, y) <= limit * (1.0 + 1e-9)
    if hypot(x0 + x1, y0 + y1) <= limit:
        assert (x, y) == (x0 + x1, y0 + y1)
    elif hypot(x0, y0) >= limit:
        assert (x, y) == pytest.approx((x0 / hypot(x0, y0) * limit, y0 / hypot(x0, y0) * limit))


@given(numbers, numbers, st.floats(-8.0, 8.0))
def test_thrust_never_leaves_its_limits_nor_the_tilt_its_limit(vx: float, vy: float, vz: float) -> None:
    demand = _control(_velocity(vx, vy, vz), integral=(3.0, -2.0, 1.0))
    length = sqrt(demand.tx**2 + demand.ty**2 + demand.tz**2)
    assert 0.12 - 1e-9 <= length <= 1.0 + 1e-9
    assert degrees(acos(-demand.tz / length)) <= 45.0 + 1e-6


def test_height_wins_but_a_margin_stays_for_the_plane() -> None:
    demand = _control(_velocity(12.0, 0.0, -3.0), AT_REST._replace(vz=3.0))
    assert demand.tx == pytest.approx(0.3)
    assert demand.tz == pytest.approx(-sqrt(1.0 - 0.09))


def test_horizontal_integrator_unwinds_while_tilt_is_saturated() -> None:
    free = _control(_velocity(1.0, 0.0, 0.0))
    saturated = _control(_velocity(12.0, 0.0, 0.0), integral=(4.0, 0.0, 0.0))
    assert free.ix > 0.0
    assert saturated.ix < 4.0


def test_vertical_integrator_stops_at_full_and_at_least_thrust() -> None:
    full = _control(_velocity(0.0, 0.0, -3.0), AT_REST._replace(vz=5.0), integral=(0.0, 0.0, -2.0))
    least = _control(_velocity(0.0, 0.0, 1.5), AT_REST._replace(vz=-5.0), integral=(0.0, 0.0, 2.0))
    assert full.iz == -2.0
    assert least.iz == 2.0


def test_vertical_integrator_is_limited_to_gravity() -> None:
    demand = _control(_velocity(0.0, 0.0, 0.1), integral=(0.0, 0.0, 20.0))
    assert demand.iz == GRAVITY_M_S2


def test_no_thrust_setpoint_gives_the_least_thrust() -> None:
    demand = _control(UNSET_MOTION._replace(ax=0.0, ay=0.0, az=100.0), limits=LIMITS._replace(thrust_min=0.0))
    assert -demand.tz == pytest.approx(0.001)


@given(st.floats(-0.7, 0.7), st.floats(-0.7, 0.7), st.floats(-3.1, 3.1))
def test_attitude_points_its_back_along_the_thrust_and_its_nose_at_the_yaw(tx: float, ty: float, yaw: float) -> None:
    q, thrust = attitude_from_thrust(tx, ty, -0.8, yaw)
    assert thrust == pytest.approx(sqrt(tx * tx + ty * ty + 0.64))
    assert z_axis(q) == pytest.approx((-tx / thrust, -ty / thrust, 0.8 / thrust), abs=1e-9)
    assert roll_pitch_yaw(q)[2] == pytest.approx(yaw, abs=1e-6)


def test_forward_thrust_at_any_heading_is_the_same_tilt() -> None:
    for yaw in (0.0, 1.0, -2.5):
        q, _ = attitude_from_thrust(0.3 * cos(yaw), 0.3 * sin(yaw), -0.5, yaw)
        roll, pitch, _ = roll_pitch_yaw(q)
        assert roll == pytest.approx(0.0, abs=1e-9)
        assert pitch < 0.0


def test_no_thrust_at_all_leaves_the_vehicle_level() -> None:
    q, thrust = attitude_from_thrust(0.0, 0.0, 0.0, 0.5)
    assert thrust == 0.0
    assert roll_pitch_yaw(q) == pytest.approx((0.0, 0.0, 0.5))


def test_demand_is_finite_for_any_flyable_setpoint() -> None:
    for mask in product((False, True), repeat=9):
        sp = Motion(*(2.0 if is_set else nan for is_set in mask))
        if is_flyable(sp, AT_REST):
            demand = _control(sp)
            assert all(isfinite(value) for value in demand[3:])
