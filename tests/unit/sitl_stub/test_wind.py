"""Wind: the mean's profile and the gusts' statistics."""

from math import pi

import numpy as np
import pytest

from sitl_stub.wind import dryden_wind, gust_lengths_m, profile, steady_wind, still_air


def _gusts(seconds: float, height_m: float, seed: int = 1) -> np.ndarray:
    wind = dryden_wind(8.0, 0.0, 1.0, 0.5, np.random.default_rng(seed))
    return np.array([wind.step(0.02, height_m) for _ in range(int(seconds / 0.02))])


def test_wind_from_the_east_blows_west() -> None:
    assert steady_wind(5.0, pi / 2).step(0.004, 6.096) == pytest.approx((0.0, -5.0, 0.0))


def test_mean_grows_with_height_and_is_as_given_at_six_metres() -> None:
    assert profile(6.096) == pytest.approx(1.0)
    assert 0.4 < profile(0.5) < profile(2.0) < 1.0 < profile(30.0) < 1.5
    assert profile(-1.0) == profile(0.5)


def test_gusts_have_the_sigmas_that_were_asked_for() -> None:
    wind = _gusts(6000.0, 6.096)
    assert wind.std(axis=0) == pytest.approx([1.0, 1.0, 0.5], rel=0.12)
    assert wind.mean(axis=0) == pytest.approx([-8.0, 0.0, 0.0], abs=0.25)


def test_gusts_are_correlated_over_length_divided_by_speed() -> None:
    u = _gusts(6000.0, 6.096)[:, 0]
    u = u - u.mean()
    steps = round(gust_lengths_m(6.096)[0] / 8.0 / 0.02)
    assert np.mean(u[steps:] * u[:-steps]) / np.mean(u * u) == pytest.approx(np.exp(-1.0), abs=0.12)


def test_gusts_are_held_for_twenty_milliseconds() -> None:
    wind = dryden_wind(3.0, 0.0, 1.0, 0.5, np.random.default_rng(0))
    values = [wind.step(0.004, 5.0) for _ in range(11)]
    assert len(set(values)) == 3


def test_same_seed_same_wind() -> None:
    assert np.array_equal(_gusts(5.0, 3.0), _gusts(5.0, 3.0))
    assert not np.array_equal(_gusts(5.0, 3.0), _gusts(5.0, 3.0, seed=2))


def test_still_air_is_still() -> None:
    assert still_air().step(0.004, 100.0) == (0.0, 0.0, 0.0)
