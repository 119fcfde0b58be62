"""A detector for two cameras in one frame: better than one camera near, as good as one far away."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
import scenes

from companion import config
from companion.messages import CameraImage, PadNotSeen, PadObservation
from companion.vision import DETECTORS, Detection
from companion.vision.lens import from_config

BASELINE_M = 0.2
PAD = config.Pad(markers=(config.Marker(id=7, size_m=0.4),))
LEVEL = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
TEXTURE = scenes.pad_texture(0.7, cv2.aruco.DICT_4X4_50, ((7, 0.4, (0.0, 0.0)),))


def frame(p_CP: np.ndarray, *, right: bool = True) -> CameraImage:
    """Both pictures beside each other; `right = False` leaves the second one grey."""
    halves = [
        scenes.picture(TEXTURE, LEVEL, p, scenes.camera_matrix(), rng=np.random.default_rng(k))
        for k, p in enumerate((p_CP, p_CP - [BASELINE_M, 0.0, 0.0]))
    ]
    if not right:
        halves[1] = np.full_like(halves[0], 127)
    return CameraImage(0, "pair", np.hstack(halves), 0)


def seen(one: CameraImage, *, printed_m: float = 0.4) -> Detection:
    camera = config.Camera(width_px=one.image.shape[1], height_px=one.image.shape[0])
    pad = config.Pad(markers=(config.Marker(id=7, size_m=printed_m),))
    return DETECTORS["stereo"](config.Vision(stereo_baseline_m=BASELINE_M), pad, from_config(camera)).detect(one, None)


def test_near_the_pair_does_not_mind_a_marker_printed_too_large() -> None:
    p_CP = np.array([0.15, -0.05, 1.2])
    observation = seen(frame(p_CP), printed_m=0.44)
    assert isinstance(observation, PadObservation)
    assert observation.detector == "stereo"
    np.testing.assert_allclose(observation.pad_position_camera_m, p_CP, atol=0.01)


def test_far_away_one_camera_is_believed() -> None:
    p_CP = np.array([0.1, 0.1, 6.0])
    both, one = seen(frame(p_CP)), seen(frame(p_CP, right=False))
    assert isinstance(both, PadObservation)
    assert both == one


def test_where_the_right_camera_sees_nothing_the_left_one_stands_alone() -> None:
    p_CP = np.array([0.1, 0.0, 1.2])
    observation = seen(frame(p_CP, right=False))
    assert isinstance(observation, PadObservation)
    np.testing.assert_allclose(observation.pad_position_camera_m, p_CP, atol=0.02)


def test_the_range_is_as_sure_as_it_says() -> None:
    p_CP = np.array([0.1, 0.0, 1.0])
    observation = seen(frame(p_CP))
    assert isinstance(observation, PadObservation)
    error_m = abs(float(np.linalg.norm(observation.pad_position_camera_m)) - float(np.linalg.norm(p_CP)))
    assert error_m < 3.0 * observation.position_covariance_m2[2][2] ** 0.5


def test_a_frame_of_another_size_is_refused_by_name() -> None:
    camera = config.Camera(width_px=1504, height_px=600)
    detector = DETECTORS["stereo"](config.Vision(stereo_baseline_m=BASELINE_M), PAD, from_config(camera))
    refused = detector.detect(frame(np.array([0.0, 0.0, 1.0])), None)
    assert isinstance(refused, PadNotSeen)
    assert "not as calibrated" in refused.reason
    assert refused.detector == "stereo"


def test_a_pair_without_a_baseline_is_refused() -> None:
    with pytest.raises(ValueError, match="stereo_baseline_m"):
        DETECTORS["stereo"](config.Vision(), PAD, from_config(config.Camera()))
