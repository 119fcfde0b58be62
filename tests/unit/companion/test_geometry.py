"""Frames and rotations against facts that a person can check."""

from __future__ import annotations

import math

import pytest

from companion.geometry import (
    Q_FRD_CAMERA_DOWN,
    Transform,
    euler_from_quaternion,
    matrix_from_quaternion,
    quaternion_from_euler,
    quaternion_from_matrix,
    quaternion_normalized,
    rotate,
    rotated_covariance,
    slerp,
    wrap_pi,
    yaw_of,
)

EAST_FACING = quaternion_from_euler(0.0, 0.0, math.pi / 2)


def test_nose_of_a_vehicle_that_faces_east_points_east() -> None:
    assert rotate(EAST_FACING, (1.0, 0.0, 0.0)) == pytest.approx((0.0, 1.0, 0.0))


def test_pad_one_metre_east_of_a_vehicle_with_nose_north_is_to_the_right() -> None:
    X_WB = Transform(quaternion_from_euler(0.0, 0.0, 0.0), (10.0, 20.0, -5.0))
    assert X_WB.inverse().point((10.0, 21.0, -5.0)) == pytest.approx((0.0, 1.0, 0.0))


def test_positive_pitch_lifts_the_nose() -> None:
    nose = rotate(quaternion_from_euler(0.0, 0.2, 0.0), (1.0, 0.0, 0.0))
    assert nose[2] < 0.0


def test_positive_roll_lowers_the_right_side() -> None:
    right = rotate(quaternion_from_euler(0.2, 0.0, 0.0), (0.0, 1.0, 0.0))
    assert right[2] > 0.0


def test_down_looking_camera_sees_the_nose_at_the_top_of_its_image_and_right_at_the_right() -> None:
    to_camera = Transform(Q_FRD_CAMERA_DOWN).inverse()
    assert to_camera.point((1.0, 0.0, 0.0)) == pytest.approx((0.0, -1.0, 0.0))
    assert to_camera.point((0.0, 1.0, 0.0)) == pytest.approx((1.0, 0.0, 0.0))
    assert to_camera.point((0.0, 0.0, 1.0)) == pytest.approx((0.0, 0.0, 1.0))


def test_pose_chain_brings_a_pad_seen_in_the_camera_to_the_world() -> None:
    X_WB = Transform(EAST_FACING, (100.0, 50.0, -10.0))
    X_BC = Transform(Q_FRD_CAMERA_DOWN, (0.0, 0.0, 0.1))
    p_CP = (2.0, -3.0, 9.4)  # 2 m right in the image is south, 3 m up in the image is east
    assert (X_WB @ X_BC).point(p_CP) == pytest.approx((98.0, 53.0, -0.5))


@pytest.mark.parametrize(
    ("angle", "wrapped"), [(math.pi, math.pi), (-math.pi, math.pi), (3.5 * math.pi, -0.5 * math.pi), (0.0, 0.0), (-7.0, -7.0 + 2 * math.pi)]
)  # fmt: skip
def test_wrapped_angle_lies_in_minus_pi_to_pi(angle: float, wrapped: float) -> None:
    assert wrap_pi(angle) == pytest.approx(wrapped)


@pytest.mark.parametrize("euler", [(0.1, -0.2, 3.0), (-3.0, 0.4, -1.0), (0.0, 1.5, 2.0), (3.1, 0.0, -3.1)])
def test_euler_angles_survive_the_quaternion_and_the_matrix(euler: tuple[float, float, float]) -> None:
    q = quaternion_from_matrix(matrix_from_quaternion(quaternion_from_euler(*euler)))
    assert euler_from_quaternion(q) == pytest.approx(euler, abs=1e-9)


def test_matrix_and_quaternion_rotate_alike() -> None:
    q = quaternion_from_euler(0.3, -0.7, 2.0)
    R = matrix_from_quaternion(q)
    v = (0.2, -1.0, 3.0)
    assert rotate(q, v) == pytest.approx(tuple(sum(R[i][k] * v[k] for k in range(3)) for i in range(3)))


def test_slerp_takes_the_shorter_way_and_meets_both_ends() -> None:
    a, b = quaternion_from_euler(0.0, 0.0, 3.0), quaternion_from_euler(0.0, 0.0, -3.0)
    assert abs(wrap_pi(yaw_of(slerp(a, b, 0.5)) - math.pi)) < 1e-9
    assert slerp(a, b, 0.0) == pytest.approx(a)
    assert slerp(a, b, 1.0) == pytest.approx(b)


def test_covariance_turns_with_its_frame() -> None:
    turned = rotated_covariance(
        matrix_from_quaternion(EAST_FACING), ((4.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 9.0))
    )
    assert turned[0][0] == pytest.approx(1.0)
    assert turned[1][1] == pytest.approx(4.0)
    assert turned[2][2] == pytest.approx(9.0)


def test_zero_quaternion_is_refused() -> None:
    with pytest.raises(ValueError, match="not a rotation"):
        quaternion_normalized((0.0, 0.0, 0.0, 0.0))
