"""Cost of the estimators beside filterpy's in one run, and how far a pad is off after two seconds without sight.

    python benchmarks/estimators.py [--runs N] [--json FILE]

Times are medians of one process on one core; compare the ratios, not machines. Accuracy: a pad seen at 30 Hz with 3 cm noise and
one frame in ten lost for 6 s, then not at all; position error 2 s later over N seeded runs and places on the path.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from companion.compiled import COMPILED
from companion.config import Estimation
from companion.estimation import ESTIMATORS
from companion.estimation.bearing_ukf import predict_constant_velocity, update_bearing
from companion.estimation.measurement import PadMeasurement
from companion.estimation.protocol import PadEstimator
from companion.estimation.unicycle import predict_unicycle, update_position
from companion.messages import ObservationSource

DT = 1.0 / 30.0
SPEED_M_S = 4.2
LOST_FRAMES = 0.1
STEPS = 2000
Step = Callable[[], object]
Path2 = Callable[[float], tuple[float, float, float, float, float]]


# ----------------------------------------------------------------------------------------------------------------- cost


def median_us(step: Step, steps: int = STEPS) -> float:
    for _ in range(20):
        step()
    times = []
    for _ in range(steps):
        begin = time.perf_counter_ns()
        step()
        times.append(time.perf_counter_ns() - begin)
    return statistics.median(times) / 1000.0


def filterpy_ekf() -> Step:
    """The unicycle of Falanga et al. in filterpy: 5 states, 3-D position."""
    from filterpy.kalman import ExtendedKalmanFilter

    ekf = ExtendedKalmanFilter(dim_x=5, dim_z=3)
    ekf.x, ekf.R, ekf.Q = np.array([0.0, 0.0, 0.0, 0.3, 1.0]), np.eye(3) * 1e-3, np.eye(5) * 1e-3
    H, F, z = np.hstack([np.eye(3), np.zeros((3, 2))]), np.eye(5), np.zeros(3)

    def step() -> None:
        theta, v = ekf.x[3], ekf.x[4]
        c, s = math.cos(theta), math.sin(theta)
        F[0, 3], F[0, 4], F[1, 3], F[1, 4] = -DT * v * s, DT * c, DT * v * c, DT * s
        ekf.F = F
        position = ekf.x[:2] + DT * v * np.array([c, s])
        ekf.predict()
        ekf.x[:2] = position
        z[:2] = position
        ekf.update(z, lambda _: H, lambda x: x[:3])

    return step


def own_ekf(*, plain: bool) -> Step:
    predict = getattr(predict_unicycle, "py_func", predict_unicycle) if plain else predict_unicycle
    update = getattr(update_position, "py_func", update_position) if plain else update_position
    room = list if plain or not COMPILED else np.array
    x, P = room([0.0, 0.0, 0.0, 0.3, 1.0]), room([float(i % 6 == 0) for i in range(25)])

    def step() -> None:
        predict(x, P, DT, 0.0, 1e-4, 1e-3, 0.05, 0.2)
        update(x, P, x[0], x[1], 0.0, 1e-3, 1e-3, 1e-3)

    return step


def filterpy_ukf() -> Step:
    """Seven states, as in Kim et al.: pad, its velocity, three angles; a bearing as two numbers."""
    from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

    def move(x: np.ndarray, dt: float) -> np.ndarray:
        return np.array([x[0] + dt * x[2], x[1] + dt * x[3], x[2], x[3], 0.0, 0.0, 0.0])

    def look(x: np.ndarray) -> np.ndarray:
        dx, dy, dz = x[0] + x[5] * 8.0 - x[6] * x[1], x[1] + x[6] * x[0] - x[4] * 8.0, 8.0 + x[4] * x[1] - x[5] * x[0]
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        return np.array([dx / length, dy / length])

    points = MerweScaledSigmaPoints(7, alpha=0.5, beta=2.0, kappa=0.0)
    ukf = UnscentedKalmanFilter(dim_x=7, dim_z=2, dt=DT, hx=look, fx=move, points=points)
    ukf.x, ukf.R = np.array([1.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0]), np.eye(2) * 1e-4
    ukf.Q = np.diag([1e-4, 1e-4, 1e-3, 1e-3, 4e-4, 4e-4, 3e-3])
    z = look(ukf.x)

    def step() -> None:
        ukf.predict()
        ukf.update(z)

    return step


def own_ukf(*, plain: bool) -> Step:
    predict = (
        getattr(predict_constant_velocity, "py_func", predict_constant_velocity) if plain else predict_constant_velocity
    )
    update = getattr(update_bearing, "py_func", update_bearing) if plain else update_bearing
    room = list if plain or not COMPILED else np.array
    x, P = room([1.0, 0.5, 0.0, 0.0]), room([float(i % 5 == 0) for i in range(16)])
    L, Z, S = room([0.0] * 16), room([0.0] * 28), room([0.0] * 24)
    length = math.sqrt(1.25 + 64.0)
    b = (1.0 / length, 0.5 / length, 8.0 / length)
    first = (0.0, b[2] / math.hypot(b[1], b[2]), -b[1] / math.hypot(b[1], b[2]))
    second = (b[1] * first[2] - b[2] * first[1], b[2] * first[0] - b[0] * first[2], b[0] * first[1] - b[1] * first[0])
    c, E = room([0.0, 0.0, -8.0]), room([*first, *second])

    def step() -> None:
        predict(x, P, DT, 0.02)
        update(x, P, L, Z, S, c, E, 0.0, 0.02, 0.05, 1e-4, 1e9)

    return step


def estimator_step(name: str) -> Step:
    """One vision measurement through the whole estimator: history, gates, fusion."""
    estimator = ESTIMATORS[name](Estimation())
    measurements = iter(sights(circle(10.0), 0, 2 * STEPS))
    return lambda: estimator.observe(next(measurements))


def query_step(name: str) -> Step:
    """One question 50 ms ahead of the last measurement, never the same one twice."""
    estimator = ESTIMATORS[name](Estimation())
    for measurement in sights(circle(10.0), 0, 90):
        estimator.observe(measurement)
    t_ns = itertools.count(round((90 * DT + 0.05) * 1e9))
    return lambda: estimator.estimate(next(t_ns))


def cost_rows() -> list[tuple[str, float, str]]:
    ekf, ukf = median_us(filterpy_ekf()), median_us(filterpy_ukf(), 500)
    rows = [("filterpy EKF, 5 states, 3-D position", ekf, "1.0")]
    rows += _against("unicycle EKF", ekf, own_ekf)
    rows += [("filterpy UKF, 7 states, bearing", ukf, "1.0")]
    rows += _against("bearing UKF", ukf, own_ukf)
    rows += [
        (f"estimator {name}: fuse one sight", median_us(estimator_step(name), 1000), "")
        for name in ("constant_velocity", "imm")
    ]
    rows += [("estimator imm: estimate at a time", median_us(query_step("imm"), 500), "")]
    return rows


def _against(name: str, reference: float, make: Callable[..., Step]) -> list[tuple[str, float, str]]:
    rows = [(f"{name}, plain Python", median_us(make(plain=True), 500), "")]
    if COMPILED:
        rows.append((f"{name}, extra `fast`", median_us(make(plain=False)), ""))
    return [(label, us, f"{reference / us:.1f}") for label, us, _ in rows]


# ------------------------------------------------------------------------------------------------------------- accuracy


def line(t: float) -> tuple[float, float, float, float, float]:
    return (0.8 * SPEED_M_S * t, 0.6 * SPEED_M_S * t, 0.8 * SPEED_M_S, 0.6 * SPEED_M_S, math.atan2(0.6, 0.8))


def circle(radius_m: float) -> Path2:
    w = SPEED_M_S / radius_m

    def at(t: float) -> tuple[float, float, float, float, float]:
        return (
            radius_m * math.sin(w * t), radius_m * (1.0 - math.cos(w * t)),
            SPEED_M_S * math.cos(w * t), SPEED_M_S * math.sin(w * t), w * t,
        )  # fmt: skip

    return at


def figure_8(half_length_m: float, half_width_m: float) -> Path2:
    """Gerono's lemniscate run with a steady parameter: fastest, 4.2 m/s, at the crossing."""
    a, b = half_length_m, half_width_m
    w = SPEED_M_S / math.hypot(a, 2.0 * b)

    def at(t: float) -> tuple[float, float, float, float, float]:
        vx, vy = a * w * math.cos(w * t), 2.0 * b * w * math.cos(2.0 * w * t)
        return a * math.sin(w * t), b * math.sin(2.0 * w * t), vx, vy, math.atan2(vy, vx)

    return at


PATHS: dict[str, Path2] = {
    "line": line,
    "circle r = 5 m": circle(5.0),
    "circle r = 20 m": circle(20.0),
    "figure-8 20 x 10 m": figure_8(10.0, 5.0),
    "figure-8 60 x 24 m": figure_8(30.0, 12.0),
}


def sights(path: Path2, seed: int, count: int, *, start_s: float = 0.0, sigma_m: float = 0.03) -> list[PadMeasurement]:
    rng = np.random.default_rng(seed)
    seen = [k for k in range(count) if rng.random() >= LOST_FRAMES]
    return [_sight(path, start_s + k * DT, sigma_m, rng) for k in seen]


def _sight(path: Path2, t: float, sigma_m: float, rng: np.random.Generator) -> PadMeasurement:
    x, y, _, _, yaw = path(t)
    noise = rng.normal(0.0, sigma_m, 3)
    v = sigma_m**2
    return PadMeasurement(
        t_ns=round(t * 1e9), source=ObservationSource.VISION_POSE,
        position_o_m=(x + float(noise[0]), y + float(noise[1]), float(noise[2])),
        covariance_m2=((v, 0.0, 0.0), (0.0, v, 0.0), (0.0, 0.0, v)),
        yaw_rad=yaw + float(rng.normal(0.0, 0.02)), yaw_sigma_rad=0.02,
    )  # fmt: skip


def _beacon(path: Path2, t: float, bias: tuple[float, float], rng: np.random.Generator) -> PadMeasurement:
    x, y, vx, vy, _ = path(t)
    noise, slip = rng.normal(0.0, 0.05, 2), rng.normal(0.0, 0.1, 2)
    return PadMeasurement(
        t_ns=round(t * 1e9), source=ObservationSource.BEACON,
        position_o_m=(x + bias[0] + float(noise[0]), y + bias[1] + float(noise[1]), 0.0),
        covariance_m2=((0.01, 0.0, 0.0), (0.0, 0.01, 0.0), (0.0, 0.0, 4.0)), bias_sigma_m=1.5,
        velocity_m_s=(vx + float(slip[0]), vy + float(slip[1]), 0.0), velocity_sigma_m_s=0.15,
    )  # fmt: skip


def blind_error_m(path: Path2, seed: int, *, beacon: bool, see_s: float = 6.0, blind_s: float = 2.0) -> float:
    """Horizontal error after `blind_s` without sight; with `beacon` its 5 Hz go on, with a wandering bias."""
    rng = np.random.default_rng(seed + 10_000)
    start_s = 0.73 * seed
    events = sights(path, seed, round(see_s / DT), start_s=start_s)
    if beacon:
        bias = tuple(rng.normal(0.0, 1.06, 2).tolist())
        for k in range(round((see_s + blind_s) * 5)):
            bias = (bias[0] + float(rng.normal(0.0, 0.087)), bias[1] + float(rng.normal(0.0, 0.087)))
            events.append(_beacon(path, start_s + 0.013 + 0.2 * k, bias, rng))
    estimator: PadEstimator = ESTIMATORS["imm"](Estimation())
    for measurement in sorted(events, key=lambda m: m.t_ns):
        estimator.observe(measurement)
    t = start_s + see_s - DT + blind_s
    estimate = estimator.estimate(round(t * 1e9))
    assert estimate is not None
    x, y, *_ = path(t)
    return math.hypot(estimate.position_ned_m[0] - x, estimate.position_ned_m[1] - y)


def slowed(path: Path2, factor: float) -> Path2:
    """The same way at a fraction of the speed."""

    def at(t: float) -> tuple[float, float, float, float, float]:
        x, y, vx, vy, yaw = path(factor * t)
        return x, y, factor * vx, factor * vy, yaw

    return at


def late_error_m(path: Path2, seed: int, spread_s: float) -> float:
    """RMS error of the pad now, asked at 50 Hz from 4 s to 12 s, when each sight comes by a drawn time late, up to `spread_s`."""
    start_s, rng = 0.73 * seed, np.random.default_rng(seed + 30_000)
    events = [(m.t_ns + round(1e9 * rng.uniform(0.0, spread_s)), m) for m in sights(path, seed, 360, start_s=start_s)]
    events.sort(key=lambda event: event[0])
    estimator, squares, waiting = ESTIMATORS["imm"](Estimation()), [], iter(events)
    due = next(waiting, None)
    for k in range(600):
        t = start_s + 0.02 * k
        while due is not None and due[0] <= round(t * 1e9):
            estimator.observe(due[1])
            due = next(waiting, None)
        estimate = estimator.estimate(round(t * 1e9))
        if k >= 200 and estimate is not None:
            x, y, *_ = path(t)
            squares.append((estimate.position_ned_m[0] - x) ** 2 + (estimate.position_ned_m[1] - y) ** 2)
    return math.sqrt(float(np.mean(squares)))


def delay_rows(runs: int) -> list[tuple[str, float, float, float]]:
    rows = []
    for name in ("line", "circle r = 20 m", "figure-8 60 x 24 m"):
        for speed_m_s in (2.0, SPEED_M_S):
            path = slowed(PATHS[name], speed_m_s / SPEED_M_S)
            prompt, late = (
                float(np.mean([late_error_m(path, seed, spread_s) for seed in range(runs)])) for spread_s in (0.0, 0.5)
            )
            rows.append((name, speed_m_s, prompt, late))
    return rows


def accuracy_rows(runs: int) -> list[tuple[str, str, float, float]]:
    rows = []
    for name, path in PATHS.items():
        for beacon in (False, True):
            errors = [blind_error_m(path, seed, beacon=beacon) for seed in range(runs)]
            p50, p95 = np.percentile(errors, [50, 95]).tolist()
            rows.append((name, "5 Hz beacon" if beacon else "nothing", p50, p95))
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    costs = cost_rows()
    print("| step | us | times filterpy |\n| --- | ---: | ---: |")
    for name, us, ratio in costs:
        print(f"| {name} | {us:.1f} | {ratio} |")
    accuracy = accuracy_rows(arguments.runs)
    print(f"\n{SPEED_M_S} m/s, 2 s without sight, {arguments.runs} runs each\n")
    print("| path | what remains | median m | p95 m |\n| --- | --- | ---: | ---: |")
    for name, rest, p50, p95 in accuracy:
        print(f"| {name} | {rest} | {p50:.2f} | {p95:.2f} |")
    few = min(arguments.runs, 10)
    print(f"\nsights that come uniformly 0 to 500 ms late, {few} runs each\n")
    print("| path | m/s | prompt: rms m | late: rms m |\n| --- | ---: | ---: | ---: |")
    for name, speed_m_s, prompt, late in delay_rows(few):
        print(f"| {name} | {speed_m_s:g} | {prompt:.3f} | {late:.3f} |", flush=True)
    if arguments.json is not None:
        arguments.json.write_text(json.dumps({"cost": costs, "blind": accuracy}, indent=1))


if __name__ == "__main__":
    main()
