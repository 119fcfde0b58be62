"""Corners from edge fits, where the truth is known to a hundredth of a pixel."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
import scenes

from companion.vision import edges
from companion.vision.kannala_brandt import KannalaBrandt
from companion.vision.pinhole import Pinhole

K = scenes.camera_matrix()
LENS = Pinhole(width_px=752, height_px=480, fx_px=420.0, fy_px=420.0, cx_px=375.5, cy_px=239.5)


def square(side_m: float, distance_m: float, rng: np.random.Generator) -> tuple[scenes.Image, np.ndarray]:
    """A picture of marker 45 on a wide white ground and its true corners (1, 4, 2)."""
    texture = scenes.pad_texture(2.0 * side_m, cv2.aruco.DICT_4X4_50, ((45, side_m, (0.0, 0.0)),))
    R = scenes.looking_down(float(rng.uniform(-3, 3)), 0.1, -0.15)
    p = np.array([0.05, -0.04, 1.0]) * distance_m
    half = side_m / 2.0
    corners = np.array([(half, -half, 0.0), (half, half, 0.0), (-half, half, 0.0), (-half, -half, 0.0)])
    return scenes.picture(texture, R, p, K, rng=rng), LENS.project(corners @ R.T + p)[None]


def refined(image: scenes.Image, start: np.ndarray) -> np.ndarray:
    quads, good = edges.refined(image, start, reach_px=np.array([2.5]))
    assert good.all()
    return quads


@pytest.mark.parametrize(("distance_m", "limit_px"), [(0.8, 0.05), (4.0, 0.08), (8.0, 0.15)])
def test_corners_are_found_to_a_fraction_of_a_pixel(distance_m: float, limit_px: float) -> None:
    errors = []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        image, truth = square(0.4, distance_m, rng)
        found = refined(image, truth + rng.normal(0.0, 0.4, truth.shape))
        errors.append(np.sqrt(np.mean((found - truth) ** 2)))
    assert np.median(errors) <= limit_px


@pytest.mark.parametrize(("distance_m", "subpix_bias_percent"), [(3.7, 0.5), (7.6, 1.0)])
def test_size_has_no_bias_where_corner_search_has(distance_m: float, subpix_bias_percent: float) -> None:
    """A marker of 45 and 22 px: the range from the edge fit is good to 0.3 %, that from cornerSubPix is not."""
    ours, theirs = [], []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        image, truth = square(0.4, distance_m, rng)
        rough = truth + rng.normal(0.0, 0.4, truth.shape)
        subpix = cv2.cornerSubPix(image, rough.reshape(-1, 1, 2).astype(np.float32), (3, 3), (-1, -1), (3, 30, 0.01))
        size = perimeter(truth)
        ours.append(100.0 * (size / perimeter(refined(image, rough)) - 1.0))
        theirs.append(100.0 * (size / perimeter(subpix.reshape(1, 4, 2)) - 1.0))
    assert abs(np.mean(ours)) <= 0.3
    assert abs(np.mean(theirs)) >= subpix_bias_percent


def perimeter(quads: np.ndarray) -> float:
    return float(np.linalg.norm(quads - np.roll(quads, 1, axis=1), axis=2).sum())


def test_a_start_several_pixels_off_is_pulled_in_by_a_wide_reach() -> None:
    rng = np.random.default_rng(3)
    image, truth = square(0.4, 1.5, rng)
    wide, good = edges.refined(image, truth + 7.0, reach_px=np.array([12.0]))
    assert good.all()
    assert np.abs(refined(image, wide) - truth).max() < 0.15


def test_plain_ground_has_no_edges() -> None:
    image = np.clip(np.random.default_rng(0).normal(120.0, 4.0, (480, 752)), 0, 255).astype(np.uint8)
    start = np.array([[[300.0, 200.0], [360.0, 205.0], [355.0, 260.0], [302.0, 258.0]]])
    quads, good = edges.refined(image, start, reach_px=np.array([3.0]))
    assert not good.any()
    np.testing.assert_array_equal(quads, start)


def test_an_edge_lost_in_noise_is_not_taken_from_the_noise() -> None:
    """Three sides are within reach, the fourth is not: the quadrangle must be refused, not bent."""
    rng = np.random.default_rng(5)
    image, truth = square(0.4, 1.5, rng)
    start = truth.copy()
    start[0, 1:3] += (start[0, 1] - start[0, 0]) / np.linalg.norm(start[0, 1] - start[0, 0]) * 8.0
    _, good = edges.refined(image, start, reach_px=np.array([2.5]))
    assert not good.any()


def test_edges_that_a_fisheye_bends_are_followed() -> None:
    """A square that fills much of a fisheye's view: corners from straight lines in pixels would miss by pixels."""
    lens = KannalaBrandt(
        width_px=752, height_px=480, fx_px=300.0, fy_px=300.0, cx_px=375.5, cy_px=239.5, distortion=(-0.05, 0.01, 0, 0)
    )
    half = 0.5
    corners = np.array([(-half, -half, 0.6), (half, -half, 0.6), (half, half, 0.6), (-half, half, 0.6)])
    columns, rows = np.meshgrid(np.arange(752 * 2), np.arange(480 * 2))
    fine = np.column_stack((columns.reshape(-1), rows.reshape(-1))) / 2.0 - 0.25
    rays = lens.ray(fine)
    inside = (np.abs(rays[:, :2]).max(axis=1) <= half * rays[:, 2] / 0.6) & (rays[:, 2] > 0.0)
    sharp = np.where(inside, 30.0, 220.0).reshape(960, 1504).astype(np.float32)
    image = np.rint(cv2.GaussianBlur(cv2.resize(sharp, (752, 480), interpolation=cv2.INTER_AREA), (0, 0), 0.7))
    truth = lens.project(corners)[None]
    start = truth + np.random.default_rng(0).normal(0.0, 0.7, truth.shape)
    found, good = edges.refined(image.astype(np.uint8), start, reach_px=np.array([2.5]), camera=lens)
    assert good.all()
    assert np.abs(found - truth).max() < 0.15
