"""What every registered estimator must do."""

import math
from dataclasses import replace

import numpy as np
import pytest
from pads import error_m, frames, ns, sights, still

from companion.config import Estimation
from companion.estimation import ESTIMATORS, PadEstimator
from companion.estimation.measurement import CameraPose, PadMeasurement
from companion.estimation.outlook import PadMotion
from companion.messages import ObservationSource

NAMES = sorted(ESTIMATORS)


def seen(name: str) -> list[PadMeasurement]:
    """A pad that stands still, as positions or, for the filter that wants them, as bearings from 8 m above."""
    if name != "bearing_ukf":
        return sights(still, frames(0.0, 3.0), seed=1)
    truth, rng = still(0.0), np.random.default_rng(1)
    measurements = []
    for t in frames(0.0, 3.0):
        d = np.array([truth.x, truth.y, 8.0]) + rng.normal(0.0, 0.03, 3)
        u = (d / np.linalg.norm(d)).tolist()
        camera = CameraPose((0.0, 0.0, -8.0), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        source = ObservationSource.VISION_BEARING
        measurements.append(PadMeasurement(ns(t), source, bearing_o=(u[0], u[1], u[2]), camera=camera))
    return measurements


def fed(name: str) -> PadEstimator:
    estimator = ESTIMATORS[name](Estimation())
    for m in seen(name):
        estimator.observe(m)
    return estimator


@pytest.mark.parametrize("name", NAMES)
def test_there_is_no_estimate_before_the_first_sight(name: str) -> None:
    assert ESTIMATORS[name](Estimation()).estimate(ns(1.0)) is None


@pytest.mark.parametrize("name", NAMES)
def test_a_still_pad_is_found_and_the_covariance_is_sound(name: str) -> None:
    estimate = fed(name).estimate(ns(3.0))
    assert error_m(estimate, still(3.0)) < 0.15
    assert estimate is not None
    P = np.array(estimate.covariance)
    assert P.shape == (6, 6)
    assert np.allclose(P, P.T)
    assert np.linalg.eigvalsh(P).min() > -1e-12
    assert 0.0 < estimate.position_sigma_m < 0.3
    assert estimate.vision_age_s == pytest.approx(1.0 / 30.0)


@pytest.mark.parametrize("name", NAMES)
def test_the_motion_alone_has_the_bits_of_the_whole_estimate_ahead_and_in_the_past(name: str) -> None:
    estimator = fed(name)
    for t in (2.5, 3.0, 3.3, 3.7, 5.02, 4.4, 9.0, 500.0):
        motion, estimate = estimator.motion(ns(t)), estimator.estimate(ns(t))
        assert (motion is None) == (estimate is None)
        if motion is not None and estimate is not None:
            for field in PadMotion.__slots__:
                assert getattr(motion, field) == getattr(estimate, field)
            assert estimator.deck(ns(float(t))) == (estimate.velocity_ned_m_s[2], estimate.roll_rad, estimate.pitch_rad)


@pytest.mark.parametrize("name", NAMES)
def test_numbers_are_plain_floats(name: str) -> None:
    estimate = fed(name).estimate(ns(3.1))
    assert estimate is not None
    numbers = [*estimate.position_ned_m, *estimate.velocity_ned_m_s, *estimate.covariance[0], estimate.yaw_rad]
    assert {type(number) for number in numbers} == {float}
    assert all(math.isfinite(number) for number in numbers)


@pytest.mark.parametrize("name", NAMES)
def test_same_measurements_give_the_same_estimate(name: str) -> None:
    assert fed(name).estimate(ns(3.5)) == fed(name).estimate(ns(3.5))


@pytest.mark.parametrize("name", NAMES)
def test_late_measurements_end_in_the_same_estimate(name: str) -> None:
    measurements = [m for m in seen(name) if m.t_ns < ns(0.9)]
    late = ESTIMATORS[name](Estimation())
    for m in [*measurements[:10], *measurements[12:], *measurements[10:12]]:
        late.observe(m)
    prompt = ESTIMATORS[name](Estimation())
    for m in measurements:
        prompt.observe(m)
    assert late.estimate(ns(1.0)) == prompt.estimate(ns(1.0))


@pytest.mark.parametrize("name", NAMES)
def test_reset_forgets_the_pad(name: str) -> None:
    estimator = fed(name)
    estimator.reset()
    assert estimator.estimate(ns(3.0)) is None


@pytest.mark.parametrize("name", NAMES)
def test_every_verdict_says_why(name: str) -> None:
    estimator = ESTIMATORS[name](Estimation())
    for m in seen(name)[:30]:
        verdict = estimator.observe(m)
        assert verdict.reason
        assert verdict.source is m.source
    refused = estimator.observe(replace(seen(name)[0], t_ns=-1))
    assert (refused.accepted, refused.reason) == (False, "older than the history")
