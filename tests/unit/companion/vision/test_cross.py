"""Circle and cross: the ring, then the cross alone, then the deck's corners."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
import scenes

from companion import config
from companion.geometry import Transform, matrix_from_quaternion, quaternion_from_matrix
from companion.messages import CameraImage, PadNotSeen, PadObservation
from companion.vision import DETECTORS, DetectionHint, cross, pose
from companion.vision.lens import from_config

PAD = config.Pad(family="CIRCLE_CROSS", markers=(config.Marker(id=0, size_m=1.2),))
TEXTURE = scenes.cross_texture()
DETECTOR = DETECTORS["cross"](config.Vision(), PAD, from_config(config.Camera()))


def frame_of(R: np.ndarray, p: np.ndarray, seed: int, texture: scenes.Image = TEXTURE) -> CameraImage:
    image = scenes.picture(texture, R, p, scenes.camera_matrix(), rng=np.random.default_rng(seed))
    return CameraImage(0, "down", image, 0)


def hint(R: np.ndarray, p: np.ndarray) -> DetectionHint:
    q = quaternion_from_matrix(tuple(tuple(row) for row in R.tolist()))  # type: ignore[arg-type]
    return DetectionHint(Transform(q, tuple(p.tolist())), 0.1, tuple(R[:, 2].tolist()))  # type: ignore[arg-type]


def observed(detection: object) -> PadObservation:
    assert isinstance(detection, PadObservation), detection
    return detection


@pytest.mark.parametrize("distance_m", [1.6, 3.0, 6.0, 10.0, 15.0])
@pytest.mark.parametrize("tracked", [False, True])
def test_the_tag_is_found_from_near_to_far(distance_m: float, tracked: bool) -> None:
    R, p = scenes.looking_down(0.5, 0.1, -0.08), np.array([0.03, 0.05, 1.0]) * distance_m
    observation = observed(DETECTOR.detect(frame_of(R, p, 1), hint(R, p + 0.05) if tracked else None))
    assert np.linalg.norm(np.array(observation.pad_position_camera_m) - p) < 0.006 * distance_m


def test_with_a_prediction_yaw_is_right_in_every_quarter() -> None:
    for yaw in (-2.6, -1.2, 0.3, 1.9):
        R, p = scenes.looking_down(yaw, 0.05, 0.1), np.array([0.1, -0.1, 3.0])
        rough = scenes.looking_down(yaw + 0.2)
        observation = observed(DETECTOR.detect(frame_of(R, p, 2), hint(rough, p)))
        assert observation.q_camera_pad is not None
        error = pose.rotation_angle(R.T @ np.array(matrix_from_quaternion(observation.q_camera_pad)))
        assert np.degrees(error) < 1.0


def test_without_a_prediction_no_rotation_is_claimed() -> None:
    R, p = scenes.looking_down(0.4), np.array([0.0, 0.0, 3.0])
    assert observed(DETECTOR.detect(frame_of(R, p, 3), None)).q_camera_pad is None


def test_near_the_deck_the_cross_alone_is_enough() -> None:
    """From 0.9 m the ring of 1.2 m does not fit into the image, the cross of 0.72 m does."""
    R, p = scenes.looking_down(0.4, 0.03, 0.02), np.array([0.01, 0.02, 0.9])
    observation = observed(DETECTOR.detect(frame_of(R, p, 4), hint(R, p + 0.02)))
    assert len(observation.corners_px) == 12
    assert np.linalg.norm(np.array(observation.pad_position_camera_m) - p) < 0.02


def test_a_soiled_tag_leaves_the_corners_of_the_deck() -> None:
    blank = TEXTURE.copy()
    cv2.circle(blank, (300, 300), 250, 230, -1)
    R, p = scenes.looking_down(0.4, 0.1, 0.0), np.array([0.1, 0.1, 4.0])
    observation = observed(DETECTOR.detect(frame_of(R, p, 5, blank), hint(R, p)))
    assert len(observation.corners_px) == 4
    assert np.linalg.norm(np.array(observation.pad_position_camera_m) - p) < 0.05


def test_a_ring_without_a_cross_is_not_the_tag() -> None:
    empty = TEXTURE.copy()
    cv2.circle(empty, (300, 300), 180, 230, -1)
    image = frame_of(scenes.looking_down(), np.array([0.0, 0.0, 3.0]), 6, empty).image
    (centre, axes), *_ = cross.rings(image)
    assert cross.cross_heading(image, centre, axes) is None


def test_ground_without_a_tag_shows_none() -> None:
    for seed in range(4):
        ground = 110.0 + scenes.ground_texture(752, 480, np.random.default_rng(seed))
        frame = CameraImage(0, "down", np.clip(ground, 0, 255).astype(np.uint8), 0)
        assert isinstance(DETECTOR.detect(frame, None), PadNotSeen)


def test_the_nearest_of_four_quarters_is_taken() -> None:
    q = (1.0, 0.0, 0.0, 0.0)
    east = (np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5))
    assert cross.nearest_quarter_turn(q, east) == pytest.approx(east)
    assert cross.nearest_quarter_turn(q, (0.99, 0.0, 0.0, 0.141)) == pytest.approx(q)


@pytest.mark.parametrize("height_m", [0.35, 0.5, 0.65, 0.8])
def test_nearer_still_the_inner_corners_of_a_cut_off_cross_are_enough(height_m: float) -> None:
    """The arms of 0.36 m are cut off by the edge of the image."""
    R, p = scenes.looking_down(0.4, 0.05, 0.1), np.array([0.03, 0.05, height_m])
    observation = observed(DETECTOR.detect(frame_of(R, p, 7), hint(R, p + 0.02)))
    assert np.linalg.norm(np.array(observation.pad_position_camera_m) - p) < 0.02
