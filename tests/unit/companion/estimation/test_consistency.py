"""Each model on data it fits: errors as large as its covariance says (NEES) and innovations as large as expected (NIS).

The same runs as the table of docs/estimation.md (benchmarks/consistency.py): seeds are fixed, the bands hold 95 % of the means.
"""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[4] / "benchmarks"))

import consistency

from companion.estimation.bank_track import VARIANCE_FLOOR_M2
from companion.estimation.motion import MotionModel


@pytest.mark.parametrize("model", consistency.MODELS, ids=lambda model: model.name)
def test_motion_model_is_consistent_on_data_it_fits(model: MotionModel) -> None:
    assert consistency.model_fit(model).is_consistent()


def test_oscillator_is_consistent_on_a_swing_it_fits() -> None:
    assert consistency.fit_of("oscillator", consistency.run_oscillator, 4, 1).is_consistent()


def test_level_ground_is_consistent_on_a_road_it_fits() -> None:
    assert consistency.fit_of("level ground", consistency.run_ground, 2, 1).is_consistent()


def test_unicycle_is_consistent_on_data_it_fits() -> None:
    assert consistency.fit_of("unicycle", consistency.run_unicycle, 5, 3).is_consistent()


def test_bearing_filter_is_consistent_under_the_attitude_error_it_assumes() -> None:
    assert consistency.fit_of("bearing_ukf", consistency.run_bearing, 4, 0, 40).is_consistent()


def test_the_noise_floor_is_small_beside_the_cameras() -> None:
    assert VARIANCE_FLOOR_M2 <= 0.12 * consistency.R
