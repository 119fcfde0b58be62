"""The marker detector as the pipeline uses it: acquire, track, hand over between scales, refuse."""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np
import pytest
import scenes

from companion import config
from companion.geometry import Transform, matrix_from_quaternion, quaternion_from_matrix
from companion.messages import CameraImage, PadNotSeen, PadObservation
from companion.vision import DETECTORS, DetectionHint, pose, search
from companion.vision.lens import from_config

K = scenes.camera_matrix()
LENS = from_config(config.Camera())
PAD = scenes.nested_pad_texture()


def detector(vision: config.Vision | None = None, pad: config.Pad | None = None):  # type: ignore[no-untyped-def]
    return DETECTORS["aruco"](vision or config.Vision(), pad or config.Pad(), LENS)


def seen_from(R: np.ndarray, p: np.ndarray, seed: int, texture: scenes.Image = PAD, **keys: float) -> CameraImage:
    image = scenes.picture(texture, R, p, K, rng=np.random.default_rng(seed), **keys)  # type: ignore[arg-type]
    return CameraImage(t_ns=1_000, camera="down", image=image, sequence=1)


def transform(R: np.ndarray, p: np.ndarray) -> Transform:
    return Transform(quaternion_from_matrix(tuple(tuple(row) for row in R.tolist())), tuple(p.tolist()))  # type: ignore[arg-type]


def hint(R: np.ndarray, p: np.ndarray, sigma_m: float = 0.05) -> DetectionHint:
    return DetectionHint(transform(R, p), sigma_m, tuple(R[:, 2].tolist()))


def observed(detection: object) -> PadObservation:
    assert isinstance(detection, PadObservation), detection
    return detection


def error_m(observation: PadObservation, p: np.ndarray) -> float:
    return float(np.linalg.norm(np.array(observation.pad_position_camera_m) - p))


def error_deg(observation: PadObservation, R: np.ndarray) -> float:
    assert observation.q_camera_pad is not None
    return float(np.degrees(pose.rotation_angle(R.T @ np.array(matrix_from_quaternion(observation.q_camera_pad)))))


@pytest.mark.parametrize("distance_m", [0.5, 1.5, 4.0, 10.0, 20.0])
@pytest.mark.parametrize("tracked", [False, True])
def test_the_landing_point_is_found_within_a_third_of_a_percent_of_the_range(distance_m: float, tracked: bool) -> None:
    R, p = scenes.looking_down(0.6, 0.08, -0.05), np.array([0.03, -0.04, 1.0]) * distance_m
    prior = hint(R, p + 0.03) if tracked else None
    observation = observed(detector().detect(seen_from(R, p, 3), prior))
    assert error_m(observation, p) <= 0.0033 * distance_m
    assert (observation.t_ns, observation.camera, observation.detector) == (1_000, "down", "aruco")


def test_the_same_frame_and_hint_give_the_same_answer() -> None:
    R, p = scenes.looking_down(0.6), np.array([0.1, 0.1, 5.0])
    frame, prior, eye = seen_from(R, p, 4), hint(R, p), detector()
    first = eye.detect(frame, prior)
    eye.detect(seen_from(R, p + 0.3, 5), None)
    assert eye.detect(frame, prior) == first


def test_a_wrong_prediction_costs_time_but_not_the_pad() -> None:
    R, p = scenes.looking_down(0.6), np.array([0.4, -0.3, 6.0])
    wrong = hint(scenes.looking_down(-1.0), p + [1.5, 0.5, -2.0], sigma_m=0.02)
    assert error_m(observed(detector().detect(seen_from(R, p, 6), wrong)), p) < 0.02


@pytest.mark.parametrize("yaw_deg", [40.0, -50.0, 130.0])
def test_a_marker_whose_corners_lie_outside_the_picture_is_tracked_by_its_edges(yaw_deg: float) -> None:
    pad = config.Pad(markers=(config.Marker(id=45, size_m=1.2),))
    texture = scenes.pad_texture(1.5, cv2.aruco.DICT_4X4_50, ((45, 1.2, (0.0, 0.0)),))
    R, p = scenes.looking_down(np.radians(yaw_deg)), np.array([0.02, -0.01, 1.3])
    frame = seen_from(R, p, 7, texture)
    observation = observed(detector(pad=pad).detect(frame, hint(R, p + [0.01, 0.02, -0.01])))
    rows = np.array(observation.corners_px)[:, 1]
    assert rows.min() < 0.0
    assert rows.max() > 480.0
    assert error_m(observation, p) < 0.003


def test_descending_from_the_outer_to_the_inner_marker_makes_no_step() -> None:
    """From 3 m to 0.4 m, tracked from frame to frame: never more than 1 cm or 1 degree off, whichever markers are seen."""
    eye, R = detector(), scenes.looking_down(0.3, 0.03, -0.02)
    prior, seen = None, []
    for k, height_m in enumerate(np.geomspace(3.0, 0.4, 24)):
        p = np.array([0.02, 0.01, 1.0]) * height_m
        observation = observed(eye.detect(seen_from(R, p, k), prior))
        assert error_m(observation, p) <= 0.01
        assert error_deg(observation, R) <= 1.0
        prior = hint(R, p)
        seen.append(observation.marker_ids)
    assert 45 in seen[0]
    assert seen[-1] == (7,)


def test_several_markers_give_one_landing_point() -> None:
    """Four markers around the landing point, none on it; the last two are covered."""
    places = ((1, (0.4, -0.4)), (2, (0.4, 0.4)), (3, (-0.4, 0.4)), (4, (-0.4, -0.4)))
    board = config.Pad(markers=tuple(config.Marker(id=i, size_m=0.4, position_m=xy) for i, xy in places))
    texture = scenes.pad_texture(1.5, cv2.aruco.DICT_4X4_50, tuple((i, 0.4, xy) for i, xy in places))
    R, p = scenes.looking_down(-0.4, 0.1, 0.0), np.array([0.2, 0.1, 3.0])
    whole = observed(detector(pad=board).detect(seen_from(R, p, 1, texture), None))
    assert set(whole.marker_ids) == {1, 2, 3, 4}
    assert error_m(whole, p) < 0.006
    texture[texture.shape[0] // 2 :] = 230
    half = observed(detector(pad=board).detect(seen_from(R, p, 1, texture), None))
    assert set(half.marker_ids) == {1, 2}
    assert error_m(half, p) < 0.02


def test_with_a_corner_under_a_tarpaulin_the_marker_within_is_found() -> None:
    """The large marker's code is read at the coarsest level of the search, but its corners make no pose."""
    texture = PAD.copy()
    metre = texture.shape[0] / 1.5
    texture[round(1.1 * metre) :, round(1.1 * metre) :] = 60
    for seed in range(12):
        rng = np.random.default_rng(seed)
        R, p = scenes.looking_down(float(rng.uniform(-3.0, 3.0)), *rng.normal(0.0, 0.04, 2)), np.array([0.2, -0.1, 6.0])
        assert error_m(observed(detector().detect(seen_from(R, p, seed, texture), None)), p) < 0.06


def test_an_apriltag_pad_is_found_as_well() -> None:
    pad = config.Pad(family="DICT_APRILTAG_36h11", markers=(config.Marker(id=5, size_m=1.0),))
    texture = scenes.pad_texture(1.5, cv2.aruco.DICT_APRILTAG_36h11, ((5, 1.0, (0.0, 0.0)),))
    R, p = scenes.looking_down(2.0, 0.1, 0.1), np.array([0.2, 0.1, 9.0])
    assert error_m(observed(detector(pad=pad).detect(seen_from(R, p, 1, texture), None)), p) < 0.03


def test_a_colour_frame_is_as_good_as_a_grey_one() -> None:
    R, p = scenes.looking_down(), np.array([0.0, 0.0, 4.0])
    grey = seen_from(R, p, 2)
    colour = CameraImage(grey.t_ns, grey.camera, np.dstack([grey.image] * 3), grey.sequence)
    assert error_m(observed(detector().detect(colour, None)), p) < 0.01


def test_a_frame_without_the_pad_says_so() -> None:
    ground = np.clip(110.0 + scenes.ground_texture(752, 480, np.random.default_rng(0)), 0, 255).astype(np.uint8)
    detection = detector().detect(CameraImage(5, "down", ground, 1), None)
    assert detection == PadNotSeen(5, "down", "aruco", "no marker")


def test_a_frame_of_the_wrong_size_is_refused_by_name() -> None:
    detection = detector().detect(CameraImage(5, "down", np.zeros((240, 320), np.uint8), 1), None)
    assert isinstance(detection, PadNotSeen)
    assert "320 x 240" in detection.reason


def test_a_marker_that_gravity_says_hangs_on_a_wall_is_not_the_pad() -> None:
    R, p = scenes.looking_down(), np.array([0.0, 0.0, 4.0])
    sideways = DetectionHint(None, 1e3, (0.0, 1.0, 0.0))
    assert isinstance(detector().detect(seen_from(R, p, 2), sideways), PadNotSeen)


def test_a_marker_cut_by_the_border_leaves_the_other_to_tell() -> None:
    R, p = scenes.looking_down(), np.array([0.25, 0.1, 0.9])
    observation = observed(detector().detect(seen_from(R, p, 2), None))
    assert observation.marker_ids == (7,)
    assert error_m(observation, p) < 0.003


@pytest.mark.parametrize("refine", ["edges", "subpix", "none"])
def test_every_refinement_finds_the_pad(refine: str) -> None:
    R, p = scenes.looking_down(0.2), np.array([0.1, 0.2, 5.0])
    vision = config.Vision(refine=refine)  # type: ignore[arg-type]
    assert error_m(observed(detector(vision).detect(seen_from(R, p, 2), None)), p) < 0.15


def test_the_position_error_stays_within_its_covariance() -> None:
    """Far and near, tracked: 30 frames, the mean normalised squared error at most what three degrees of freedom have."""
    eye, squares = detector(), []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        distance_m = float(rng.uniform(2.0, 16.0))
        R = scenes.looking_down(float(rng.uniform(-3, 3)), *rng.normal(0.0, 0.08, 2))
        p = np.array([rng.uniform(-0.3, 0.3), rng.uniform(-0.2, 0.2), 1.0]) * distance_m
        observation = observed(eye.detect(seen_from(R, p, seed), hint(R, p + rng.normal(0.0, 0.03, 3))))
        error = np.array(observation.pad_position_camera_m) - p
        squares.append(error @ np.linalg.solve(np.array(observation.position_covariance_m2), error))
    assert np.mean(squares) <= 3.0


SMALL_PAD = config.Pad(markers=(config.Marker(id=45, size_m=0.4),))
SMALL = scenes.pad_texture(0.6, cv2.aruco.DICT_4X4_50, ((45, 0.4, (0.0, 0.0)),))


def test_what_is_known_keeps_the_mirrored_tilt_of_a_far_marker_out() -> None:
    """14 to 18 px in noisy pictures, tilts of 6 to 23 degrees, prediction off by 2. 10,000: benchmarks/detection.py."""
    eye, flips_without, seen = detector(pad=SMALL_PAD), 0, 0
    for k in range(24):
        rng = np.random.default_rng((8, k))
        tilt = rng.uniform(0.1, 0.4) * np.array([np.cos(k), np.sin(k)])
        R = scenes.looking_down(rng.uniform(-3.0, 3.0), *tilt)
        p = np.array([rng.uniform(-0.2, 0.2), rng.uniform(-0.2, 0.2), 1.0]) * rng.uniform(9.0, 12.0)
        frame = seen_from(R, p, k, SMALL, noise=12.0)
        turned = cv2.Rodrigues(rng.normal(0.0, 0.02, 3))[0] @ R
        near = DetectionHint(transform(turned, p + rng.normal(0.0, 0.03, 3)), 0.05, tuple(R[:, 2].tolist()))
        flips_without += is_flipped(eye.detect(frame, None), R)
        known = eye.detect(frame, near)
        seen += isinstance(known, PadObservation)
        assert not is_flipped(known, R)
    assert flips_without >= 3
    assert seen >= 22


def is_flipped(detection: object, R: np.ndarray) -> bool:
    """Off by more than noise can do."""
    if not isinstance(detection, PadObservation):
        return False
    sigma_deg = float(np.degrees(np.sqrt(np.trace(np.array(detection.rotation_covariance_rad2)))))
    return error_deg(detection, R) > max(3.0, 3.0 * sigma_deg)


def refuse_to_search(*_: object) -> list[search.Found]:
    raise AssertionError("searched")


@pytest.mark.parametrize(("sequence", "found"), [(1, False), (9, False), (10, True), (20, True)])
def test_one_frame_in_ten_is_searched_as_a_whole_where_the_marker_must_be_cut_too_far(
    sequence: int, found: bool
) -> None:
    """The prediction is wrong by 1.8 m: the marker lies whole in the other half of the picture."""
    R, p = scenes.looking_down(0.0), np.array([-0.5, 0.0, 1.5])
    texture = scenes.pad_texture(1.5, cv2.aruco.DICT_4X4_50, ((45, 1.2, (0.0, 0.0)),))
    frame = dataclasses.replace(seen_from(R, p, 4, texture), sequence=sequence)
    eye = detector(pad=config.Pad(markers=(config.Marker(id=45, size_m=1.2),)))
    assert isinstance(eye.detect(frame, hint(R, p + (1.8, 0.0, 0.0))), PadObservation) is found
    vague = hint(R, p + (1.8, 0.0, 0.0), sigma_m=0.2)
    assert isinstance(eye.detect(frame, vague), PadObservation)


def test_a_whole_marker_tells_the_shift_where_a_larger_one_is_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    R, p = scenes.looking_down(0.2), np.array([0.02, 0.0, 0.8])
    frame = seen_from(R, p, 6)
    monkeypatch.setattr(search, "at_level", refuse_to_search)
    observation = observed(detector().detect(frame, hint(R, p + (0.07, 0.05, 0.0))))
    assert 7 in observation.marker_ids
    assert error_m(observation, p) < 0.003


def test_the_whole_picture_is_searched_where_the_markers_of_the_region_give_no_pose(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    R, p = scenes.looking_down(0.2), np.array([0.1, 0.0, 2.0])
    eye = detector()
    nonsense = [search.Found(45, np.array([[10.0, 10.0], [60.0, 10.0], [200.0, 10.0], [90.0, 10.0]]), 0.9)]
    monkeypatch.setattr(eye, "_tracked", lambda grey, hint: {})
    monkeypatch.setattr(eye, "_in_region", lambda grey, where: nonsense)
    assert error_m(observed(eye.detect(seen_from(R, p, 7), hint(R, p))), p) < 0.007
