"""Bearings alone, from a camera that moves and whose attitude is not quite known."""

import math

import numpy as np
import pytest
from pads import Path, error_m, frames, line, ns, still

from companion.compiled import room
from companion.config import Estimation
from companion.estimation import ESTIMATORS, PadEstimator
from companion.estimation.bearing_ukf import predict_constant_velocity, update_bearing
from companion.estimation.measurement import CameraPose, PadMeasurement
from companion.messages import ObservationSource

HEIGHT_M = 8.0


def bearing(
    path: Path, t: float, camera: tuple[float, float], rng: np.random.Generator, *, tilt: float
) -> PadMeasurement:
    truth = path(t)
    d = np.array([truth.x - camera[0], truth.y - camera[1], HEIGHT_M])
    d = d + np.cross(rng.normal(0.0, tilt, 3), d) + rng.normal(0.0, 0.004, 3) * np.linalg.norm(d)
    unit = (d / np.linalg.norm(d)).tolist()
    pose = CameraPose((camera[0], camera[1], -HEIGHT_M), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    return PadMeasurement(
        t_ns=ns(t),
        source=ObservationSource.VISION_BEARING,
        bearing_o=(unit[0], unit[1], unit[2]),
        bearing_sigma_rad=0.004,
        camera=pose,
    )


def followed(path: Path, seconds: float, *, seed: int) -> tuple[PadEstimator, list[bool]]:
    """The camera circles near the pad's path."""
    rng = np.random.default_rng(seed)
    estimator, accepted = ESTIMATORS["bearing_ukf"](Estimation()), []
    for t in frames(0.0, seconds):
        truth = path(t)
        camera = (truth.x + 2.0 * math.cos(t), truth.y + 2.0 * math.sin(t))
        accepted.append(estimator.observe(bearing(path, t, camera, rng, tilt=0.01)).accepted)
    return estimator, accepted


@pytest.mark.parametrize("path", [still, line(1.0)], ids=["still", "line"])
def test_the_pad_is_found_on_the_ground(path: Path) -> None:
    estimator, accepted = followed(path, 8.0, seed=1)
    estimate = estimator.estimate(ns(8.0))
    assert sum(accepted) / len(accepted) > 0.98
    assert error_m(estimate, path(8.0)) < 0.15
    assert estimate is not None
    assert estimate.velocity_ned_m_s[0] == pytest.approx(path(8.0).vx, abs=0.2)


def test_compiled_and_plain_kernels_agree_to_the_last_digits() -> None:
    def run(kernel, predict, make):
        x, P = make([0.4, -0.3, 0.0, 0.0]), make([float(i % 5 == 0) for i in range(16)])
        c, E = make([0.0, 0.0, -8.0]), make([0.0, 1.0, 0.0, -1.0, 0.0, 0.0])
        for _ in range(20):
            predict(x, P, 0.03, 0.02)
            kernel(x, P, make([0.0] * 16), make([0.0] * 28), make([0.0] * 24), c, E, 0.0, 0.02, 0.05, 1e-4, 1e9)
        return [*x, *P]

    plain = [getattr(k, "py_func", k) for k in (update_bearing, predict_constant_velocity)]
    assert run(*plain, list) == pytest.approx(
        run(update_bearing, predict_constant_velocity, room), rel=1e-10, abs=1e-12
    )


def test_a_bearing_above_the_horizon_starts_nothing() -> None:
    m = bearing(still, 0.0, (0.0, 0.0), np.random.default_rng(0), tilt=0.0)
    up = PadMeasurement(t_ns=0, source=m.source, bearing_o=(0.0, 0.0, -1.0), camera=m.camera)
    assert not ESTIMATORS["bearing_ukf"](Estimation()).observe(up).accepted
