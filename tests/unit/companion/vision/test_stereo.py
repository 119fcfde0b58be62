"""Range from two cameras, and when it is better than from one."""

from __future__ import annotations

import numpy as np
import pytest

from companion.vision.pinhole import Pinhole
from companion.vision.stereo import Range, less_uncertain, pnp_range, stereo_range

LENS = Pinhole(width_px=848, height_px=480, fx_px=422.27, fy_px=422.88, cx_px=425.83, cy_px=239.86)
BASELINE_M = 0.05
MARKER = np.array([(-0.2, -0.2, 0.0), (0.2, -0.2, 0.0), (0.2, 0.2, 0.0), (-0.2, 0.2, 0.0)])


def corners(range_m: float) -> tuple[np.ndarray, np.ndarray]:
    left = MARKER + [0.1, 0.05, range_m]
    return LENS.project(left), LENS.project(left - [BASELINE_M, 0.0, 0.0])


def measured(range_m: float, noise: np.ndarray | float = 0.0, **keys: float) -> Range | None:
    left, right = corners(range_m)
    errors = {"sigma_px": 0.1, "misalignment_px": 0.0} | keys
    return stereo_range(left, right + noise, LENS, baseline_m=BASELINE_M, **errors)


@pytest.mark.parametrize("range_m", [0.5, 2.0, 8.5])
def test_exact_corners_give_the_exact_range(range_m: float) -> None:
    found = measured(range_m)
    assert found is not None
    assert found.range_m == pytest.approx(range_m, rel=1e-9)


def test_half_a_pixel_of_disparity_at_five_metres_is_half_a_metre() -> None:
    """f B / d: 21.1 px m over 4.22 px; with 0.5 px more disparity 4.47 m."""
    found = measured(5.0, noise=np.array([-0.5, 0.0]))
    assert found is not None
    assert found.range_m == pytest.approx(21.1135 / (21.1135 / 5.0 + 0.5), rel=1e-3)


def test_the_promised_error_is_the_scatter() -> None:
    rng = np.random.default_rng(2)
    left, right = corners(4.0)
    found = [
        stereo_range(
            left + rng.normal(0.0, 0.1, (4, 2)),
            right + rng.normal(0.0, 0.1, (4, 2)),
            LENS,
            baseline_m=BASELINE_M,
            sigma_px=0.1,
            misalignment_px=0.0,
        )
        for _ in range(500)
    ]
    ranges = [one.range_m for one in found if one is not None]
    assert np.std(ranges) == pytest.approx(np.mean([one.sigma_m for one in found if one is not None]), rel=0.12)


def test_corners_without_disparity_have_no_range() -> None:
    left, _ = corners(4.0)
    assert stereo_range(left, left, LENS, baseline_m=BASELINE_M, sigma_px=0.1, misalignment_px=0.0) is None


def test_stereo_is_taken_near_and_pnp_far() -> None:
    """With the paper's errors: PnP off by 3.8 % of the range, stereo by 0.17 px of disparity: they meet near 4.7 m."""

    def choice(range_m: float) -> str:
        covariance = ((1e-6, 0.0, 0.0), (0.0, 1e-6, 0.0), (0.0, 0.0, 1e-6))
        pnp = pnp_range((0.0, 0.0, range_m), covariance, relative_error=0.038)
        return less_uncertain(pnp, measured(range_m, sigma_px=0.01, misalignment_px=0.17)).method

    assert [choice(range_m) for range_m in (1.0, 3.0, 4.6, 4.9, 8.0)] == ["stereo", "stereo", "stereo", "pnp", "pnp"]


def test_without_a_second_view_pnp_stands_alone() -> None:
    pnp = Range(3.0, 0.1, "pnp")
    assert less_uncertain(pnp, None) is pnp
