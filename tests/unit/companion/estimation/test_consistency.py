"""Each model on data it fits: errors as large as its covariance says (NEES) and innovations as large as expected (NIS).

The truth is drawn from the model itself: its own prediction of a covariance that was zero is the process noise of that step.
Seeds are fixed; the bands hold 95 % of the means over RUNS independent runs.
"""

import math
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.stats import chi2

from companion.compiled import room
from companion.estimation.bank import Mixture, position_rows, start, update
from companion.estimation.bank_track import VARIANCE_FLOOR_M2
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


@dataclass
class Means:
    nees: float
    nis: float
    states: int
    innovations: int

    def check(self) -> None:
        low, high = chi2.ppf([0.025, 0.975], RUNS * self.states) / RUNS
        assert low <= self.nees <= high
        low, high = chi2.ppf([0.025, 0.975], RUNS * STEPS * self.innovations) / (RUNS * STEPS)
        assert low <= self.nis <= high


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


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.name)
def test_motion_model_is_consistent_on_data_it_fits(model: MotionModel) -> None:
    results = np.array([run_model(model, seed) for seed in range(RUNS)])
    nees, nis = results.mean(axis=0)
    Means(nees, nis, 2 if model.name == "static" else 4, 2).check()


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


def test_oscillator_is_consistent_on_a_swing_it_fits() -> None:
    nees, nis = np.array([run_oscillator(seed) for seed in range(RUNS)]).mean(axis=0)
    Means(nees, nis, 4, 1).check()


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


def test_level_ground_is_consistent_on_a_road_it_fits() -> None:
    nees, nis = np.array([run_ground(seed) for seed in range(RUNS)]).mean(axis=0)
    Means(nees, nis, 2, 1).check()


def run_unicycle(seed: int) -> tuple[float, float]:
    rng = np.random.default_rng(seed)
    q = (1e-4, 1e-3, 0.05, 0.2)
    spread = np.diag([0.1, 0.1, 0.1, 0.02, 0.25])
    x, P = room([0.0, 0.0, 0.0, 0.5, 4.0]), room(spread.ravel().tolist())
    truth = np.array(x) + drawn(rng, spread.ravel().tolist(), 5)
    nis = 0.0
    for _ in range(STEPS):
        moved, noise = room(truth.tolist()), room([0.0] * 25)
        predict_unicycle(moved, noise, room([0.0] * 4), room([0.0] * 25), DT, 0.0, *q)
        truth = np.array(moved) + drawn(rng, list(noise), 5)
        predict_unicycle(x, P, room([0.0] * 4), room([0.0] * 25), DT, 0.0, *q)
        z = truth[:3] + rng.normal(0.0, math.sqrt(R), 3)
        y = z - np.array(x)[:3]
        nis += y @ np.linalg.solve(np.array(P).reshape(5, 5)[:3, :3] + R * np.eye(3), y)
        update_position(x, P, room([0.0] * 5), *z.tolist(), R, R, R)
    e = truth - np.array(x)
    return float(e @ np.linalg.solve(np.array(P).reshape(5, 5), e)), nis / STEPS


def test_unicycle_is_consistent_on_data_it_fits() -> None:
    nees, nis = np.array([run_unicycle(seed) for seed in range(RUNS)]).mean(axis=0)
    Means(nees, nis, 5, 3).check()


def test_the_noise_floor_is_small_beside_the_cameras() -> None:
    assert VARIANCE_FLOOR_M2 <= 0.12 * R
