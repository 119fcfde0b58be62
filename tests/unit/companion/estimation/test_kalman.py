"""The filter arithmetic against dense NumPy."""

import math
from unittest import mock

import numpy as np
import pytest

from companion.estimation import vertical
from companion.estimation.kalman import forget, log_likelihood, scale_state, transform_covariance, update_scalar


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


def test_compiled_and_plain_transforms_agree_to_the_last_bit() -> None:
    """COMPILED_FROM parts the two ways; each is asked directly."""
    from companion.estimation import weaving_turn
    from companion.estimation.kalman import _places, _transformed

    rng = np.random.default_rng(5)
    n = weaving_turn.SIZE
    for _ in range(50):
        root = rng.normal(size=(n, n))
        P = (root @ root.T).ravel().tolist()
        values = rng.normal(size=len(weaving_turn.ROWS)).tolist()
        rows, columns = _places(tuple(weaving_turn.ROWS), tuple(weaving_turn.COLUMNS))
        fast = _transformed(np.array(P), n, rows, columns, np.array(values)).tolist()
        plain = list(P)
        with mock.patch("companion.estimation.kalman.COMPILED", False):
            transform_covariance(plain, n, weaving_turn.ROWS, weaving_turn.COLUMNS, values)
        assert fast == plain


def test_the_height_of_level_ground_is_predicted_with_the_bits_of_the_general_product() -> None:
    P = np.random.default_rng(3).normal(size=9).tolist()
    general = P[:]
    transform_covariance(general, 3, (0, 1, 2), (1, 1, 2), (0.02, -0.1, -0.3))
    assert vertical.transformed(P, 0.02, -0.1, -0.3) == general
