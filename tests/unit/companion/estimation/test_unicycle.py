"""The non-holonomic EKF: direction and speed from positions alone."""

import math

import pytest
from pads import Truth, circle, error_m, figure_8, frames, line, ns, sights, still

from companion.compiled import room
from companion.config import Estimation
from companion.estimation import ESTIMATORS, PadMeasurement
from companion.estimation.unicycle import predict_unicycle, update_position
from companion.messages import ObservationSource


def plain(kernel):
    return getattr(kernel, "py_func", kernel)


def test_prediction_drives_along_the_heading() -> None:
    x, P = [1.0, 2.0, 3.0, math.pi / 2, 2.0], [0.0] * 25
    plain(predict_unicycle)(x, P, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert x == pytest.approx([1.0, 3.0, 3.0, math.pi / 2, 2.0])


def test_compiled_and_plain_kernels_agree_to_the_last_digits() -> None:
    args = (0.04, 0.3, 1e-4, 1e-3, 0.05, 0.2)
    x, P = [0.1, 0.2, 0.3, 0.4, 3.0], [0.3 * (i % 6 == 0) + 0.01 for i in range(25)]
    X, Q = room(x[:]), room(P[:])
    for _ in range(50):
        plain(predict_unicycle)(x, P, *args)
        plain(update_position)(x, P, 1.0, 0.5, 0.2, 1e-3, 1e-3, 1e-3)
        predict_unicycle(X, Q, *args)
        update_position(X, Q, 1.0, 0.5, 0.2, 1e-3, 1e-3, 1e-3)
    assert list(X) == pytest.approx(x, rel=1e-12, abs=1e-12)
    assert list(Q) == pytest.approx(P, rel=1e-10, abs=1e-12)


@pytest.mark.parametrize(
    "path", [line(1.2), circle(8.0, 2.0), figure_8(10.0, 5.0, 4.2)], ids=["line", "circle", "figure-8"]
)
def test_it_follows_the_paths_of_the_paper(path) -> None:
    estimator = ESTIMATORS["unicycle"](Estimation())
    for m in sights(path, frames(0.0, 8.0), seed=1):
        assert estimator.observe(m).accepted
    estimate = estimator.estimate(ns(8.0))
    assert error_m(estimate, path(8.0)) < 0.15
    assert estimate is not None
    assert math.hypot(estimate.velocity_ned_m_s[0] - path(8.0).vx, estimate.velocity_ned_m_s[1] - path(8.0).vy) < 0.5


def test_a_pad_that_stands_still_is_held_in_place() -> None:
    estimator = ESTIMATORS["unicycle"](Estimation())
    for m in sights(still, frames(0.0, 5.0), seed=2):
        estimator.observe(m)
    assert error_m(estimator.estimate(ns(5.0)), still(5.0)) < 0.05


def test_first_sights_that_are_far_off_send_it_nowhere() -> None:
    """A tag of 26 pixels at 15 m: half a metre off. Two such sights a frame apart look like a platform at 15 m/s."""
    path, estimator = line(4.2), ESTIMATORS["unicycle"](Estimation())
    speeds = []
    for k, m in enumerate(sights(path, frames(0.0, 2.0), seed=4, sigma_m=0.5)):
        estimator.observe(m)
        estimate = estimator.estimate(ns((k + 1) / 30.0))
        assert estimate is not None
        speeds.append(math.hypot(*estimate.velocity_ned_m_s[:2]))
    assert max(speeds) < 1.4 * 4.2
    assert speeds[-1] == pytest.approx(4.2, abs=0.8)


def test_a_platform_that_drives_off_after_a_while_is_followed() -> None:
    """It stood for 20 s: the line through all of that would say that it hardly moves."""
    estimator = ESTIMATORS["unicycle"](Estimation())

    def path(t: float) -> Truth:
        return Truth(0.0, max(0.0, t - 20.0), 0.0, float(t > 20.0), 1.57)

    for m in sights(path, frames(0.0, 23.0), seed=5):
        estimator.observe(m)
    assert error_m(estimator.estimate(ns(23.0)), path(23.0)) < 0.15


def test_near_the_deck_the_range_sensor_corrects_the_height_alone() -> None:
    estimator = ESTIMATORS["unicycle"](Estimation())
    for m in sights(line(1.2), frames(0.0, 4.0), seed=3):
        estimator.observe(m)
    before = estimator.estimate(ns(4.5))
    assert before is not None
    down_m = before.position_ned_m[2] + 0.1
    for k in range(20):
        reading = PadMeasurement(ns(4.05 + 0.02 * k), ObservationSource.RANGE, height_o_m=down_m, height_sigma_m=0.05)
        assert estimator.observe(reading).accepted
    after = estimator.estimate(ns(4.5))
    assert after is not None
    assert after.position_ned_m[2] == pytest.approx(down_m, abs=0.02)
    assert after.position_ned_m[:2] == pytest.approx(before.position_ned_m[:2], abs=0.01)


def test_on_a_curve_the_learned_turn_rate_tells_where_the_platform_will_be() -> None:
    """A second ahead at 4.2 m/s on a circle of 12 m: straight on is 0.7 m beside it."""
    path = circle(12.0, 4.2)
    missed = {}
    for name in ("unicycle", "unicycle_turn"):
        estimator = ESTIMATORS[name](Estimation())
        for m in sights(path, frames(0.0, 8.0), seed=1):
            estimator.observe(m)
        missed[name] = error_m(estimator.estimate(ns(9.0)), path(9.0))
        estimate = estimator.estimate(ns(8.0))
        assert estimate is not None
        assert abs(estimate.yaw_rate_rad_s) == pytest.approx(4.2 / 12.0 if name == "unicycle_turn" else 0.0, abs=0.1)
    assert missed["unicycle_turn"] < 0.4 < missed["unicycle"]
