"""A deck that heaves and rolls: the swing is learned and foreseen."""

import math
from dataclasses import replace

import numpy as np
import pytest
from pads import diagonal, frames, ns

from companion.config import Estimation
from companion.estimation import ESTIMATORS, PadEstimator
from companion.estimation.measurement import PadMeasurement
from companion.messages import ObservationSource

PERIOD_S = 5.0
HEAVE_M = 0.5
ROLL_RAD = 0.08


def down_m(t: float) -> float:
    return -1.0 + HEAVE_M * math.sin(2.0 * math.pi * t / PERIOD_S)


def roll_rad(t: float) -> float:
    return ROLL_RAD * math.cos(2.0 * math.pi * t / PERIOD_S)


def deck(t: float, rng: np.random.Generator) -> PadMeasurement:
    n = rng.normal(0.0, 0.03, 3).tolist()
    return PadMeasurement(
        t_ns=ns(t),
        source=ObservationSource.VISION_POSE,
        position_o_m=(1.5 * t + n[0], n[1], down_m(t) + n[2]),
        covariance_m2=diagonal(0.03**2),
        roll_rad=roll_rad(t) + float(rng.normal(0.0, 0.02)),
        pitch_rad=float(rng.normal(0.0, 0.02)),
        yaw_rad=0.0,
        tilt_sigma_rad=0.02,
    )


def watched(name: str, seconds: float, seed: int) -> PadEstimator:
    rng, estimator = np.random.default_rng(seed), ESTIMATORS[name](Estimation())
    for t in frames(0.0, seconds):
        estimator.observe(deck(t, rng))
    return estimator


def mirrored(m: PadMeasurement, *, wrong_first: bool) -> PadMeasurement:
    """An ambiguous picture: seen from 20 degrees north of the deck's normal, the other pose leans 40 degrees over."""
    assert m.roll_rad is not None
    assert m.pitch_rad is not None
    true, false = (m.roll_rad, m.pitch_rad, 0.0), (m.roll_rad, m.pitch_rad + math.radians(40.0), 0.3)
    first, rival = (false, true) if wrong_first else (true, false)
    return replace(m, roll_rad=first[0], pitch_rad=first[1], yaw_rad=first[2], rival_angles_rad=rival)


@pytest.mark.parametrize("name", ["imm", "boat"])
def test_an_ambiguous_picture_is_read_as_the_track_foresees_it(name: str) -> None:
    estimator, rng = watched(name, 10.0, 1), np.random.default_rng(2)
    for t in frames(10.0, 14.0):
        estimator.observe(mirrored(deck(t, rng), wrong_first=rng.random() < 0.5))
    estimate = estimator.estimate(ns(14.0))
    assert estimate is not None
    assert abs(estimate.pitch_rad) < math.radians(3.0)
    assert abs(estimate.roll_rad) < ROLL_RAD + math.radians(3.0)
    assert abs(estimate.yaw_rad) < math.radians(3.0)


@pytest.mark.parametrize("name", ["imm", "boat"])
def test_an_ambiguous_first_picture_is_read_as_the_one_nearer_to_level(name: str) -> None:
    estimator, rng = ESTIMATORS[name](Estimation()), np.random.default_rng(3)
    estimator.observe(mirrored(deck(0.0, rng), wrong_first=True))
    estimate = estimator.estimate(ns(0.0))
    assert estimate is not None
    assert abs(estimate.pitch_rad) < math.radians(5.0)
    assert abs(estimate.yaw_rad) < math.radians(1.0)


def height_errors(estimator: PadEstimator, end_s: float, ahead_s: float) -> list[float]:
    t = end_s + ahead_s
    estimate = estimator.estimate(ns(t))
    assert estimate is not None
    return [abs(estimate.position_ned_m[2] - down_m(t)), abs(estimate.roll_rad - roll_rad(t))]


def test_heave_and_roll_are_foreseen_for_a_third_of_a_period() -> None:
    errors = np.array([height_errors(watched("boat", 20.0 + 0.4 * s, s), 20.0 + 0.4 * s, 1.5) for s in range(8)])
    heave, roll = errors.mean(axis=0)
    assert heave < 0.15
    assert roll < 0.02


def test_the_ground_model_foresees_a_heaving_deck_worse() -> None:
    ends = [20.0 + 0.4 * s for s in range(4)]
    boat = np.mean([height_errors(watched("boat", end, s), end, 1.5)[0] for s, end in enumerate(ends)])
    ground = np.mean([height_errors(watched("imm", end, s), end, 1.5)[0] for s, end in enumerate(ends)])
    assert boat < 0.5 * ground


def test_far_ahead_the_uncertainty_is_that_of_the_sea() -> None:
    estimate = watched("boat", 20.0, 1).estimate(ns(32.0))
    assert estimate is not None
    assert 0.2 < math.sqrt(estimate.covariance[2][2]) < 0.8
