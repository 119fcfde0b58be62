"""The whole cascade on the recorded vehicle, without estimate error."""

from dataclasses import replace
from math import degrees, hypot, nan, pi, radians
from pathlib import Path

import numpy as np
import pytest

from sitl_stub.airframe import read_airframe
from sitl_stub.autopilot.cascade import Cascade, FlightConstraints
from sitl_stub.autopilot.estimate import NO_ERRORS, Estimator
from sitl_stub.autopilot.parameters import Parameters
from sitl_stub.autopilot.setpoint import AttitudeSetpoint, RatesSetpoint, Setpoint, TrajectorySetpoint
from sitl_stub.multirotor import Multirotor
from sitl_stub.rotation import from_euler, roll_pitch_yaw

AIRFRAMES = Path(__file__).parents[4] / "configs" / "airframes"
FLYING = FlightConstraints(armed=True, landed=False, maybe_landed=False)
STEP_S = 0.004
HOLD = TrajectorySetpoint(velocity_ned_m_s=(0.0, 0.0, 0.0), yaw_rate_rad_s=0.0)


class Flight:
    """A vehicle in the air under its cascade."""

    def __init__(self, airframe: str = "sih_quadx", **parameters: float) -> None:
        body = read_airframe(AIRFRAMES / f"{airframe}.toml")
        values = Parameters({**body.parameters, **parameters}).as_mapping()
        hover = body.hover_signal
        self.vehicle = Multirotor(body, (0.0, 0.0, -30.0), motors=(hover, hover, hover, hover))
        self.cascade = Cascade(values)
        self.cascade.start_in_flight(hover, self.vehicle.q_ned_frd, hover, (0.0, 0.0, 0.0))
        self.estimator = Estimator(values, np.random.default_rng(0), NO_ERRORS)
        self.t_us = 0
        self.most_tilt_rad = 0.0

    def fly(self, setpoint: Setpoint, seconds: float, constraints: FlightConstraints = FLYING) -> Multirotor:
        for _ in range(round(seconds / STEP_S)):
            estimate = self.estimator.step(self.t_us, self.vehicle.truth(), STEP_S)
            self.vehicle.step(STEP_S, self.cascade.step(STEP_S, estimate, setpoint, constraints))
            self.t_us += 4000
            roll, pitch, _ = roll_pitch_yaw(self.vehicle.q_ned_frd)
            self.most_tilt_rad = max(self.most_tilt_rad, hypot(roll, pitch))
        return self.vehicle


def _velocity(vx: float, vy: float, vz: float) -> TrajectorySetpoint:
    return TrajectorySetpoint(velocity_ned_m_s=(vx, vy, vz), yaw_rate_rad_s=0.0)


def test_hover_stays() -> None:
    vehicle = Flight().fly(HOLD, 5.0)
    assert vehicle.position_ned_m == pytest.approx((0.0, 0.0, -30.0), abs=1e-3)


@pytest.mark.parametrize("airframe", ["sih_quadx", "sih_quadx_lowdrag", "x500", "falanga2017", "guo2025"])
def test_every_airframe_reaches_a_place_and_stays_there(airframe: str) -> None:
    vehicle = Flight(airframe).fly(TrajectorySetpoint((4.0, -3.0, -32.0), yaw_rad=1.0), 12.0)
    assert vehicle.position_ned_m == pytest.approx((4.0, -3.0, -32.0), abs=0.1)
    assert vehicle.velocity_ned_m_s == pytest.approx((0.0, 0.0, 0.0), abs=0.05)
    assert roll_pitch_yaw(vehicle.q_ned_frd)[2] == pytest.approx(1.0, abs=0.02)


def test_a_setpoint_reaches_the_motors_within_four_position_steps() -> None:
    flight = Flight()
    flight.fly(HOLD, 1.0)
    before = flight.cascade.motors
    flight.fly(_velocity(5.0, 0.0, 0.0), 0.016)
    assert max(abs(a - b) for a, b in zip(flight.cascade.motors, before, strict=True)) > 0.05


def test_tilt_is_limited_to_the_parameter() -> None:
    flight = Flight(MPC_TILTMAX_AIR=20.0)
    flight.fly(_velocity(12.0, 0.0, 0.0), 2.0)
    assert degrees(flight.most_tilt_rad) == pytest.approx(20.0, abs=1.0)


def test_speed_and_climb_are_limited_by_the_parameters() -> None:
    flight = Flight("sih_quadx_lowdrag", MPC_XY_VEL_MAX=4.0)
    flight.fly(_velocity(10.0, 0.0, -8.0), 8.0)
    assert flight.cascade.position_setpoint.velocity_ned_m_s == pytest.approx((4.0, 0.0, -3.0))
    assert flight.vehicle.velocity_ned_m_s == pytest.approx((4.0, 0.0, -3.0), abs=0.2)


def test_constraints_may_only_tighten_the_limits() -> None:
    flight = Flight()
    flight.fly(_velocity(10.0, 0.0, -8.0), 0.1, replace(FLYING, speed_limit_m_s=2.0, climb_limit_m_s=1.0))
    assert flight.cascade.position_setpoint.velocity_ned_m_s == pytest.approx((2.0, 0.0, -1.0))
    flight.fly(_velocity(20.0, 0.0, -8.0), 0.1, replace(FLYING, speed_limit_m_s=50.0, climb_limit_m_s=50.0))
    assert flight.cascade.position_setpoint.velocity_ned_m_s == pytest.approx((12.0, 0.0, -3.0))


def test_a_parameter_changed_in_flight_acts_after_refresh() -> None:
    parameters = Parameters()
    cascade = Cascade(parameters.as_mapping())
    cascade.start_in_flight(0.49, (1.0, 0.0, 0.0, 0.0), 0.49, (0.0, 0.0, 0.0))
    estimator = Estimator(parameters.as_mapping(), np.random.default_rng(0), NO_ERRORS)
    estimate = estimator.step(0, Flight().vehicle.truth(), STEP_S)
    cascade.step(STEP_S, estimate, _velocity(1.0, 0.0, 0.0), FLYING)
    before = cascade.position_setpoint.acceleration_ned_m_s2[0]
    parameters.set("MPC_XY_VEL_P_ACC", 3.6)
    cascade.refresh()
    cascade.step(2 * STEP_S, estimate, _velocity(1.0, 0.0, 0.0), FLYING)
    assert cascade.position_setpoint.acceleration_ned_m_s2[0] == pytest.approx(2.0 * before, rel=0.01)


def test_heading_rate_is_followed_and_not_held() -> None:
    vehicle = Flight().fly(TrajectorySetpoint(velocity_ned_m_s=(0.0, 0.0, 0.0), yaw_rate_rad_s=0.5), 8.0)
    assert vehicle.rates_frd_rad_s[2] == pytest.approx(0.5, abs=0.02)


def test_unset_yaw_keeps_the_present_heading() -> None:
    flight = Flight()
    flight.vehicle = Multirotor(
        flight.vehicle.airframe, (0.0, 0.0, -30.0), q_ned_frd=from_euler(0.0, 0.0, 2.0), motors=flight.vehicle.motors
    )
    vehicle = flight.fly(_velocity(3.0, 0.0, 0.0), 4.0)
    assert roll_pitch_yaw(vehicle.q_ned_frd)[2] == pytest.approx(2.0, abs=0.02)


def test_an_attitude_setpoint_is_taken() -> None:
    q = from_euler(0.0, radians(-10.0), 0.5)
    vehicle = Flight().fly(AttitudeSetpoint(q, 0.5), 4.0)
    assert roll_pitch_yaw(vehicle.q_ned_frd) == pytest.approx((0.0, radians(-10.0), 0.5), abs=0.01)


def test_rates_are_taken_and_nan_keeps_what_is() -> None:
    flight = Flight()
    vehicle = flight.fly(RatesSetpoint((0.0, nan, 0.6), 0.5), 1.5)
    assert vehicle.rates_frd_rad_s[2] == pytest.approx(0.6, abs=0.05)
    assert abs(vehicle.rates_frd_rad_s[1]) < 0.02


def test_disarmed_motors_stand_still_and_integrators_are_empty() -> None:
    flight = Flight()
    flight.fly(_velocity(5.0, 0.0, 0.0), 2.0)
    flight.fly(HOLD, STEP_S, FlightConstraints(armed=False))
    assert flight.cascade.motors == (0.0, 0.0, 0.0, 0.0)
    assert flight.cascade.velocity_integral_m_s2 == (0.0, 0.0, 0.0)


def test_thrust_off_means_no_thrust_and_no_windup() -> None:
    flight = Flight()
    flight.fly(_velocity(0.0, 0.0, -1.0), 1.0, replace(FLYING, thrust_off=True, is_flying=False, landed=True))
    assert flight.cascade.thrust_setpoint == pytest.approx(0.001)
    assert flight.cascade.velocity_integral_m_s2[:2] == (0.0, 0.0)


def test_during_the_take_off_ramp_the_tilt_is_small() -> None:
    flight = Flight()
    flight.cascade.reset()
    flight.fly(_velocity(12.0, 0.0, -1.0), 1.0, replace(FLYING, is_flying=False))
    assert degrees(flight.most_tilt_rad) < 13.0


def test_an_unflyable_setpoint_brakes_to_a_hover_after_a_fifth_of_a_second() -> None:
    flight = Flight()
    flight.fly(_velocity(3.0, 0.0, 0.0), 4.0)
    broken = TrajectorySetpoint(velocity_ned_m_s=(3.0, nan, 0.0))
    flight.fly(broken, 0.19)
    assert not flight.cascade.is_holding_invalid_setpoint
    flight.fly(broken, 5.0)
    assert flight.cascade.is_holding_invalid_setpoint
    assert hypot(*flight.vehicle.velocity_ned_m_s) < 0.6


def test_without_velocity_an_unflyable_setpoint_comes_down_level() -> None:
    flight = Flight()
    flight.estimator.estimate.has_velocity = flight.estimator.estimate.has_position = False
    vehicle = flight.fly(_velocity(1.0, 0.0, 0.0), 4.0)
    assert vehicle.velocity_ned_m_s == pytest.approx((0.0, 0.0, 0.7), abs=0.1)


def test_steering_by_height_rate_follows_the_less_biased_speed() -> None:
    """A velocity bias of the estimator does not change a commanded descent faster than MPC_LAND_SPEED."""
    flight = Flight()
    for _ in range(1500):
        estimate = flight.estimator.step(flight.t_us, flight.vehicle.truth(), STEP_S)
        vx, vy, vz = estimate.velocity_ned_m_s
        estimate.velocity_ned_m_s = (vx, vy, vz + 0.3)
        flight.vehicle.step(STEP_S, flight.cascade.step(STEP_S, estimate, _velocity(0.0, 0.0, 1.0), FLYING))
    assert flight.vehicle.velocity_ned_m_s[2] == pytest.approx(1.0, abs=0.03)


def test_a_position_needs_no_yaw_and_flies_round_by_feed_forward() -> None:
    """Fact 31: feed-forward takes most of the lag on a circle away."""
    lags = []
    for feed_forward in (False, True):
        flight, errors = Flight(), []
        for i in range(500):
            a = 0.4 * i * 0.02
            x, y = 5.0 * np.cos(a), 5.0 * np.sin(a)
            v = (-2.0 * np.sin(a), 2.0 * np.cos(a), 0.0) if feed_forward else (nan, nan, nan)
            vehicle = flight.fly(TrajectorySetpoint((x, y, -30.0), v), 0.02)
            errors.append(hypot(vehicle.position_ned_m[0] - x, vehicle.position_ned_m[1] - y))
        lags.append(np.sqrt(np.mean(np.square(errors[250:]))))
    assert lags[0] == pytest.approx(3.1, abs=0.4)
    assert lags[1] == pytest.approx(1.4, abs=0.4)


def test_yaw_of_ninety_degrees_takes_as_long_as_recorded() -> None:
    flight = Flight()
    flight.fly(TrajectorySetpoint((0.0, 0.0, -30.0), yaw_rad=0.0), 0.5)
    yaws = [
        roll_pitch_yaw(flight.fly(TrajectorySetpoint((0.0, 0.0, -30.0), yaw_rad=pi / 2), STEP_S).q_ned_frd)[2]
        for _ in range(500)
    ]
    assert np.argmax(np.array(yaws) > 0.9 * pi / 2) * STEP_S == pytest.approx(0.93, abs=0.1)
    assert max(yaws) / (pi / 2) - 1.0 == pytest.approx(0.16, abs=0.03)
