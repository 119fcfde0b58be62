"""A lens comes out as it went in; a bad set of views gets a bad verdict that says what to do."""

from __future__ import annotations

import contextlib
from typing import Any

import numpy as np
import pytest
from board_views import exact_view, poses

from companion.calibration.board import Board, BoardView
from companion.calibration.coverage import Coverage
from companion.calibration.solve import Calibration, Model, calibrate, lens_of
from companion.calibration.verdict import judge, overall
from companion.vision.kannala_brandt import KannalaBrandt
from companion.vision.pinhole import Pinhole

PINHOLE = Pinhole(752, 480, 420.0, 418.0, 371.0, 244.0, (-0.28, 0.07, 0.0006, -0.0004))
FISHEYE = KannalaBrandt(640, 480, 190.0, 190.5, 321.0, 238.0, (0.02, -0.006, 0.002, -0.0005))
BOARD = Board()


def views_of(lens: Any, count: int = 24, *, noise_px: float = 0.15, **options: Any) -> list[BoardView]:
    rng = np.random.default_rng(7)
    return [exact_view(BOARD, lens, R, p, rng, noise_px) for R, p in poses(count, 3, **options)]


def coverage_of(views: list[BoardView], lens: Any, *, is_round: bool = False) -> Coverage:
    coverage = Coverage(lens.width_px, lens.height_px, is_round=is_round)
    for view in views:
        coverage.add(view.pixels)
    return coverage


def pixel_error(lens: Any, truth: Any, step: int = 40) -> float:
    """Largest distance between the two lenses' pixels over the largest disc in the image, a free turn not being taken out."""
    x, y = np.meshgrid(np.arange(0, truth.width_px, step), np.arange(0, truth.height_px, step))
    pixels = np.stack((x.ravel(), y.ravel()), 1).astype(float)
    pixels = pixels[np.hypot(pixels[:, 0] - truth.cx_px, pixels[:, 1] - truth.cy_px) < truth.width_px / 2]
    return float(np.max(np.linalg.norm(lens.project(truth.ray(pixels)) - pixels, axis=1)))


@pytest.mark.parametrize(
    ("truth", "model", "options"),
    [(PINHOLE, "pinhole", {"spread": 0.6}), (FISHEYE, "kannala_brandt", {"spread": 2.5, "distance_m": (0.15, 0.3)})],
)
def test_the_lens_that_made_the_views_is_found_over_the_whole_image(truth: Any, model: Model, options: Any) -> None:
    views = views_of(truth, **options)
    result = calibrate(views, (truth.width_px, truth.height_px), model, "down")
    assert result.info.fx_px == pytest.approx(truth.fx_px, rel=0.005)
    assert result.info.cx_px == pytest.approx(truth.cx_px, abs=2.0)
    assert pixel_error(lens_of(result.info), truth) < 2.0
    noise = 0.15 * 2**0.5
    assert result.rms_px == pytest.approx(noise, rel=0.15)
    assert result.held_out_px == pytest.approx(noise, rel=0.25)
    assert overall(judge(result, coverage_of(views, truth, is_round=model != "pinhole"))) == "pass"


def test_the_wrong_model_shows_in_the_error() -> None:
    views = views_of(FISHEYE, spread=2.5, distance_m=(0.15, 0.3))
    result = calibrate(views, (640, 480), "pinhole", "down")
    assert result.rms_px > 3 * calibrate(views, (640, 480), "kannala_brandt", "down").rms_px


def test_views_from_the_front_in_the_middle_only_fail_with_what_to_do() -> None:
    views = views_of(PINHOLE, spread=0.05, distance_m=(0.55, 0.6))[::4] * 2
    findings = judge(_calibration(views, tilt_deg=0.5), coverage_of(views, PINHOLE))
    said = {finding.name: (finding.grade, finding.advice) for finding in findings}
    assert overall(findings) == "fail"
    assert said["coverage"][0] == "fail"
    assert "edge" in said["coverage"][1]
    assert said["tilted views"][0] == "fail"
    assert "all four sides" in said["tilted views"][1]


def _calibration(views: list[BoardView], tilt_deg: float) -> Calibration:
    made = calibrate(views_of(PINHOLE, 12, spread=0.6), (752, 480), "pinhole", "down")
    return Calibration(made.info, 0.3, 0.3, len(views), 35 * len(views), (tilt_deg,) * len(views))


def test_a_bent_board_or_blurred_pictures_warn_or_fail() -> None:
    noisy = views_of(PINHOLE, noise_px=0.5, spread=0.6)
    result = calibrate(noisy, (752, 480), "pinhole", "down")
    grades = {finding.name: finding.grade for finding in judge(result, coverage_of(noisy, PINHOLE))}
    assert grades["reprojection error"] == "warn"


def test_too_few_views_and_views_without_depth_are_refused_in_words() -> None:
    with pytest.raises(ValueError, match="not enough"):
        calibrate(views_of(PINHOLE, 3), (752, 480), "pinhole", "down")


@pytest.mark.parametrize("model", ["pinhole", "kannala_brandt"])
def test_views_of_pure_noise_end_in_a_bad_figure_or_a_refusal_and_nothing_else(model: Model) -> None:
    rng = np.random.default_rng(2)
    noise = [BoardView(view.board_points, rng.uniform(0, 480, view.pixels.shape)) for view in views_of(PINHOLE, 8)]
    with contextlib.suppress(ValueError):
        assert calibrate(noise, (752, 480), model, "down").rms_px > 10.0


def test_coverage_counts_cells_names_the_empty_side_and_draws_itself() -> None:
    coverage = Coverage(800, 600)
    assert coverage.fraction == 0.0
    assert coverage.add(np.array([[x, y] for x in range(450, 800, 50) for y in range(20, 600, 50)], float)) == 24
    assert coverage.fraction == 0.5
    assert coverage.missing() == "left"
    lines = coverage.grid().splitlines()
    assert len(lines) == 6
    assert all(line[:8] == "·" * 8 and "·" not in line[8:] for line in lines)


def test_the_corners_of_a_fisheyes_image_do_not_count() -> None:
    coverage = Coverage(640, 480, is_round=True)
    x, y = np.meshgrid(np.arange(640), np.arange(480))
    ring = np.hypot((x - 319.5) / 320, (y - 239.5) / 240) < 1.0
    coverage.add(np.stack((x[ring], y[ring]), 1).astype(float))
    assert coverage.fraction == 1.0
