"""Finding markers anywhere: real photographs, small markers, and nothing where there is nothing."""

from __future__ import annotations

import re
from pathlib import Path

import cv2
import numpy as np
import pytest
import scenes

from companion import config
from companion.vision import pad_layout, search
from companion.vision.codes import CodeBook

PHOTOGRAPHS = Path(__file__).resolve().parents[3] / "data" / "apriltag"
WHOLE_FAMILY = CodeBook(pad_layout.dictionary("DICT_APRILTAG_36h11"), list(range(587)))


def pad_book() -> CodeBook:
    layout = pad_layout.from_config(config.Pad())
    cells = {marker_id: pad_layout.readable_cells(layout, marker_id) for marker_id in (45, 7)}
    return CodeBook(pad_layout.dictionary("DICT_4X4_50"), [45, 7], cells)


def listed_centres(name: str) -> list[np.ndarray]:
    lines = (PHOTOGRAPHS / f"{name}.txt").read_text(encoding="utf-8").splitlines()
    corners = [[pair.split() for pair in re.findall(r"\(([^)]*)\)", line)] for line in lines]
    return [np.array(quad, dtype=float).mean(axis=0) for quad in corners]


@pytest.mark.parametrize(("name", "at_least"), [("33369213973_9d9bb4cc96_c", 12), ("34085369442_304b6bafd9_c", 24)])
def test_tags_on_photographs_are_found_without_a_false_id(name: str, at_least: int) -> None:
    """Read with all 587 ids; OpenCV's default detector finds 12 of 12 and 15 of 25."""
    photograph = cv2.imread(str(PHOTOGRAPHS / f"{name}.jpg"), cv2.IMREAD_GRAYSCALE)
    assert photograph is not None
    found = search.all_found(photograph, WHOLE_FAMILY)
    assert {marker.marker_id for marker in found} == {0}
    places = np.array([marker.corners.mean(axis=0) for marker in found])
    hits = [np.linalg.norm(places - centre, axis=1).min() < 6.0 for centre in listed_centres(name)]
    assert sum(hits) >= at_least


@pytest.mark.parametrize("distance_m", [0.4, 2.0, 8.0, 16.0, 25.0, 30.0])
def test_the_pad_is_found_from_near_to_far(distance_m: float) -> None:
    rng = np.random.default_rng(int(10 * distance_m))
    R, p = scenes.looking_down(0.7, 0.1, -0.1), np.array([0.02, 0.03, 1.0]) * distance_m
    image = scenes.picture(scenes.nested_pad_texture(), R, p, scenes.camera_matrix(), rng=rng)
    found = next(search.coarse_to_fine(image, pad_book()), [])
    assert found
    for marker in found:
        half = 0.6 if marker.marker_id == 45 else 0.12
        top_left = scenes.camera_matrix() @ (R @ (half, -half, 0.0) + p)
        assert np.linalg.norm(marker.corners[0] - top_left[:2] / top_left[2]) < 4.0


def test_a_marker_that_fills_a_large_picture_is_found() -> None:
    """Of 690 px, more than a quarter of the size of the picture shows of a marker."""
    K = scenes.camera_matrix(1050.0, 959.5, 539.5)
    texture = scenes.pad_texture(1.5, cv2.aruco.DICT_4X4_50, ((45, 1.2, (0.0, 0.0)),))
    R, p = scenes.looking_down(0.3), np.array([0.0, 0.0, 1.82])
    image = scenes.picture(texture, R, p, K, width=1920, height=1080, rng=np.random.default_rng(1))
    assert [marker.marker_id for marker in next(search.coarse_to_fine(image, pad_book()), [])] == [45]


def test_a_marker_of_fourteen_pixels_is_found_in_every_frame() -> None:
    """0.4 m from 12 m with f = 420 px. The rate over hundreds of frames: benchmarks/detection.py."""
    texture = scenes.pad_texture(0.8, cv2.aruco.DICT_4X4_50, ((45, 0.4, (0.0, 0.0)),))
    book = CodeBook(pad_layout.dictionary("DICT_4X4_50"), [45])
    missed = 0
    for seed in range(30):
        rng = np.random.default_rng(seed)
        R = scenes.looking_down(float(rng.uniform(-3, 3)), *rng.normal(0.0, 0.08, 2))
        p = np.array([rng.uniform(-0.5, 0.5), rng.uniform(-0.35, 0.35), 1.0]) * 12.0
        image = scenes.picture(texture, R, p, scenes.camera_matrix(), rng=rng)
        missed += not next(search.coarse_to_fine(image, book), [])
    assert missed == 0


def test_ground_without_a_pad_shows_no_marker() -> None:
    book = pad_book()
    for seed in range(8):
        ground = 110.0 + scenes.ground_texture(752, 480, np.random.default_rng(seed))
        assert list(search.coarse_to_fine(np.clip(ground, 0, 255).astype(np.uint8), book)) == []


@pytest.mark.parametrize("level", [0, 255, 128])
def test_a_frame_of_one_grey_level_shows_no_marker(level: int) -> None:
    assert next(search.coarse_to_fine(np.full((480, 752), level, np.uint8), pad_book()), []) == []
