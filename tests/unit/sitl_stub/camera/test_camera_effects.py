"""What light, lens, sensor and faults do to a picture."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
from edge_measurement import down_camera, edge_offset, pinhole_pixel, quaternion

from sitl_stub.camera.camera import Camera
from sitl_stub.camera.light import NIGHT, Glare, Light, Patch, Shadow
from sitl_stub.camera.motion import line_kernel
from sitl_stub.camera.noise import add_noise
from sitl_stub.camera.projection import Intrinsics
from sitl_stub.camera.scene import CameraView, Scene
from sitl_stub.camera.spec import CameraSpec, Effects
from sitl_stub.pad_layout import PadLayout

CLEAN = Effects(noise_sigma=0.0, shot_noise_sigma=0.0, motion_blur=False)
SPEC = CameraSpec(effects=CLEAN)
BARE = Scene(PadLayout(markers=()), ground="asphalt")
OVERHEAD = CameraView(0, (0.0, 0.0, -2.55), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, -0.5))
PX_PER_M = 210.0


def picture(seen=OVERHEAD, spec=SPEC, scene=BARE, seed=1):
    return Camera(spec, scene).render(seen, np.random.default_rng(seed))


def lit(**light):
    return replace(OVERHEAD, light=Light(**light))


def test_same_view_and_seed_give_the_same_bytes_and_another_seed_does_not():
    noisy = replace(SPEC, effects=Effects())
    assert np.array_equal(picture(spec=noisy, seed=5), picture(spec=noisy, seed=5))
    assert not np.array_equal(picture(spec=noisy, seed=5), picture(spec=noisy, seed=6))


def test_a_frame_does_not_depend_on_the_frames_before_it():
    camera = Camera(SPEC, BARE)
    camera.render(replace(OVERHEAD, vehicle_position_ned_m=(5.0, 5.0, -9.0)), np.random.default_rng(1))

    assert np.array_equal(camera.render(OVERHEAD, np.random.default_rng(2)), picture(seed=2))


def test_every_frame_draws_as_often_from_its_generator_whatever_it_shows():
    left = []
    for seen, effects in ((OVERHEAD, CLEAN), (replace(OVERHEAD, is_black=True), Effects())):
        rng = np.random.default_rng(3)
        Camera(replace(SPEC, effects=effects), BARE).render(seen, rng)
        left.append(rng.random())
    assert left[0] == left[1]


def test_noise_has_the_sigma_of_sensor_and_light_and_no_bias():
    grey = np.full((480, 752), 128, np.uint8)
    noisy = add_noise(grey.copy(), 1.5, 3.0, np.random.default_rng(1)).astype(float)

    assert noisy.std() == pytest.approx(math.sqrt(1.5**2 + 3.0**2 * 128 / 255), rel=0.03)
    assert noisy.mean() == pytest.approx(128.0, abs=0.05)


def test_noise_of_two_frames_is_not_the_same_noise():
    grey = np.full((480, 752), 128, np.uint8)
    rng = np.random.default_rng(1)
    first, second = (add_noise(grey.copy(), 2.0, 0.0, rng).astype(float) - 128 for _ in range(2))

    assert abs((first * second).mean()) / (first.std() * second.std()) < 0.02


def test_night_is_dark_and_noisier_for_its_light():
    noisy = replace(SPEC, effects=Effects())
    day, night = picture(spec=noisy), picture(replace(OVERHEAD, light=NIGHT), spec=noisy)
    deck = (slice(150, 330), slice(290, 460))

    assert night[deck].mean() < 0.15 * day[deck].mean()
    assert night[deck].std() / night[deck].mean() > 5.0 * day[deck].std() / day[deck].mean()


def test_overexposure_burns_the_paper_out():
    assert (picture(lit(brightness=1.6))[200:280, 300:450] == 255).all()


def test_a_shadow_falls_on_its_side_of_the_edge_only():
    plain, shaded = picture().astype(float), picture(lit(shadow=Shadow(0.0, 0.2, 0.4))).astype(float)
    edge_row = 239.5 - 0.2 * PX_PER_M  # P x is up in this image

    up, down = round(edge_row) - 6, round(edge_row) + 6
    assert shaded[up, 300:450].mean() == pytest.approx(0.4 * plain[up, 300:450].mean(), rel=0.02)
    assert np.array_equal(shaded[down, 300:450], plain[down, 300:450])
    assert shaded[5, 20:200].mean() == pytest.approx(0.4 * plain[5, 20:200].mean(), rel=0.03)  # the ground too


def test_glare_is_brightest_where_it_was_put():
    dark_deck = Scene(PadLayout(markers=(), deck_brightness=60.0), ground="asphalt")
    glaring = picture(lit(glare=Glare((0.3, -0.2), 0.1, 0.7)), scene=dark_deck).astype(float)
    added = glaring - picture(scene=dark_deck)

    row, column = np.unravel_index(cv2.GaussianBlur(added, (0, 0), 3).argmax(), added.shape)
    assert (column, row) == pytest.approx((375.5 - 0.2 * PX_PER_M, 239.5 - 0.3 * PX_PER_M), abs=2.0)
    assert added.max() == pytest.approx(0.7 * 255, abs=3)


def test_a_cover_hides_the_marker():
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50))
    covered = replace(OVERHEAD, covers=(Patch((0.0, 0.0), (1.3, 1.3)),))

    assert detector.detectMarkers(picture(OVERHEAD, scene=Scene()))[1] is not None
    assert detector.detectMarkers(picture(covered, scene=Scene()))[1] is None


def test_a_black_camera_shows_nothing_but_noise():
    black = picture(replace(OVERHEAD, is_black=True), spec=replace(SPEC, effects=Effects()))
    assert black.max() < 12
    assert black.std() > 0.3


def test_vignetting_darkens_the_corners_by_what_was_asked():
    bright = lit(brightness=1.0)
    plain = picture(bright).astype(float)
    vignetted = picture(bright, spec=replace(SPEC, effects=replace(CLEAN, vignetting=0.4))).astype(float)

    assert vignetted[:6, :6].sum() / plain[:6, :6].sum() == pytest.approx(0.6, abs=0.03)
    assert vignetted[235:245, 370:380].sum() / plain[235:245, 370:380].sum() == pytest.approx(1.0, abs=0.01)


def test_compression_changes_the_picture_a_little():
    plain = picture(scene=Scene()).astype(float)
    compressed = picture(scene=Scene(), spec=replace(SPEC, effects=replace(CLEAN, jpeg_quality=70)))

    assert 0.5 < np.abs(plain - compressed).mean() < 6.0


def edge_width(image, row=239):
    """Distance between 10 and 90 % along the deck's right edge."""
    profile = image[row, 500:560].astype(float)
    low, high = profile[-8:].mean(), profile[:8].mean()
    share = (profile - low) / (high - low)
    return float(np.interp(-0.1, -share, np.arange(60)) - np.interp(-0.9, -share, np.arange(60)))


def test_sideways_motion_smears_an_edge_by_its_path_during_the_exposure():
    moving = replace(OVERHEAD, vehicle_velocity_ned_m_s=(0.0, 3.0, 0.0))
    blurred = replace(SPEC, exposure_s=0.012, effects=replace(CLEAN, motion_blur=True))
    path_px = 3.0 * 0.012 * PX_PER_M
    box = Scene(PadLayout(markers=(), deck_height_m=0.0), ground="asphalt")

    sharp, smeared = edge_width(picture(scene=box)), edge_width(picture(moving, spec=blurred, scene=box))

    assert sharp < 1.5
    assert smeared == pytest.approx(0.8 * path_px, abs=1.0)


def test_a_deck_that_moves_with_the_vehicle_stays_sharp_over_a_smeared_ground():
    together = replace(OVERHEAD, vehicle_velocity_ned_m_s=(0.0, 6.0, 0.0), deck_velocity_ned_m_s=(0.0, 6.0, 0.0))
    blurred = replace(SPEC, exposure_s=0.01, effects=replace(CLEAN, motion_blur=True))
    plain, smeared = picture(scene=Scene()), picture(together, spec=blurred, scene=Scene())

    assert np.array_equal(plain[150:330, 290:460], smeared[150:330, 290:460])
    texture = [np.diff(image[:, :150].astype(float), axis=1).std() for image in (plain, smeared)]
    assert texture[1] < 0.6 * texture[0]


@pytest.mark.parametrize("path", [(3.0, 0.0), (0.0, -5.5), (4.2, 2.1), (0.5, 0.2)])
def test_a_motion_kernel_sums_to_one_is_centred_and_as_long_as_the_path(path):
    kernel = line_kernel(np.array(path))
    rows, columns = np.indices(kernel.shape)
    x, y = columns - kernel.shape[1] // 2, rows - kernel.shape[0] // 2

    assert kernel.sum() == pytest.approx(1.0)
    assert ((kernel * x).sum(), (kernel * y).sum()) == pytest.approx((0.0, 0.0), abs=1e-9)
    spread = (kernel * (x * path[0] + y * path[1]) ** 2).sum() / (path[0] ** 2 + path[1] ** 2)
    length = math.hypot(*path)
    # A uniform line has length^2 / 12; bilinear samples add at most a sixth, or a quarter on the diagonal.
    assert length**2 / 12 * 0.95 < spread < length**2 / 12 + 0.26


def test_a_rolling_shutter_shifts_each_row_by_the_motion_since_mid_exposure():
    readout_s, speed_m_s = 0.03, 2.0
    rolling = replace(SPEC, effects=replace(CLEAN, readout_s=readout_s))
    moving = replace(OVERHEAD, vehicle_velocity_ned_m_s=(0.0, speed_m_s, 0.0))
    image = picture(moving, spec=rolling, scene=Scene())

    def right_edge(row):
        late_s = (row - 239.5) / 479.0 * readout_s
        return np.array([375.5 + (0.6 - speed_m_s * late_s) * PX_PER_M, row])

    for row in (140.0, 239.0, 338.0):
        above, below = right_edge(row - 20.0), right_edge(row + 20.0)
        assert edge_offset(image, above, below, np.array([375.5, row])) == pytest.approx(0.0, abs=0.05)


def test_a_rolling_shutter_on_a_turning_vehicle_follows_the_attitude_of_each_row():
    readout_s, yaw_rate = 0.03, 1.5
    rolling = replace(SPEC, effects=replace(CLEAN, readout_s=readout_s))
    turning = replace(OVERHEAD, vehicle_angular_velocity_frd_rad_s=(0.0, 0.0, yaw_rate))
    small = Scene(PadLayout(markers=(), length_m=0.1, width_m=0.1, deck_height_m=0.0, deck_brightness=255.0))
    deck = (0.8, 0.0, -0.5)
    image = picture(replace(turning, deck_position_ned_m=deck), spec=rolling, scene=small)

    p = down_camera(np.array(deck) - (0.0, 0.0, -2.55))
    row = pinhole_pixel(p)[1]
    late_s = (row - 239.5) / 479.0 * readout_s
    turned = quaternion(0.0, 0.0, yaw_rate * late_s)
    heading = 2.0 * math.atan2(turned[3], turned[0])
    expected = 375.5 + PX_PER_M * 0.8 * math.sin(-heading)
    rows, columns = np.nonzero(image > 235)
    assert columns.mean() == pytest.approx(expected, abs=0.15)
    assert rows.mean() == pytest.approx(row, abs=0.6)


def test_the_horizon_lies_level_ahead_and_the_sky_above_it():
    forward = replace(SPEC, mount_deg=(0.0, 90.0, 0.0))
    image = picture(CameraView(0, (0.0, 0.0, -2.0), (1.0, 0.0, 0.0, 0.0), (-50.0, 0.0, -0.5)), spec=forward)

    assert (image[:238] == 212).all()
    assert image[260:].mean() < 140


def test_a_colour_camera_sees_the_red_target_red_and_where_it_is():
    pad = PadLayout(family="RED_DISC", deck_brightness=200.0, markers=(PadLayout().markers[0],))
    fisheye = replace(
        SPEC, colour=True, model="scaramuzza", intrinsics=Intrinsics(distortion=(230.0, 0.0, -1.6e-3, 1e-7, -1e-10))
    )
    blue, green, red = cv2.split(picture(spec=fisheye, scene=Scene(pad)).astype(int))

    rows, columns = np.nonzero((red > 2 * green) & (red > 2 * blue) & (red > 100))
    assert (columns.mean(), rows.mean()) == pytest.approx((375.5, 239.5), abs=0.3)
    rho_px = 66.9  # root of rho = 0.3 (230 - 1.6e-3 rho^2): a radius of 0.6 m from 2 m away
    assert len(rows) == pytest.approx(math.pi * rho_px**2, rel=0.03)
