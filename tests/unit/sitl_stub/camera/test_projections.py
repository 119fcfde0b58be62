"""Lens models alone: rays and pixels are inverse to each other, and wrong coefficients are refused."""

import numpy as np
import pytest

from sitl_stub.camera import PROJECTIONS
from sitl_stub.camera.mount import mount_rotation
from sitl_stub.camera.projection import Intrinsics
from sitl_stub.camera.spec import CameraSpec, stereo_pair

LENSES = [
    ("pinhole", Intrinsics()),
    ("pinhole", Intrinsics(distortion=(-0.28, 0.08, 0.0005, -0.0003))),
    ("pinhole", Intrinsics(422.27, 422.88, 425.83, 239.86, (0.0028, -0.0041, 0.00034, 0.00036, 0.000766))),
    ("kannala_brandt", Intrinsics(240.0, 238.0, 370.0, 241.0, (-0.01, 0.003, -0.0004, 0.0001))),
    ("scaramuzza", Intrinsics(cx_px=370.0, cy_px=241.0, distortion=(230.0, 0.0, -1.6e-3, 1e-7, -1e-10))),
]


@pytest.mark.parametrize(("model", "intrinsics"), LENSES)
def test_a_ray_projects_back_to_its_pixel(model, intrinsics):
    pixels = np.random.default_rng(1).uniform((0.0, 0.0), (751.0, 479.0), (500, 2))
    projection = PROJECTIONS[model](intrinsics)

    rays = projection.rays(pixels)

    assert np.linalg.norm(rays, axis=1) == pytest.approx(np.ones(500))
    assert np.abs(projection.project(rays * 3.0) - pixels).max() < 1e-6


@pytest.mark.parametrize(("model", "intrinsics"), LENSES)
def test_the_centre_pixel_looks_along_the_axis(model, intrinsics):
    centre = np.array([[intrinsics.cx_px, intrinsics.cy_px]])
    assert PROJECTIONS[model](intrinsics).rays(centre) == pytest.approx(np.array([[0.0, 0.0, 1.0]]))


def test_a_pinhole_does_not_see_behind_itself():
    assert np.isnan(PROJECTIONS["pinhole"](Intrinsics()).project(np.array([[0.1, 0.2, -1.0]]))).all()


def test_fisheyes_see_beyond_a_right_angle():
    sideways = np.array([[1.0, 0.0, -0.1]])
    for model, intrinsics in LENSES[3:]:
        assert np.isfinite(PROJECTIONS[model](intrinsics).project(sideways)).all()


@pytest.mark.parametrize(
    ("model", "distortion"),
    [
        ("pinhole", (0.1,)),
        ("kannala_brandt", (0.1,) * 5),
        ("scaramuzza", ()),
        ("scaramuzza", (-230.0, 0.0, 1e-3, 0.0, 0.0)),
    ],
)
def test_coefficients_that_do_not_fit_the_model_are_refused(model, distortion):
    with pytest.raises(ValueError, match=model):
        PROJECTIONS[model](Intrinsics(distortion=distortion))


@pytest.mark.parametrize(
    ("mount_deg", "right_B", "down_B", "forward_B"),
    [
        ((0, 0, 0), (0, 1, 0), (-1, 0, 0), (0, 0, 1)),
        ((0, 90, 0), (0, 1, 0), (0, 0, 1), (1, 0, 0)),
        ((0, 0, 90), (-1, 0, 0), (0, -1, 0), (0, 0, 1)),
        ((90, 0, 0), (0, 0, 1), (-1, 0, 0), (0, -1, 0)),
        ((0, 90, 90), (-1, 0, 0), (0, 0, 1), (0, 1, 0)),
    ],
)
def test_mount_angles_place_the_camera_axes_in_the_body_as_documented(mount_deg, right_B, down_B, forward_B):
    assert mount_rotation(mount_deg) == pytest.approx(np.array([right_B, down_B, forward_B]).T, abs=1e-12)


def test_the_second_camera_of_a_stereo_pair_sits_along_the_image_of_the_first():
    left, right = stereo_pair(CameraSpec(mount_deg=(0.0, 90.0, 0.0), position_frd_m=(0.1, -0.025, 0.0)), 0.05)
    assert right.position_frd_m == pytest.approx((0.1, 0.025, 0.0))
    assert (left.name, right.name) == ("down_left", "down_right")
