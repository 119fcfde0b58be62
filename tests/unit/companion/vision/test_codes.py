"""Reading codes: which marker, which way up, and what is no marker at all."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from companion import config
from companion.vision import pad_layout
from companion.vision.codes import CodeBook

FAMILY = "DICT_4X4_50"
QUAD = np.array([[[100.0, 80.0], [160.0, 80.0], [160.0, 140.0], [100.0, 140.0]]]) - 0.5


def drawn(marker_id: int, quarter_turns: int = 0, family: str = FAMILY) -> np.ndarray:
    """White image with one marker on the square of QUAD, turned counter-clockwise."""
    image = np.full((240, 320), 220, np.uint8)
    marker = cv2.aruco.generateImageMarker(pad_layout.dictionary(family), marker_id, 60)
    image[80:140, 100:160] = np.where(np.rot90(marker, quarter_turns) > 0, 220, 30)
    return image


def book(*ids: int, family: str = FAMILY) -> CodeBook:
    return CodeBook(pad_layout.dictionary(family), list(ids))


@pytest.mark.parametrize(("quarter_turns", "first_corner"), [(0, 0), (1, 3), (2, 2), (3, 1)])
def test_first_corner_is_the_markers_top_left(quarter_turns: int, first_corner: int) -> None:
    """Turned counter-clockwise by a quarter, the marker's top-left corner stands at the bottom left, the last corner."""
    (reading,) = book(45, 7).read(drawn(7, quarter_turns), QUAD)
    assert (reading.marker_id, reading.first_corner) == (7, first_corner)
    assert reading.correlation > 0.95


def test_a_marker_of_another_id_is_not_the_pad() -> None:
    assert book(45, 7).read(drawn(12), QUAD) == []


def test_one_wrong_cell_of_sixteen_is_forgiven_four_are_not() -> None:
    image = drawn(45)
    image[90:100, 110:120] = 250 - image[90:100, 110:120]
    assert [reading.marker_id for reading in book(45).read(image, QUAD)] == [45]
    image[100:130, 110:120] = 250 - image[100:130, 110:120]
    assert book(45).read(image, QUAD) == []


def test_a_marker_without_white_around_it_is_refused() -> None:
    image = drawn(45)
    image[:80], image[140:], image[:, :100], image[:, 160:] = 30, 30, 30, 30
    assert book(45).read(image, QUAD) == []


def test_noise_is_never_read_as_a_marker() -> None:
    rng = np.random.default_rng(1)
    noise = cv2.GaussianBlur(rng.normal(128.0, 200.0, (480, 752)).astype(np.float32), (0, 0), 3.0)
    image = np.clip(noise, 0, 255).astype(np.uint8)
    corner = rng.uniform((20.0, 20.0), (650.0, 380.0), (5000, 2))
    side = rng.uniform(12.0, 80.0, (5000, 1, 1))
    quads = corner[:, None, :] + side * np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
    assert book(45, 7).read(image, quads) == []
    assert book(*range(587), family="DICT_APRILTAG_36h11").read(image, quads) == []


def test_the_cells_under_a_nested_marker_are_not_compared() -> None:
    layout = pad_layout.from_config(config.Pad())
    free = pad_layout.readable_cells(layout, 45)
    assert free.sum() == 12
    assert not free[1:3, 1:3].any()
    assert pad_layout.readable_cells(layout, 7).all()
