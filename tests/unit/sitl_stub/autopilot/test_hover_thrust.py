"""The hover thrust estimator."""

import pytest

from sitl_stub.autopilot.hover_thrust import GRAVITY_M_S2, HoverThrust
from sitl_stub.autopilot.parameters import Parameters

REST = (0.0, 0.0, 0.0)


def _fly(estimator: HoverThrust, hover: float, seconds: float, thrust: float = 0.5) -> None:
    for _ in range(round(seconds / 0.008)):
        estimator.update(GRAVITY_M_S2 * (thrust / hover - 1.0), thrust, REST, 0.008)


def test_it_finds_the_thrust_that_carries_the_vehicle() -> None:
    estimator = HoverThrust(Parameters().as_mapping())
    _fly(estimator, 0.44, 20.0)
    assert estimator.value == pytest.approx(0.44, abs=0.005)
    assert estimator.is_valid


def test_it_is_not_valid_at_once() -> None:
    estimator = HoverThrust(Parameters().as_mapping())
    _fly(estimator, 0.49, 1.0)
    assert not estimator.is_valid


def test_it_stays_within_its_range_around_the_parameter() -> None:
    estimator = HoverThrust(Parameters({"HTE_THR_RANGE": 0.05}).as_mapping())
    _fly(estimator, 0.30, 60.0)
    assert estimator.value == pytest.approx(0.45)


def test_settled_it_moves_slowly_as_recorded() -> None:
    """The recorded variance settles at 1.6e-6 in flight: a time constant of some ten seconds."""
    estimator = HoverThrust(Parameters().as_mapping())
    estimator.start(0.49)
    _fly(estimator, 0.50, 1.0)
    assert 0.4902 < estimator.value < 0.493
    assert 1e-6 < estimator.variance < 2e-6


def test_reset_forgets() -> None:
    estimator = HoverThrust(Parameters().as_mapping())
    estimator.start(0.4)
    estimator.reset()
    assert estimator.value == 0.5
    assert not estimator.is_valid
