"""A marker's own picture slid over the image: the shift of a prediction that edges could not follow, or none."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from companion.vision import alignment, pad_layout

DICTIONARY = pad_layout.dictionary("DICT_4X4_50")
PICTURE = alignment.picture(DICTIONARY, 45)
CELLS = 6


def scene(truth: np.ndarray) -> np.ndarray:
    """The marker with its light rim on grey, noisy ground."""
    pad = np.pad(cv2.aruco.generateImageMarker(DICTIONARY, 45, 240), 40, constant_values=230)
    corners = np.array([(39.5, 39.5), (279.5, 39.5), (279.5, 279.5), (39.5, 279.5)], np.float32)
    H = cv2.getPerspectiveTransform(corners, truth.astype(np.float32))
    image = np.random.default_rng(2).normal(120.0, 12.0, (480, 752)).clip(0, 255).astype(np.uint8)
    cv2.warpPerspective(pad, H, (752, 480), dst=image, borderMode=cv2.BORDER_TRANSPARENT)
    return image


def square(centre: tuple[float, float], side_px: float, turn_rad: float) -> np.ndarray:
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    half = side_px / 2.0 * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    return half @ np.array([(c, s), (-s, c)]) + centre


@pytest.mark.parametrize("side_px", [18.0, 60.0, 200.0])
@pytest.mark.parametrize("direction_rad", [0.3, 2.0, 4.0])
def test_a_prediction_two_cells_off_and_slightly_turned_is_brought_within_half_a_cell(
    side_px: float, direction_rad: float
) -> None:
    cell = side_px / CELLS
    truth = square((380.0, 240.0), side_px, 0.7)
    off = 2.0 * cell * np.array([np.cos(direction_rad), np.sin(direction_rad)])
    predicted = square((380.0, 240.0), side_px * 1.03, 0.73) + off
    shift = alignment.shift_px(scene(truth), predicted, PICTURE, 3.0 * cell)
    assert shift is not None
    centre = (predicted + shift).mean(axis=0)
    assert np.linalg.norm(centre - truth.mean(axis=0)) < max(0.5 * cell, 1.0)


def test_a_prediction_partly_outside_the_image_is_brought_inside() -> None:
    truth = square((110.0, 240.0), 150.0, 0.0)
    shift = alignment.shift_px(scene(truth), truth - (60.0, 0.0), PICTURE, 75.0)
    assert shift is not None
    np.testing.assert_allclose(shift, (60.0, 0.0), atol=7.0)


@pytest.mark.parametrize("side_px", [150.0, 400.0])
def test_a_marker_that_the_border_cuts_is_brought_to_its_place(side_px: float) -> None:
    truth = square((0.38 * side_px, 240.0), side_px, 0.0)
    shift = alignment.shift_px(scene(truth), truth + (0.2 * side_px, -0.1 * side_px), PICTURE, 0.3 * side_px)
    assert shift is not None
    np.testing.assert_allclose(shift, (-0.2 * side_px, 0.1 * side_px), atol=0.05 * side_px)


def test_where_there_is_no_marker_there_is_no_shift() -> None:
    ground = scene(square((100.0, 100.0), 60.0, 0.0))
    assert alignment.shift_px(ground, square((500.0, 300.0), 60.0, 0.0), PICTURE, 30.0) is None
