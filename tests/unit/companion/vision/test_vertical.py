"""The upright marker of a boat: landing point and yaw error as the paper steers by, checked by hand."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
import scenes

from companion import config
from companion.geometry import Transform, quaternion_from_matrix
from companion.messages import CameraImage, PadObservation
from companion.vision import DETECTORS
from companion.vision.lens import from_config
from companion.vision.vertical import yaw_error_rad

# Marker of 0.4 m, its foot 0.75 m ahead of the landing point, its middle 0.4 m above the deck.
BOAT = config.Pad(markers=(config.Marker(id=7, size_m=0.4, facing="back", position_m=(0.75, 0.0), height_m=0.4),))
AHEAD = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
"""R_CP of a camera that looks along the pad's x axis: right is P y, down is P z."""


def test_the_landing_point_is_in_front_of_the_marker_on_the_deck() -> None:
    """Camera level, 2 m behind the marker and at its height: the landing point is 1.25 m ahead and 0.4 m below."""
    texture = scenes.pad_texture(0.7, cv2.aruco.DICT_4X4_50, ((7, 0.4, (0.0, 0.0)),))
    # The texture's frame has x towards its top and y to its right: seen upright its x is up.
    upright = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    image = scenes.picture(
        texture, upright, np.array([0.0, 0.0, 2.0]), scenes.camera_matrix(), rng=np.random.default_rng(1)
    )
    detector = DETECTORS["vertical"](config.Vision(), BOAT, from_config(config.Camera()))
    observation = detector.detect(CameraImage(0, "front", image, 0), None)
    assert isinstance(observation, PadObservation)
    np.testing.assert_allclose(observation.pad_position_camera_m, (0.0, 0.4, 1.25), atol=0.01)


@pytest.mark.parametrize("turned_deg", [-30.0, 0.0, 15.0])
def test_yaw_error_is_the_angle_to_turn_right(turned_deg: float) -> None:
    """The vehicle has turned left by that much: the pad's x axis shows up on its right."""
    c, s = math.cos(math.radians(turned_deg)), math.sin(math.radians(turned_deg))
    R = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]) @ AHEAD
    q = quaternion_from_matrix(tuple(tuple(row) for row in R.tolist()))  # type: ignore[arg-type]
    assert math.degrees(yaw_error_rad(Transform(q, (0.0, 0.0, 2.0)))) == pytest.approx(turned_deg)


def test_a_pad_without_an_upright_marker_is_refused() -> None:
    with pytest.raises(ValueError, match="back"):
        DETECTORS["vertical"](config.Vision(), config.Pad(), from_config(config.Camera()))
