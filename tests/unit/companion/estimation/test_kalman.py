"""The filter arithmetic against dense NumPy."""

import math

import numpy as np
import pytest

from companion.estimation import bank, vertical
from companion.estimation.constant_acceleration import ConstantAcceleration
from companion.estimation.constant_velocity import ConstantVelocity
from companion.estimation.coordinated_turn import CoordinatedTurn
from companion.estimation.kalman import forget, log_likelihood, scale_state, transform_covariance, update_scalar
from companion.estimation.motion import SHARED, Motion
from companion.estimation.weaving_turn import WeavingTurn

STILL = Motion((0.0, 0.0), 0.0)


def covariance(n: int, seed: int) -> np.ndarray:
    A = np.random.default_rng(seed).normal(size=(n, n))
    return A @ A.T + np.eye(n)


def test_update_halves_a_variance_when_the_measurement_is_as_good_as_the_state() -> None:
    x, P = [0.0], [4.0]
    S = update_scalar(x, P, 1, (0,), (1.0,), 2.0, 4.0, [0.0])
    assert (x, P, S) == ([1.0], [2.0], 8.0)


def test_update_agrees_with_the_dense_equations() -> None:
    P0, h = covariance(5, 1), np.array([0.0, 1.0, 0.0, -0.5, 0.0])
    x, P = [0.1 * i for i in range(5)], P0.ravel().tolist()
    update_scalar(x, P, 5, (1, 3), (1.0, -0.5), 0.7, 0.2, [0.0] * 5)
    K = P0 @ h / (h @ P0 @ h + 0.2)
    assert x == pytest.approx([0.1 * i + K[i] * 0.7 for i in range(5)])
    assert np.array(P).reshape(5, 5) == pytest.approx(P0 - np.outer(K, h @ P0))


def test_transform_agrees_with_the_dense_product() -> None:
    P0, F = covariance(4, 2), np.eye(4)
    F[0, 2], F[1, 3], F[2, 2] = 0.1, -0.3, 0.9
    P = P0.ravel().tolist()
    transform_covariance(P, 4, (0, 1, 2), (2, 3, 2), (0.1, -0.3, -0.1))
    assert np.array(P).reshape(4, 4) == pytest.approx(F @ P0 @ F.T)


def test_scale_and_forget_act_on_one_state() -> None:
    P0, F = covariance(3, 3), np.diag([1.0, 0.5, 1.0])
    P = P0.ravel().tolist()
    scale_state(P, 3, 1, 0.5)
    assert np.array(P).reshape(3, 3) == pytest.approx(F @ P0 @ F)
    forget(P, 3, 1, 7.0)
    assert P[3:6] == [0.0, 7.0, 0.0]
    assert P[8] == P0[2, 2]


def test_likelihood_is_that_of_the_normal_density() -> None:
    assert log_likelihood(0.5, 2.0) == pytest.approx(math.log(math.exp(-0.0625) / math.sqrt(4.0 * math.pi)))


MODELS = (ConstantVelocity(), ConstantAcceleration(), CoordinatedTurn(), WeavingTurn())


def worked_on(seed: int, *, as_lists: bool) -> list[bank.Member]:
    """A bank that has predicted, mixed and fused for a while; its covariances as `room` gives them, or as lists."""
    rng = np.random.default_rng(seed)
    shared = bank.Mixture(rng.normal(size=SHARED).tolist(), covariance(SHARED, seed).ravel().tolist(), STILL)
    members = bank.start(MODELS, (0.4, 0.3, 0.2, 0.1), shared)
    if as_lists:
        members = [bank.Member(m.model, m.x, list(map(float, m.P)), m.probability) for m in members]
    for _ in range(20):
        bank.predict(members, float(rng.uniform(0.0, 0.3)))
        bank.mix(members, 0.1, 4.0)
        rows = bank.position_rows(tuple(rng.normal(size=2)), (0.1, 0.2))  # type: ignore[arg-type]
        bank.update(members, bank.decorrelated(*rows, 0.05))
        for member in members:
            if member.model.turn_index is not None:
                bank.update_own(member, member.model.turn_index, float(rng.normal()), 0.3)
    return members


@pytest.mark.parametrize("seed", range(5))
def test_machine_code_and_plain_lists_agree_to_the_last_bit(seed: int) -> None:
    fast, plain = worked_on(seed, as_lists=False), worked_on(seed, as_lists=True)
    for one, other in zip(fast, plain, strict=True):
        assert one.x == other.x
        assert list(one.P) == other.P
        assert one.probability == other.probability
    assert bank.combined(fast) == bank.combined(plain)


def test_the_height_of_level_ground_is_predicted_with_the_bits_of_the_general_product() -> None:
    P = np.random.default_rng(3).normal(size=9).tolist()
    general = P[:]
    transform_covariance(general, 3, (0, 1, 2), (1, 1, 2), (0.02, -0.1, -0.3))
    assert vertical.transformed(P, 0.02, -0.1, -0.3) == general
