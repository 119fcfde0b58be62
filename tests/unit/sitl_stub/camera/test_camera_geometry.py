"""Rendered edges lie where geometry written out by hand says, to a few hundredths of a pixel."""

import math
from dataclasses import replace

import numpy as np
import pytest
from edge_measurement import (
    body_from_world,
    down_camera,
    edge_offset,
    edge_offsets,
    marker_corners_P,
    pinhole_pixel,
    quaternion,
    rotation,
)

from sitl_stub.camera.camera import Camera
from sitl_stub.camera.projection import Intrinsics
from sitl_stub.camera.scene import CameraView, Scene
from sitl_stub.camera.spec import CameraSpec, Effects, stereo_pair
from sitl_stub.camera.stereo import StereoCamera
from sitl_stub.pad_layout import Marker, PadLayout

CLEAN = Effects(noise_sigma=0.0, shot_noise_sigma=0.0, motion_blur=False)
SPEC = CameraSpec(effects=CLEAN)
DECK = (0.0, 0.0, -0.5)


def view(position, angles=(0.0, 0.0, 0.0), deck=DECK, deck_angles=(0.0, 0.0, 0.0)):
    return CameraView(0, position, quaternion(*angles), deck, quaternion(*deck_angles))


def picture(spec, scene, seen):
    return Camera(spec, scene).render(seen, np.random.default_rng(1))


def corners_W(size, deck, deck_angles, centre=(0.0, 0.0), yaw=0.0):
    return [np.array(deck) + rotation(*deck_angles) @ p for p in marker_corners_P(size, centre, yaw)]


def down_pixels(points_W, position, angles):
    return np.array([pinhole_pixel(down_camera(body_from_world(p, position, angles))) for p in points_W])


VIEWS = [
    ((0.0, 0.0, -2.5), (0.0, 0.0, 0.0), (0.0, 0.0, -0.5), (0.0, 0.0, 0.0)),
    ((0.0, 0.0, -4.0), (0.05, -0.1, 0.3), (0.2, 0.4, -0.5), (0.0, 0.0, 1.1)),
    ((1.0, 2.0, -6.0), (-0.2, 0.15, -2.0), (1.5, 2.5, -0.5), (0.06, -0.04, 0.5)),
    ((0.0, 0.0, -8.0), (0.1, 0.1, 0.7), (1.0, -1.0, -0.5), (0.0, 0.0, -0.3)),
    ((0.0, 0.0, -12.0), (0.03, 0.02, 2.6), (1.0, -1.0, -0.5), (0.0, 0.0, 0.2)),
]


@pytest.mark.parametrize("height_m", [5.0, 9.0, 12.0, 13.0, 14.0, 16.0])
def test_a_pad_is_drawn_neither_too_large_nor_too_small_at_any_height(height_m):
    """A mean error of 0.02 px outwards on each side is 0.13 % of the marker's size from 16 m."""
    camera, rng = Camera(SPEC, Scene(PadLayout(length_m=3.0, width_m=3.0))), np.random.default_rng(3)
    offsets = []
    for _ in range(15):
        angles = (rng.normal(0.0, 0.05), rng.normal(0.0, 0.05), rng.uniform(-3.0, 3.0))
        position = (*(rng.uniform(-0.1, 0.1, 2) * height_m), -0.5 - height_m)
        expected = down_pixels(corners_W(1.2, DECK, (0.0, 0.0, 0.0)), position, angles)
        # From 16 m the marker's black border is 5 px wide: grey is read closer to the edge than elsewhere.
        offsets.append(edge_offsets(camera.render(view(position, angles), rng), expected, reach_px=4, level_px=2))
    assert abs(np.mean(offsets)) < 0.02


@pytest.mark.parametrize(("position", "angles", "deck", "deck_angles"), VIEWS)
def test_edges_of_the_large_marker_are_within_five_hundredths_of_a_pixel(position, angles, deck, deck_angles):
    image = picture(SPEC, Scene(), view(position, angles, deck, deck_angles))

    expected = down_pixels(corners_W(1.2, deck, deck_angles), position, angles)

    assert np.abs(edge_offsets(image, expected)).max() < 0.05


@pytest.mark.parametrize("height_m", [0.6, 0.9, 1.3])
def test_edges_of_the_nested_marker_are_within_five_hundredths_of_a_pixel(height_m):
    position, angles = (0.02, -0.03, -0.5 - height_m), (0.04, -0.03, 0.4)
    image = picture(SPEC, Scene(), view(position, angles))

    expected = down_pixels(corners_W(0.24, DECK, (0.0, 0.0, 0.0)), position, angles)

    assert np.abs(edge_offsets(image, expected)).max() < 0.05


def test_a_marker_placed_and_turned_on_the_deck_lies_where_the_pad_file_says():
    pad = PadLayout(markers=(Marker(3, 0.4, (0.35, -0.2), math.radians(25.0)),))
    position, angles = (0.0, 0.0, -2.3), (0.02, 0.05, 0.2)
    image = picture(SPEC, Scene(pad), view(position, angles))

    expected = down_pixels(corners_W(0.4, DECK, (0, 0, 0), (0.35, -0.2), math.radians(25.0)), position, angles)

    assert np.abs(edge_offsets(image, expected)).max() < 0.05


def brightest(image):
    rows, columns = np.nonzero(image > 235)
    return columns.mean(), rows.mean()


BARE = Scene(PadLayout(markers=(), length_m=0.6, width_m=0.6, deck_brightness=255.0), ground="asphalt")


@pytest.mark.parametrize(
    ("deck", "yaw_deg", "right_px", "down_px"),
    [
        ((0.0, 1.0, -0.5), 0.0, 1, 0),  # nose north, pad 1 m east: right of the centre
        ((1.0, 0.0, -0.5), 0.0, 0, -1),  # nose north, pad 1 m north: towards the top
        ((0.0, 1.0, -0.5), 90.0, 0, -1),  # nose east, pad 1 m east: towards the top
        ((1.0, 0.0, -0.5), 90.0, -1, 0),  # nose east, pad 1 m north: left
    ],
)
def test_a_pad_one_metre_aside_appears_on_the_side_where_it_is(deck, yaw_deg, right_px, down_px):
    image = picture(SPEC, BARE, view((0.0, 0.0, -5.0), (0.0, 0.0, math.radians(yaw_deg)), deck))

    column, row = brightest(image)

    one_metre_px = 420.0 / 4.45
    assert column == pytest.approx(375.5 + right_px * one_metre_px, abs=0.5)
    assert row == pytest.approx(239.5 + down_px * one_metre_px, abs=0.5)


def test_nose_up_moves_the_pad_below_towards_the_top_of_the_image():
    # Pitch up turns the camera's axis forward: what is straight below falls behind, towards the image's bottom.
    image = picture(SPEC, BARE, view((0.0, 0.0, -5.0), (0.0, 0.1, 0.0)))
    assert brightest(image)[1] == pytest.approx(239.5 + 420.0 * math.tan(0.1), abs=1.0)


def test_rolling_right_moves_the_pad_below_to_the_right_of_the_image():
    # Right wing down turns the camera's axis to the left of the vehicle.
    image = picture(SPEC, BARE, view((0.0, 0.0, -5.0), (0.1, 0.0, 0.0)))
    assert brightest(image)[0] == pytest.approx(375.5 + 420.0 * math.tan(0.1), abs=1.0)


@pytest.mark.parametrize(
    ("mount_deg", "deck", "right_px", "down_px"),
    [
        ((0.0, 90.0, 0.0), (6.0, 1.0, -1.0), 70.0, 280.0),  # looking north: 6 m ahead, 1 m right, 4 m down
        ((0.0, 45.0, 0.0), (4.0, 0.0, -1.0), 0.0, 0.0),  # half way: 4 m ahead and 4 m down is the middle
        ((0.0, 0.0, 90.0), (1.0, 0.0, -1.0), -105.0, 0.0),  # image top to the right wing: north is left
        ((45.0, 0.0, 0.0), (0.0, -4.0, -1.0), 0.0, 0.0),  # axis half way to the left wing: 4 m west is the middle
    ],
)
def test_mounts_turn_the_view_as_documented(mount_deg, deck, right_px, down_px):
    spec = replace(SPEC, mount_deg=mount_deg, position_frd_m=(0.0, 0.0, 0.0), height_px=800)

    column, row = brightest(picture(spec, BARE, view((0.0, 0.0, -5.0), deck=deck)))

    assert (column, row) == pytest.approx((375.5 + right_px, 239.5 + down_px), abs=2.0)


def test_the_right_camera_of_a_stereo_pair_sees_the_marker_to_the_left_by_the_disparity():
    left, right = stereo_pair(SPEC, 0.1)
    seen = view((0.0, 0.0, -2.55), (0.0, 0.0, 0.0))
    corners = down_pixels(corners_W(1.2, DECK, (0, 0, 0)), (0.0, 0.0, -2.55), (0.0, 0.0, 0.0))

    disparity = np.array([420.0 * 0.1 / 2.0, 0.0])

    assert np.abs(edge_offsets(picture(left, Scene(), seen), corners)).max() < 0.05
    assert np.abs(edge_offsets(picture(right, Scene(), seen), corners - disparity)).max() < 0.05


def test_a_stereo_frame_holds_the_left_picture_and_then_the_right_one():
    seen = view((0.0, 0.0, -2.55), (0.0, 0.0, 0.0))
    whole = replace(SPEC, width_px=2 * SPEC.width_px, stereo_baseline_m=0.1)

    frame = StereoCamera(whole, Scene()).render(seen, np.random.default_rng(1))

    left, right = (picture(eye, Scene(), seen) for eye in stereo_pair(SPEC, 0.1))
    assert (frame == np.hstack((left, right))).all()


def brown_conrady(p_C, f, centre, k1, k2, p1, p2, k3):
    x, y = p_C[0] / p_C[2], p_C[1] / p_C[2]
    r2 = x * x + y * y
    radial = 1 + k1 * r2 + k2 * r2 * r2 + k3 * r2 * r2 * r2
    return np.array(
        [
            centre[0] + f * (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)),
            centre[1] + f * (y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y),
        ]
    )


def kannala_brandt(p_C, f, centre, k1, k2, k3, k4):
    off_axis = math.hypot(p_C[0], p_C[1])
    t = math.atan2(off_axis, p_C[2])
    r = t + k1 * t**3 + k2 * t**5 + k3 * t**7 + k4 * t**9
    return np.array([centre[0] + f * r * p_C[0] / off_axis, centre[1] + f * r * p_C[1] / off_axis])


def polynomial_fisheye(p_C, centre, coefficients):
    """Bisection for the rho whose ray has the point's slope."""
    off_axis = math.hypot(p_C[0], p_C[1])
    low, high = 0.0, 2000.0
    for _ in range(80):
        rho = (low + high) / 2
        forward = sum(a * rho**i for i, a in enumerate(coefficients))
        low, high = (rho, high) if rho * p_C[2] < forward * off_axis else (low, rho)
    return np.array([centre[0] + rho * p_C[0] / off_axis, centre[1] + rho * p_C[1] / off_axis])


CENTRE = (371.0, 243.0)
RADTAN = (-0.28, 0.08, 0.0005, -0.0003, 0.001)
FISHEYE = (-0.01, 0.003, -0.0004, 0.0001)
POLYNOMIAL = (230.0, 0.0, -1.6e-3, 1.0e-7, -1.0e-10)
LENSES = {
    "pinhole": (Intrinsics(420.0, 420.0, *CENTRE, RADTAN), lambda p: brown_conrady(p, 420.0, CENTRE, *RADTAN)),
    "kannala_brandt": (
        Intrinsics(240.0, 240.0, *CENTRE, FISHEYE),
        lambda p: kannala_brandt(p, 240.0, CENTRE, *FISHEYE),
    ),
    "scaramuzza": (
        Intrinsics(cx_px=CENTRE[0], cy_px=CENTRE[1], distortion=POLYNOMIAL),
        lambda p: polynomial_fisheye(p, CENTRE, POLYNOMIAL),
    ),
}


def curved_offsets(image, corners_W_, position, angles, project):
    """Edges bend: measured piece by piece, each short enough to be straight."""
    offsets = []
    pixel = lambda p: project(down_camera(body_from_world(p, position, angles)))  # noqa: E731
    corners = np.array(corners_W_)
    middle = corners.mean(axis=0)
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        for i in range(1, 9):
            c, d = a + (b - a) * (i / 10), a + (b - a) * ((i + 1) / 10)
            offsets.append(edge_offset(image, pixel(c), pixel(d), pixel(middle)))
    return np.array(offsets)


@pytest.mark.parametrize("model", sorted(LENSES))
@pytest.mark.parametrize(("height_m", "east_m"), [(2.5, 0.3), (4.0, 2.5)])
def test_edges_lie_right_through_every_lens(model, height_m, east_m):
    intrinsics, project = LENSES[model]
    spec = replace(SPEC, model=model, intrinsics=intrinsics)
    position, angles, deck = (0.0, 0.0, -0.5 - height_m), (0.05, -0.08, 0.3), (0.4, east_m, -0.5)
    pad = PadLayout(markers=(Marker(45, 1.2),), length_m=2.4, width_m=2.4)

    image = picture(spec, Scene(pad), view(position, angles, deck, (0.0, 0.0, 0.35)))

    offsets = curved_offsets(image, corners_W(1.2, deck, (0.0, 0.0, 0.35)), position, angles, project)
    assert np.abs(offsets.reshape(4, -1).mean(axis=1)).max() < 0.05
    assert np.sqrt((offsets**2).mean()) < 0.06  # of pieces, where a bend drawn wrongly would show


def test_the_map_of_a_curved_lens_and_the_homography_draw_the_same_picture():
    seen = view((0.0, 0.0, -6.0), (0.1, -0.1, 0.2), (0.3, 0.2, -0.5))
    straight = picture(SPEC, Scene(), seen)
    still_rolling_shutter = replace(SPEC, effects=replace(CLEAN, readout_s=0.02))

    mapped = picture(still_rolling_shutter, Scene(), seen)

    difference = np.abs(straight.astype(int) - mapped)
    assert np.percentile(difference, 99) <= 8
    assert difference.mean() < 0.8
