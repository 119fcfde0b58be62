"""The red target: where it is, what is red and what is not, and how sure."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from companion import config
from companion.geometry import Transform
from companion.messages import CameraImage, PadBearing, PadNotSeen
from companion.vision import DETECTORS, DetectionHint, colour
from companion.vision.lens import from_config

PAD = config.Pad(family="RED_DISC", markers=(config.Marker(id=0, size_m=1.0),))
DETECTOR = DETECTORS["colour"](config.Vision(), PAD, from_config(config.Camera()))


def field(*discs: tuple[int, int, int], bgr: tuple[int, int, int] = (35, 30, 190)) -> CameraImage:
    """Green and brown ground with noise, red discs (u, v, radius) on it."""
    rng = np.random.default_rng(0)
    image = np.full((480, 752, 3), (60, 110, 95), np.uint8)
    for u, v, radius in discs:
        cv2.circle(image, (u, v), radius, bgr, -1)
    return CameraImage(7, "down", np.clip(image + rng.normal(0, 5, image.shape), 0, 255).astype(np.uint8), 0)


def bearing(detection: object) -> PadBearing:
    assert isinstance(detection, PadBearing), detection
    return detection


def test_the_bearing_points_at_the_middle_of_the_disc() -> None:
    """60 px to the right and 30 px down of the centre at f = 420 px."""
    found = bearing(DETECTOR.detect(field((435, 269, 25)), None))
    expected = np.array([59.5, 29.5, 420.0]) / np.linalg.norm([59.5, 29.5, 420.0])
    np.testing.assert_allclose(found.bearing_camera, expected, atol=0.5 / 420.0)
    assert 0.3 / 420.0 <= found.sigma_rad <= 2.0 / 420.0


def test_the_largest_red_patch_is_the_target() -> None:
    found = bearing(DETECTOR.detect(field((100, 100, 8), (600, 300, 20)), None))
    assert found.bearing_camera[0] > 0.3


def test_a_prediction_prefers_the_patch_it_points_at() -> None:
    """A larger red roof elsewhere does not draw the eye away from a pad that is being followed."""
    hint = DetectionHint(Transform((1.0, 0.0, 0.0, 0.0), (-6.5, -3.3, 10.0)), 0.3)
    found = bearing(DETECTOR.detect(field((100, 100, 18), (600, 300, 60)), hint))
    assert found.bearing_camera[0] < -0.3


def test_a_disc_cut_by_the_border_is_less_certain() -> None:
    whole = bearing(DETECTOR.detect(field((400, 200, 40)), None))
    cut = bearing(DETECTOR.detect(field((400, 5, 40)), None))
    assert cut.sigma_rad > 5.0 * whole.sigma_rad


@pytest.mark.parametrize(
    ("bgr", "is_red"),
    [
        ((35, 30, 190), True),
        ((20, 18, 90), True),
        ((30, 165, 255), False),
        ((60, 140, 150), False),
        ((200, 200, 255), False),
        ((128, 128, 128), False),
        ((0, 0, 15), False),
    ],
    ids=["red", "red in shade", "orange", "sand", "overexposed", "grey", "black"],
)
def test_what_is_red(bgr: tuple[int, int, int], is_red: bool) -> None:
    mask = colour.red_mask(np.full((4, 4, 3), bgr, np.uint8))
    assert bool(mask.all()) is is_red
    assert bool(mask.any()) is is_red


def test_a_frame_without_red_or_without_colour_says_so() -> None:
    assert DETECTOR.detect(field(), None) == PadNotSeen(7, "down", "colour", "nothing red")
    grey = CameraImage(7, "down", np.zeros((480, 752), np.uint8), 0)
    assert DETECTOR.detect(grey, None) == PadNotSeen(7, "down", "colour", "the frame has no colour")
