"""PX4's rate loop and its integrator."""

from math import radians

import pytest

from sitl_stub.autopilot.parameters import Parameters
from sitl_stub.autopilot.rate_control import RateState, control_rates, rate_gains

GAINS = rate_gains(Parameters().as_mapping())
ZERO = (0.0, 0.0, 0.0)
DT_S = 0.004
FRESH = RateState()


def _step(
    state: RateState = FRESH,
    rates: tuple[float, float, float] = ZERO,
    demand: tuple[float, float, float] = ZERO,
    acceleration: tuple[float, float, float] = ZERO,
    saturated: tuple[float, float, float] = ZERO,
    landed: bool = False,
) -> tuple[tuple[float, float, float], RateState]:
    torque, numbers = control_rates(state, rates, demand, acceleration, saturated, landed, GAINS, DT_S)
    return torque, RateState(*numbers)


def test_torque_is_p_on_the_error_minus_d_on_the_measured_acceleration() -> None:
    torque, _ = _step(rates=(0.2, 0.0, 0.0), demand=(1.2, 0.0, 0.0), acceleration=(5.0, 0.0, 0.0))
    assert torque[0] == pytest.approx(0.15 * 1.0 - 0.003 * 5.0)


def test_a_constant_error_winds_the_integrator_up_to_its_limit() -> None:
    state = RateState()
    for _ in range(1000):
        _, state = _step(state, demand=(0.5, 0.0, 0.0))
    assert state.roll == pytest.approx(0.3)


def test_integrator_stands_still_on_the_ground() -> None:
    _, state = _step(RateState(0.1, 0.1, 0.1), demand=(1.0, 1.0, 1.0), landed=True)
    assert (state.roll, state.pitch, state.yaw) == (0.1, 0.1, 0.1)


@pytest.mark.parametrize(("error", "saturated", "moves"), [(1.0, 1.0, False), (-1.0, 1.0, True), (-1.0, -1.0, False)])
def test_integrator_does_not_push_further_into_saturation(error: float, saturated: float, moves: bool) -> None:
    _, state = _step(demand=(error, 0.0, 0.0), saturated=(saturated, 0.0, 0.0))
    assert (state.roll != 0.0) == moves


def test_large_errors_are_integrated_weakly_and_huge_ones_not_at_all() -> None:
    _, small = _step(demand=(radians(40.0), 0.0, 0.0))
    _, large = _step(demand=(radians(200.0), 0.0, 0.0))
    _, huge = _step(demand=(radians(400.0), 0.0, 0.0))
    assert large.roll < 4.0 * small.roll
    assert huge.roll == 0.0


def test_yaw_torque_passes_a_two_hertz_filter() -> None:
    state, torques = RateState(), []
    for _ in range(500):
        torque, state = _step(state._replace(yaw=0.0), demand=(0.0, 0.0, 1.0))
        torques.append(torque[2])
    assert torques[0] < 0.06 * torques[-1]
    assert torques[-1] == pytest.approx(0.2, rel=0.01)
    assert torques[19] == pytest.approx(0.2 * 0.63, abs=0.01)
