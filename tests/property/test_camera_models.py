"""Lens models against their own derivatives, their inverses and OpenCV, on arbitrary directions."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.vision.camera_model import CameraModel, looking_at, unit_rows
from companion.vision.kannala_brandt import KannalaBrandt
from companion.vision.pinhole import Pinhole
from companion.vision.scaramuzza import Scaramuzza

BODY = {"width_px": 752, "height_px": 480, "fx_px": 422.27, "fy_px": 425.5, "cx_px": 371.2, "cy_px": 243.9}
RADTAN = (-0.28, 0.07, 0.0009, -0.0004, 0.002)
RATIONAL = (0.5, 0.1, -0.0003, 0.0005, 0.02, 0.7, 0.2, 0.03)
EQUIDISTANT = (-0.021, 0.004, -0.002, 0.0003)
OMNI = (210.0, 0.0, -1.2e-3, 8.0e-7, -1.0e-9)
LENSES: dict[str, CameraModel] = {
    "pinhole": Pinhole(**BODY),
    "pinhole radial-tangential": Pinhole(**BODY, distortion=RADTAN),
    "pinhole rational": Pinhole(**BODY, distortion=RATIONAL),
    "kannala_brandt": KannalaBrandt(**BODY, distortion=EQUIDISTANT),
    "scaramuzza": Scaramuzza(**BODY, distortion=OMNI),
}
each_lens = pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)


def reach_rad(lens: CameraModel) -> float:
    """How far off the axis the lens is asked."""
    if isinstance(lens, Pinhole):
        return 0.75
    return 1.8 if isinstance(lens, KannalaBrandt) else 1.7


def point(angle: float, phi: float, distance_m: float) -> np.ndarray:
    direction = np.array([np.sin(angle) * np.cos(phi), np.sin(angle) * np.sin(phi), np.cos(angle)])
    return distance_m * direction[None, :]


fractions = st.floats(0.0, 1.0)
turns = st.floats(-np.pi, np.pi)
distances = st.floats(0.2, 50.0)


@each_lens
@given(fraction=fractions, phi=turns, distance_m=distances)
@settings(max_examples=60, deadline=None)
def test_the_ray_of_a_projection_points_at_the_point(
    lens: CameraModel, fraction: float, phi: float, distance_m: float
) -> None:
    p = point(fraction * reach_rad(lens), phi, distance_m)
    ray = lens.ray(lens.project(p))[0]
    assert np.linalg.norm(ray) == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(ray, p[0] / distance_m, atol=1e-8)


@each_lens
@given(fraction=st.floats(0.001, 1.0), phi=turns, distance_m=distances)
@settings(max_examples=60, deadline=None)
def test_the_jacobian_is_the_finite_difference(
    lens: CameraModel, fraction: float, phi: float, distance_m: float
) -> None:
    p = point(fraction * reach_rad(lens), phi, distance_m)
    step = 1e-6 * distance_m
    moved = np.concatenate([p + step * np.eye(3)[i] for i in range(3)] + [p - step * np.eye(3)[i] for i in range(3)])
    pixels = lens.project(moved)
    numeric = (pixels[:3] - pixels[3:]).T / (2.0 * step)
    analytic = lens.jacobian(p)[0]
    np.testing.assert_allclose(analytic, numeric, atol=2e-4 * max(1.0, float(np.abs(numeric).max())))


@each_lens
def test_the_jacobian_holds_on_the_optical_axis(lens: CameraModel) -> None:
    p = np.array([[0.0, 0.0, 2.0]])
    J = lens.jacobian(p)[0]
    numeric = (lens.project(p + [1e-5, 0.0, 0.0]) - lens.project(p - [1e-5, 0.0, 0.0]))[0] / 2e-5
    np.testing.assert_allclose(J[:, 0], numeric, rtol=1e-4, atol=1e-3)
    np.testing.assert_allclose(J[:, 2], 0.0, atol=1e-9)
    np.testing.assert_allclose(lens.project(p)[0], (BODY["cx_px"], BODY["cy_px"]), atol=1e-9)


@pytest.mark.parametrize("distortion", [(), RADTAN[:4], RADTAN, RATIONAL])
@given(fraction=fractions, phi=turns, distance_m=distances)
@settings(max_examples=40, deadline=None)
def test_pinhole_projects_as_opencv_does(
    distortion: tuple[float, ...], fraction: float, phi: float, distance_m: float
) -> None:
    p = point(fraction * 0.7, phi, distance_m)
    K = np.array([[BODY["fx_px"], 0, BODY["cx_px"]], [0, BODY["fy_px"], BODY["cy_px"]], [0, 0, 1.0]])
    theirs = cv2.projectPoints(p, np.zeros(3), np.zeros(3), K, np.array(distortion) if distortion else None)[0]
    np.testing.assert_allclose(Pinhole(**BODY, distortion=distortion).project(p), theirs[:, 0], atol=1e-6)


@given(fraction=st.floats(0.01, 1.0), phi=turns, distance_m=distances)
@settings(max_examples=40, deadline=None)
def test_kannala_brandt_projects_as_opencvs_fisheye_does(fraction: float, phi: float, distance_m: float) -> None:
    p = point(fraction * 1.4, phi, distance_m)
    K = np.array([[BODY["fx_px"], 0, BODY["cx_px"]], [0, BODY["fy_px"], BODY["cy_px"]], [0, 0, 1.0]])
    theirs = cv2.fisheye.projectPoints(p[None], np.zeros(3), np.zeros(3), K, np.array(EQUIDISTANT))[0]
    np.testing.assert_allclose(LENSES["kannala_brandt"].project(p), theirs[0], atol=1e-6)


@given(angle=st.floats(0.0, 3.1), phi=turns)
@settings(max_examples=60, deadline=None)
def test_a_frame_that_looks_at_a_direction_has_it_as_its_axis(angle: float, phi: float) -> None:
    direction = point(angle, phi, 3.0)[0]
    R_VC = looking_at(direction)
    np.testing.assert_allclose(R_VC @ R_VC.T, np.eye(3), atol=1e-9)
    np.testing.assert_allclose(R_VC @ unit_rows(direction[None])[0], (0.0, 0.0, 1.0), atol=1e-9)


def test_a_pinhole_sees_nothing_behind_itself() -> None:
    assert np.isnan(LENSES["pinhole"].project(np.array([[0.1, 0.1, -1.0]]))).all()


def test_a_wide_lens_sees_a_point_beside_it() -> None:
    pixel = LENSES["scaramuzza"].project(np.array([[1.0, 0.0, 0.0]]))[0]
    f = OMNI[0] + sum(a * (pixel[0] - BODY["cx_px"]) ** k for k, a in enumerate(OMNI[1:], start=1))
    assert f == pytest.approx(0.0, abs=1e-6)
    assert pixel[1] == pytest.approx(BODY["cy_px"])


@pytest.mark.parametrize(
    ("lens", "distortion"), [(Pinhole, (0.1,)), (KannalaBrandt, (0.1, 0.2)), (Scaramuzza, ()), (Scaramuzza, (0.0,) * 5)]
)
def test_a_wrong_number_of_coefficients_is_refused(lens: type[Pinhole], distortion: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match="coefficients"):
        lens(**BODY, distortion=distortion)
