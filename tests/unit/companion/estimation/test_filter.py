"""Late, missing and wrong measurements: what the default bank makes of them."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from pads import FRAME_S, Path, beacon, circle, error_m, figure_8, frames, line, ns, sight, sights

from companion.config import Estimation
from companion.estimation import ESTIMATORS, PadEstimator
from companion.estimation.measurement import PadMeasurement
from companion.estimation.outlook import PadMotion


def default() -> PadEstimator:
    return ESTIMATORS["imm"](Estimation())


def fed(measurements: list[PadMeasurement]) -> PadEstimator:
    estimator = default()
    for measurement in measurements:
        estimator.observe(measurement)
    return estimator


# ------------------------------------------------------------------------------------------------------------- order


def test_order_of_arrival_does_not_matter() -> None:
    sorted_ones = sights(circle(10.0, 2.0), frames(0.0, 0.9), seed=1, with_yaw=True)
    shuffled = [sorted_ones[0], *(sorted_ones[1 + i] for i in np.random.default_rng(2).permutation(26))]
    assert fed(shuffled).estimate(ns(1.0)) == fed(sorted_ones).estimate(ns(1.0))


def test_what_is_older_than_the_history_is_refused() -> None:
    estimator = fed(sights(line(2.0), frames(0.0, 2.0), seed=1))
    verdict = estimator.observe(sight(line(2.0), 0.5, np.random.default_rng(0)))
    assert (verdict.accepted, verdict.reason) == (False, "older than the history")


def test_the_past_can_be_asked_for() -> None:
    estimator = fed(sights(line(2.0), frames(0.0, 3.0), seed=1))
    assert error_m(estimator.estimate(ns(2.5)), line(2.0)(2.5)) < 0.05
    assert estimator.estimate(ns(1.0)) is None


def test_a_question_does_not_change_later_answers() -> None:
    measurements = sights(circle(8.0, 2.0), frames(0.0, 2.0), seed=3)
    asked, silent = fed(measurements), fed(measurements)
    for t in np.linspace(1.9, 6.0, 83):
        asked.estimate(ns(float(t)))
    assert asked.estimate(ns(5.0)) == silent.estimate(ns(5.0))


def test_the_motion_ahead_on_a_curve_has_the_bits_of_the_estimate() -> None:
    measurements = sights(figure_8(20.0, 8.0, 2.0), frames(0.0, 2.0), seed=3, with_yaw=True)
    moving, whole = fed(measurements), fed(measurements)
    for t in np.linspace(1.9, 6.0, 83):
        motion, estimate = moving.motion(ns(float(t))), whole.estimate(ns(float(t)))
        assert motion is not None
        assert estimate is not None
        for name in PadMotion.__slots__:
            assert getattr(motion, name) == getattr(estimate, name)
        assert moving.deck(ns(float(t))) == (estimate.velocity_ned_m_s[2], estimate.roll_rad, estimate.pitch_rad)


def rms_error(delays_s: list[float], path: Path, seed: int) -> float:
    """Error at 50 Hz against truth *now* when frame k arrives delays_s[k] after it was taken."""
    measurements = sights(path, frames(0.0, 12.0), seed=seed)
    arrivals = [(m.t_ns + ns(delay), m) for m, delay in zip(measurements, delays_s, strict=True)]
    arrivals.sort(key=lambda arrival: arrival[0])
    estimator, errors, index = default(), [], 0
    for k in range(600):
        now_ns = k * 20_000_000
        while index < len(arrivals) and arrivals[index][0] <= now_ns:
            estimator.observe(arrivals[index][1])
            index += 1
        if now_ns > ns(4.0):
            errors.append(error_m(estimator.estimate(now_ns), path(now_ns / 1e9)))
    return float(np.sqrt(np.mean(np.square(errors))))


def test_delays_up_to_half_a_second_cost_at_most_two_centimetres() -> None:
    delays = np.random.default_rng(5).uniform(0.0, 0.5, 360).tolist()
    late, prompt = rms_error(delays, line(2.0), 4), rms_error([0.0] * 360, line(2.0), 4)
    assert late - prompt <= 0.02


# ------------------------------------------------------------------------------------------------------------- outages


def blind_errors(path: Path, *, with_beacon: bool, runs: int = 14, see_s: float = 6.0) -> list[float]:
    """Error 2 s after the last sight; the beacon's 5 Hz, where there is one, go on with a wandering bias."""
    errors = []
    for seed in range(runs):
        start = 0.73 * seed
        rng = np.random.default_rng(seed + 100)
        seen = [t for t in frames(start, start + see_s) if rng.random() > 0.1]
        events = sights(path, seen, seed=seed)
        bias = rng.normal(0.0, 1.06, 2)
        for k in range(round((see_s + 2.0) * 5) if with_beacon else 0):
            bias = bias + rng.normal(0.0, 0.087, 2)
            events.append(beacon(path, start + 0.013 + 0.2 * k, (float(bias[0]), float(bias[1])), rng))
        t = seen[-1] + 2.0
        estimator = fed(sorted((m for m in events if m.t_ns <= ns(t)), key=lambda m: m.t_ns))
        errors.append(error_m(estimator.estimate(ns(t)), path(t)))
    return errors


@pytest.mark.parametrize(
    ("path", "limit_m"),
    [(line(4.2), 0.15), (circle(5.0, 4.2), 0.35), (circle(20.0, 4.2), 0.35), (figure_8(10.0, 5.0, 4.2), 0.35)],
    ids=["line", "circle5", "circle20", "figure-8"],
)
def test_two_seconds_blind_with_a_beacon(path: Path, limit_m: float) -> None:
    assert np.percentile(blind_errors(path, with_beacon=True, see_s=4.0), 95) <= limit_m


def test_two_seconds_blind_on_a_line_without_anything() -> None:
    assert np.percentile(blind_errors(line(4.2), with_beacon=False), 95) <= 0.2


def test_uncertainty_grows_while_blind_and_covers_the_error() -> None:
    path = line(2.0)
    estimator = fed(sights(path, frames(0.0, 5.0), seed=7))
    sigmas = []
    for after in (0.1, 1.0, 3.0, 10.0):
        estimate = estimator.estimate(ns(5.0 + after))
        assert estimate is not None
        assert error_m(estimate, path(5.0 + after)) <= 3.0 * math.sqrt(2.0) * estimate.position_sigma_m
        assert estimate.vision_age_s == pytest.approx(after + FRAME_S)
        sigmas.append(estimate.position_sigma_m)
    assert all(a < b for a, b in pairwise(sigmas))


def test_after_ten_seconds_without_sight_the_first_frame_is_taken() -> None:
    path = circle(20.0, 2.0)
    estimator = fed(sights(path, frames(0.0, 6.0), seed=8))
    again = sights(path, frames(16.0, 17.0), seed=9)
    verdicts = [estimator.observe(m) for m in again]
    assert verdicts[0].accepted
    assert all(verdict.accepted for verdict in verdicts)
    assert error_m(estimator.estimate(ns(17.0)), path(17.0)) < 0.1


def test_a_pad_that_is_lost_for_long_is_gone() -> None:
    estimator = fed(sights(line(1.0), frames(0.0, 2.0), seed=1))
    assert estimator.estimate(ns(2.0 + 14.0)) is not None
    assert estimator.estimate(ns(2.0 + 16.0)) is None


# -------------------------------------------------------------------------------------------------------- wrong values


@pytest.mark.parametrize("kind", ["constant", "alternating", "random"])
def test_outliers_on_one_axis_cost_neither_that_axis_nor_the_others(kind: str) -> None:
    path, rng = line(2.0), np.random.default_rng(11)
    offset = {
        "constant": lambda k: 1.0,
        "alternating": lambda k: 1.0 if k % 2 else -1.0,
        "random": lambda k: float(rng.choice((-1.0, 1.0))),
    }[kind]
    estimator = fed(sights(path, frames(0.0, 8.0), seed=12))
    for k, m in enumerate(sights(path, frames(8.0, 14.0), seed=13)):
        assert m.position_o_m is not None
        x, y, z = m.position_o_m
        verdict = estimator.observe(replace(m, position_o_m=(x + offset(k), y, z)))
        assert verdict.accepted
        assert "north" in verdict.reason
        truth = path(m.t_ns / 1e9)
        estimate = estimator.estimate(m.t_ns)
        assert estimate is not None
        assert abs(estimate.position_ned_m[0] - truth.x) < 0.5
        assert abs(estimate.position_ned_m[1] - truth.y) < 0.1
    for m in sights(path, frames(14.0, 16.0), seed=14):
        estimator.observe(m)
    assert error_m(estimator.estimate(ns(16.0)), path(16.0)) < 0.1


def test_a_false_first_sight_is_given_up_at_once() -> None:
    path = line(1.0)
    first = sight(path, 0.0, np.random.default_rng(1))
    assert first.position_o_m is not None
    estimator = fed([replace(first, position_o_m=(50.0, -30.0, 0.0))])
    for m in sights(path, frames(0.1, 1.5), seed=15):
        estimator.observe(m)
    assert error_m(estimator.estimate(ns(1.5)), path(1.5)) < 0.15


def test_vision_cut_with_a_beacon_that_is_off_by_more_than_a_metre() -> None:
    """Vision teaches the beacon's bias; after the cut, 8 s of approach on the beacon alone end within 0.3 m."""
    path = line(1.5)
    errors = []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        events = sights(path, frames(0.0, 5.0), seed=seed)
        events += [beacon(path, 0.01 + 0.2 * k, (1.2, 0.0), rng) for k in range(65)]
        estimator = fed(sorted(events, key=lambda m: m.t_ns))
        errors.append(error_m(estimator.estimate(ns(13.0)), path(13.0)))
    assert max(errors) <= 0.3


def test_a_beacon_bias_is_gone_as_soon_as_the_pad_is_seen() -> None:
    path, rng = line(1.5), np.random.default_rng(3)
    estimator = fed([beacon(path, 0.2 * k, (1.2, -0.9), rng) for k in range(10)])
    assert 1.0 < error_m(estimator.estimate(ns(2.0)), path(2.0)) < 2.0
    for m in sights(path, frames(2.0, 2.5), seed=4):
        estimator.observe(m)
    assert error_m(estimator.estimate(ns(2.5)), path(2.5)) < 0.1


# ------------------------------------------------------------------------------------------------------- what it gives


@pytest.mark.parametrize("radius_m", [5.0, 10.0, 20.0])
def test_on_a_circle_the_acceleration_points_to_the_middle(radius_m: float) -> None:
    path = circle(radius_m, 4.2)
    estimate = fed(sights(path, frames(0.0, 6.0), seed=2, with_yaw=True)).estimate(ns(6.35))
    assert estimate is not None
    truth = path(6.35)
    w = 4.2 / radius_m
    error = math.hypot(
        estimate.acceleration_ned_m_s2[0] + w * truth.vy, estimate.acceleration_ned_m_s2[1] - w * truth.vx
    )
    assert error < 0.4
    assert estimate.yaw_rate_rad_s == pytest.approx(w, abs=0.1)
    assert error_m(estimate, truth) < 0.15


def test_the_bank_knows_a_line_from_a_curve() -> None:
    straight = fed(sights(line(3.0), frames(0.0, 5.0), seed=1)).estimate(ns(5.0))
    curve = fed(sights(circle(6.0, 3.0), frames(0.0, 5.0), seed=1)).estimate(ns(5.0))
    assert straight is not None
    assert curve is not None
    assert straight.model == "constant_velocity"
    assert curve.model == "coordinated_turn"
    assert sum(p for _, p in curve.model_probabilities) == pytest.approx(1.0)


def test_a_yaw_that_flips_is_refused_and_the_position_is_not() -> None:
    measurements = sights(line(2.0), frames(0.0, 3.0), seed=1, with_yaw=True)
    estimator = fed(measurements)
    late = sights(line(2.0), frames(3.0, 4.0), seed=2, with_yaw=True)
    for m in late:
        assert m.yaw_rad is not None
        assert estimator.observe(replace(m, yaw_rad=m.yaw_rad + math.pi)).reason == "fused"
    estimate = estimator.estimate(ns(4.0))
    assert estimate is not None
    assert estimate.yaw_rad == pytest.approx(math.atan2(0.6, 0.8), abs=0.1)
