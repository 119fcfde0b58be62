"""How far the estimators' own uncertainty is true: NEES and NIS, with the bands that hold 95 % of such means where it is.

    python benchmarks/consistency.py [--runs N]

First each model on data it fits, drawn from the model itself: its own prediction of a covariance that was zero is the process noise of
that step (seeds 0 to 59; tests/unit/companion/estimation/test_consistency.py holds it). Then whole estimators on paths that none of
them is a model of: seen at 30 Hz with 3 cm of noise and one frame in ten lost for 6 s at 4.2 m/s, NIS from 2 s on.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from estimators import DT as FRAME_S
from estimators import PATHS, Path2, sights
from scipy.stats import chi2

from companion.compiled import room
from companion.config import Estimation
from companion.estimation import ESTIMATORS
from companion.estimation.bank import Mixture, position_rows, start, update
from companion.estimation.bearing_ukf import predict_constant_velocity, update_bearing
from companion.estimation.constant_acceleration import ConstantAcceleration
from companion.estimation.constant_velocity import ConstantVelocity
from companion.estimation.coordinated_turn import CoordinatedTurn
from companion.estimation.motion import SHARED, VX, VY, Motion, MotionModel
from companion.estimation.oscillator import Oscillator
from companion.estimation.static import Static
from companion.estimation.unicycle import predict_unicycle, update_position
from companion.estimation.vertical import LevelGround
from companion.estimation.weaving_turn import WeavingTurn

RUNS = 60
STEPS = 60
DT = 1.0 / 30.0
R = 0.03**2

MODELS: list[MotionModel] = [
    Static(),
    ConstantVelocity(0.01),
    ConstantAcceleration(),
    CoordinatedTurn(),
    WeavingTurn(turn_psd=0.02),
]


@dataclass(frozen=True)
class Fit:
    """Means over the runs, with how many numbers each sums over in a run (NEES) and in a step (NIS, 0: not measured)."""

    name: str
    nees: float
    nis: float
    states: int
    innovations: int
    runs: int = RUNS

    def nees_band(self) -> tuple[float, float]:
        """The middle 95 % of the mean where the covariance is right."""
        return band(self.states, self.runs)

    def nis_band(self) -> tuple[float, float]:
        return band(self.innovations, self.runs * STEPS)

    def is_consistent(self) -> bool:
        checks = [(self.nees, self.nees_band())] + ([(self.nis, self.nis_band())] if self.innovations else [])
        return all(low <= value <= high for value, (low, high) in checks)


def band(degrees: int, count: int) -> tuple[float, float]:
    low, high = (float(chi2.ppf(p, count * degrees)) / count for p in (0.025, 0.975))
    return low, high


def drawn(rng: np.random.Generator, P: list[float], n: int) -> np.ndarray:
    """A sample of N(0, P), also where P is singular."""
    values, vectors = np.linalg.eigh(np.array(P).reshape(n, n))
    return vectors @ (np.sqrt(np.clip(values, 0.0, None)) * rng.normal(size=n))


def first_state(speed_m_s: float) -> Mixture:
    P = np.diag([0.1, 0.1, 2.25, 2.25, speed_m_s**2, speed_m_s**2]).ravel().tolist()
    return Mixture([0.0] * SHARED, P, Motion((0.0, 0.0), 0.0))


def run_model(model: MotionModel, seed: int) -> tuple[float, float]:
    rng = np.random.default_rng(seed)
    speed = 1e-3 if model.name == "static" else 1.0
    shared = first_state(speed)
    if model.name != "static":
        shared.x[VX] = 4.0
    (member,) = start((model,), (1.0,), shared)
    n = model.size
    truth = (np.array(member.x) + drawn(rng, member.P, n)).tolist()
    nis = 0.0
    for _ in range(STEPS):
        noise = [0.0] * (n * n)
        model.predict(truth, noise, DT)
        truth = (np.array(truth) + drawn(rng, noise, n)).tolist()
        model.predict(member.x, member.P, DT)
        z = (truth[0] + rng.normal(0.0, math.sqrt(R)), truth[1] + rng.normal(0.0, math.sqrt(R)))
        y = np.array([z[0] - member.x[0], z[1] - member.x[1]])
        P = np.array(member.P).reshape(n, n)
        nis += y @ np.linalg.solve(P[:2, :2] + R * np.eye(2), y)
        update((member,), position_rows(z, (R, R)))
    states = [0, 1] if model.name == "static" else [0, 1, VX, VY]
    e = (np.array(truth) - np.array(member.x))[states]
    P = np.array(member.P).reshape(n, n)[np.ix_(states, states)]
    return float(e @ np.linalg.solve(P, e)), nis / STEPS


def run_oscillator(seed: int) -> tuple[float, float]:
    rng = np.random.default_rng(seed)
    model = Oscillator(frequency_sigma_rad_s=0.1, frequency_psd=1e-6)
    x, P = model.start(0.0, 0.0)
    truth = (np.array(x) + drawn(rng, P, 4)).tolist()
    nis = 0.0
    for _ in range(STEPS):
        noise = [0.0] * 16
        model.predict(truth, noise, DT)
        truth = (np.array(truth) + drawn(rng, noise, 4)).tolist()
        model.predict(x, P, DT)
        z = truth[0] + truth[1] + rng.normal(0.0, math.sqrt(R))
        nis += (z - x[0] - x[1]) ** 2 / (model.variance(P) + R)
        model.update(x, P, z, R)
    e = np.array(truth) - np.array(x)
    return float(e @ np.linalg.solve(np.array(P).reshape(4, 4), e)), nis / STEPS


def run_ground(seed: int) -> tuple[float, float]:
    rng = np.random.default_rng(seed)
    model = LevelGround()
    state = model.start(0.0, 0.04, 0.0)
    truth = (np.array(state[0]) + drawn(rng, state[1], 3)).tolist()
    nis = 0.0
    for _ in range(STEPS):
        noise = (truth, [0.0] * 9)
        model.predict(noise, DT)
        truth = (np.array(truth) + drawn(rng, noise[1], 3)).tolist()
        model.predict(state, DT)
        z = truth[0] + rng.normal(0.0, math.sqrt(R))
        y, S = model.innovation(state, z, R, biased=False)
        nis += y * y / S
        model.update(state, z, R, biased=False)
    e = (np.array(truth) - np.array(state[0]))[:2]
    P = np.array(state[1]).reshape(3, 3)[:2, :2]
    return float(e @ np.linalg.solve(P, e)), nis / STEPS


def fit_of(
    name: str, run: Callable[[int], tuple[float, float]], states: int, innovations: int, runs: int = RUNS
) -> Fit:
    nees, nis = np.array([run(seed) for seed in range(runs)]).mean(axis=0).tolist()
    return Fit(name, nees, nis, states, innovations, runs)


def run_unicycle(seed: int) -> tuple[float, float]:
    rng = np.random.default_rng(seed)
    q = (1e-4, 1e-3, 0.05, 0.2)
    spread = np.diag([0.1, 0.1, 0.1, 0.02, 0.25])
    x, P = room([0.0, 0.0, 0.0, 0.5, 4.0]), room(spread.ravel().tolist())
    truth = np.array(x) + drawn(rng, spread.ravel().tolist(), 5)
    nis = 0.0
    for _ in range(STEPS):
        moved, noise = room(truth.tolist()), room([0.0] * 25)
        predict_unicycle(moved, noise, DT, 0.0, *q)
        truth = np.array(moved) + drawn(rng, list(noise), 5)
        predict_unicycle(x, P, DT, 0.0, *q)
        z = truth[:3] + rng.normal(0.0, math.sqrt(R), 3)
        y = z - np.array(x)[:3]
        nis += y @ np.linalg.solve(np.array(P).reshape(5, 5)[:3, :3] + R * np.eye(3), y)
        update_position(x, P, *z.tolist(), R, R, R)
    e = truth - np.array(x)
    return float(e @ np.linalg.solve(np.array(P).reshape(5, 5), e)), nis / STEPS


HEIGHT_M = 6.0


def run_bearing(seed: int) -> tuple[float, float]:
    """Four states after 3 s; the attitude error is drawn anew with each frame, as the filter assumes. NIS is not read."""
    rng = np.random.default_rng(seed)
    begin, v = rng.normal(0.0, 2.0, 2), rng.normal(0.0, 1.0, 2)
    x, P = room([0.0, 0.0, 0.0, 0.0]), room(np.diag([4.0, 4.0, 1.0, 1.0]).ravel().tolist())
    c, t = (3.0, -2.0, -HEIGHT_M), 0.0
    for k in range(90):
        t = k * FRAME_S
        predict_constant_velocity(x, P, FRAME_S if k else 0.0, 1e-6)
        d = np.array([begin[0] + v[0] * t - c[0], begin[1] + v[1] * t - c[1], HEIGHT_M])
        tilted = d - np.cross(np.array([*rng.normal(0.0, 0.02, 2), rng.normal(0.0, 0.03)]), d)
        u = _unit(tilted / np.linalg.norm(tilted) + rng.normal(0.0, 0.004, 2) @ _across(tilted))
        work = room([0.0] * 16), room([0.0] * 28), room([0.0] * 24)
        update_bearing(x, P, *work, room(list(c)), room(_across(u).ravel().tolist()), 0.0, 0.02, 0.03, 0.004**2, 1e9)
    e = np.array([begin[0] + v[0] * t, begin[1] + v[1] * t, *v]) - np.array(x)
    return float(e @ np.linalg.solve(np.array(P).reshape(4, 4), e)), 0.0


def _unit(v: Any) -> Any:
    return v / np.linalg.norm(v)


def _across(v: Any) -> Any:
    """(2, 3) unit vectors across `v` and each other."""
    first = _unit(np.cross(_unit(v), [1.0, 0.0, 0.0]))
    return np.stack([first, np.cross(_unit(v), first)])


def model_fit(model: MotionModel) -> Fit:
    return fit_of(model.name, partial(run_model, model), 2 if model.name == "static" else 4, 2)


def fits() -> list[Fit]:
    """Every model on data it fits."""
    return [
        *(model_fit(model) for model in MODELS),
        fit_of("unicycle", run_unicycle, 5, 3),
        fit_of("bearing_ukf", run_bearing, 4, 0, 40),
        fit_of("oscillator (boat: heave, roll, pitch)", run_oscillator, 4, 1),
        fit_of("level ground (height)", run_ground, 2, 1),
    ]


def followed(name: str, path: Path2, seed: int) -> tuple[float, float, float]:
    """NEES of the horizontal position at the last sight, mean NIS of north, east and down, share of sights not fused whole."""
    estimator, start_s = ESTIMATORS[name](Estimation()), 0.73 * seed
    nis, refused = [], []
    for m in sights(path, seed, 180, start_s=start_s):
        verdict = estimator.observe(m)
        if m.t_ns / 1e9 >= start_s + 2.0:
            refused.append(verdict.reason != "fused")
            nis.append(verdict.nis if verdict.nis is not None else math.nan)
    estimate = estimator.estimate(m.t_ns)
    assert estimate is not None
    x, y, *_ = path(m.t_ns / 1e9)
    e = np.array([estimate.position_ned_m[0] - x, estimate.position_ned_m[1] - y])
    P = np.array([row[:2] for row in estimate.covariance[:2]])
    return float(e @ np.linalg.solve(P, e)), float(np.mean(nis)), float(np.mean(refused))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--runs", type=int, default=20, help="of each estimator on each path")
    runs = parser.parse_args().runs
    print("| model | NEES | 95 % band | NIS | 95 % band | inside |\n| --- | ---: | --- | ---: | --- | --- |")
    for fit in fits():
        told = "{:.2f} to {:.2f}".format(*fit.nees_band())
        nis = f"{fit.nis:.2f} | " + "{:.2f} to {:.2f}".format(*fit.nis_band()) if fit.innovations else "- | -"
        print(
            f"| {fit.name} | {fit.nees:.2f} | {told} | {nis} | {'yes' if fit.is_consistent() else 'no'} |", flush=True
        )
    low, high = band(2, runs)
    print(
        f"\n{runs} runs; NEES of 2 states, band {low:.2f} to {high:.2f}; NIS of 3 components, 3 where the covariance is right\n"
    )
    print("| estimator | path | NEES | NIS | not fused whole |\n| --- | --- | ---: | ---: | ---: |")
    for name in (
        "imm",
        "constant_velocity",
        "constant_acceleration",
        "coordinated_turn",
        "weaving_turn",
        "unicycle_turn",
    ):
        for path in ("line", "circle r = 20 m", "circle r = 5 m", "figure-8 60 x 24 m"):
            results = np.array([followed(name, PATHS[path], seed) for seed in range(runs)])
            nees, nis, refused = results.mean(axis=0).tolist()
            print(f"| {name} | {path} | {nees:.3g} | {nis:.3g} | {100 * refused:.0f}% |", flush=True)


if __name__ == "__main__":
    main()
