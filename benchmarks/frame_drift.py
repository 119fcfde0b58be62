"""How far a pad is off, and how far the estimator says it may be, while it is out of sight and the frame drifts.

    python benchmarks/frame_drift.py [--runs N]

Frame O moves with the autopilot's velocity, whose error wanders. Here it wanders as on the recorded flights (slow part 0.14 and
0.18 m/s over 6 s, quick part 0.05 and 0.17 m/s over 5 s) and the attitude error with it (0.7 degrees over 4 s, 6 m of range). The
pad is seen at 30 Hz with 3 cm noise and one frame in ten lost for 6 s, then not at all; errors are those of pad minus vehicle.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from estimators import PATHS, Path2, sights

from companion.config import Estimation
from companion.estimation import ESTIMATORS
from companion.estimation.measurement import PadMeasurement

Array = npt.NDArray[np.float64]

STEP_S = 0.02
SEE_S = 6.0
AHEAD_S = (0.5, 1.0, 2.0, 5.0, 10.0)
RANGE_M = 6.0
TILT_SIGMA_RAD, TILT_TIME_S = 0.0125, 4.0
VELOCITY_PARTS = (((0.14, 6.0), (0.05, 5.0)), ((0.18, 6.0), (0.17, 5.0)))
"""For north and east: standard deviation in m/s and correlation time in s of the parts that add up."""
SHARED_SIGMA_M = math.radians(1.2) * RANGE_M


def wander(sigma: float, time_s: float, count: int, rng: np.random.Generator) -> Array:
    """(count,) stationary first-order Gauss-Markov process, one value each STEP_S."""
    keep = math.exp(-STEP_S / time_s)
    values = rng.normal(0.0, sigma * math.sqrt(1.0 - keep * keep), count)
    values[0] = rng.normal(0.0, sigma)
    for k in range(1, count):
        values[k] += keep * values[k - 1]
    return values


def frame_errors(seed: int) -> tuple[Array, Array]:
    """(2, count) drift of O in m, north and east, and (2, count) what the attitude error makes of a sight, m."""
    rng, count = np.random.default_rng(seed + 20_000), round((SEE_S + AHEAD_S[-1]) / STEP_S) + 2
    velocity = np.array([sum(wander(*part, count, rng) for part in parts) for parts in VELOCITY_PARTS])
    tilt = np.array([wander(TILT_SIGMA_RAD, TILT_TIME_S, count, rng) for _ in range(2)])
    return np.cumsum(velocity, axis=1) * STEP_S, RANGE_M * tilt


def displaced(m: PadMeasurement, by_m: Array) -> PadMeasurement:
    assert m.position_o_m is not None
    x, y, z = m.position_o_m
    return replace(m, position_o_m=(x + float(by_m[0]), y + float(by_m[1]), z), systematic_sigma_m=SHARED_SIGMA_M)


def blind(path: Path2, seed: int, *, drifts: bool) -> Array:
    """(len(AHEAD_S), 2 axes, 2): error and reported standard deviation, m."""
    drift, attitude = frame_errors(seed)
    if not drifts:
        drift, attitude = np.zeros_like(drift), np.zeros_like(attitude)
    start_s, estimator = 0.73 * seed, ESTIMATORS["imm"](Estimation())
    seen = sights(path, seed, round(SEE_S * 30), start_s=start_s)
    for m in seen:
        k = round((m.t_ns / 1e9 - start_s) / STEP_S)
        estimator.observe(displaced(m, drift[:, k] + attitude[:, k]))
    rows = []
    for ahead_s in AHEAD_S:
        t = seen[-1].t_ns / 1e9 + ahead_s
        estimate = estimator.estimate(round(t * 1e9))
        assert estimate is not None
        truth = np.array(path(t)[:2]) + drift[:, round((t - start_s) / STEP_S)]
        error = np.array(estimate.position_ned_m[:2]) - truth
        sigma = np.sqrt([estimate.covariance[0][0], estimate.covariance[1][1]])
        rows.append(np.stack([error, sigma], axis=1))
    return np.array(rows)


def still(_: float) -> tuple[float, float, float, float, float]:
    return 3.0, -2.0, 0.0, 0.0, 0.4


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--runs", type=int, default=40)
    runs = parser.parse_args().runs
    print(
        "| path | frame | blind s | error rms m | sigma m | within 2 sigma |\n| --- | --- | ---: | ---: | ---: | ---: |"
    )
    for name in ("still", "line", "circle r = 20 m", "figure-8 60 x 24 m"):
        for drifts in (False, True):
            path = still if name == "still" else PATHS[name]
            results = np.array([blind(path, seed, drifts=drifts) for seed in range(runs)])
            for k, ahead_s in enumerate(AHEAD_S):
                error, sigma = results[:, k, :, 0], results[:, k, :, 1]
                within = float(np.mean(np.abs(error) <= 2.0 * sigma))
                rms, said = math.sqrt(float(np.mean(error**2))), math.sqrt(float(np.mean(sigma**2)))
                frame = "drifts" if drifts else "steady"
                print(f"| {name} | {frame} | {ahead_s:g} | {rms:.2f} | {said:.2f} | {100 * within:.0f}% |", flush=True)


if __name__ == "__main__":
    main()
