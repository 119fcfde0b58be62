"""From the camera to the odometric frame: hand-written facts."""

import math

import numpy as np
import pytest

from companion.config import Camera
from companion.estimation.measurement import (
    PadMeasurement,
    VehicleErrors,
    measurement_from_beacon,
    measurement_from_bearing,
    measurement_from_observation,
    measurement_from_range,
)
from companion.estimation.vehicle_history import VehiclePose
from companion.geometry import (
    Transform,
    euler_from_quaternion,
    quaternion_conjugate,
    quaternion_from_euler,
    quaternion_multiply,
    quaternion_normalized,
)
from companion.messages import PadBeacon, PadBearing, PadObservation, Vec3
from companion.mount import mounted

DOWN = mounted(Camera(position_frd_m=(0.0, 0.0, 0.0)))
EXACT = VehicleErrors(0.0, 0.0, 0.0)
NOISE = ((1e-4, 0.0, 0.0), (0.0, 4e-4, 0.0), (0.0, 0.0, 9e-4))


def vehicle(yaw_deg: float = 0.0, pitch_deg: float = 0.0, offset: Vec3 = (0.0, 0.0, 0.0)) -> VehiclePose:
    q = quaternion_from_euler(0.0, math.radians(pitch_deg), math.radians(yaw_deg))
    return VehiclePose(0, (10.0, 20.0, -5.0), offset, (0.0, 0.0, 0.0), q, (0.0, 0.0, 0.0))


def seen(position_camera: Vec3) -> PadObservation:
    return PadObservation(0, "down", "test", position_camera, NOISE)


def test_image_top_is_ahead_of_a_nose_north_vehicle() -> None:
    m = measurement_from_observation(seen((0.0, -1.0, 4.0)), vehicle(), DOWN, EXACT)
    assert m.position_o_m == pytest.approx((11.0, 20.0, -1.0))


def test_image_right_is_south_of_a_nose_east_vehicle() -> None:
    m = measurement_from_observation(seen((1.0, 0.0, 4.0)), vehicle(yaw_deg=90.0), DOWN, EXACT)
    assert m.position_o_m == pytest.approx((9.0, 20.0, -1.0))


def test_a_pad_in_the_middle_of_the_image_is_ahead_of_a_vehicle_that_pitches_up() -> None:
    m = measurement_from_observation(seen((0.0, 0.0, 4.0)), vehicle(pitch_deg=30.0), DOWN, EXACT)
    assert m.position_o_m == pytest.approx((12.0, 20.0, -5.0 + 4.0 * math.cos(math.radians(30.0))))


def test_the_covariance_turns_with_the_camera() -> None:
    m = measurement_from_observation(seen((0.0, 0.0, 4.0)), vehicle(), DOWN, EXACT)
    assert m.covariance_m2 is not None
    assert [m.covariance_m2[i][i] for i in range(3)] == pytest.approx([4e-4, 1e-4, 9e-4])


def test_attitude_error_is_range_times_tilt() -> None:
    m = measurement_from_observation(seen((0.0, 0.0, 8.0)), vehicle(), DOWN, VehicleErrors(0.02, 0.05, 0.0))
    assert m.systematic_sigma_m == pytest.approx(0.16)


def turned_pad(covariance_deg2: Vec3, camera: Transform, pad_rpy_deg: Vec3) -> PadMeasurement:
    """A pad at that roll, pitch and yaw, seen from a level vehicle, nose north, with that much doubt about each axis of the camera."""
    roll, pitch, yaw = (math.radians(angle) for angle in pad_rpy_deg)
    x, y, z = (variance * math.radians(1.0) ** 2 for variance in covariance_deg2)
    doubt = ((x, 0.0, 0.0), (0.0, y, 0.0), (0.0, 0.0, z))
    q_CP = quaternion_multiply(quaternion_conjugate(camera.q), quaternion_from_euler(roll, pitch, yaw))
    return measurement_from_observation(
        PadObservation(0, "down", "test", (0.0, 0.0, 4.0), NOISE, q_CP, doubt), vehicle(), camera, EXACT
    )


def test_doubt_about_the_axis_of_a_camera_that_looks_down_is_doubt_of_the_yaw() -> None:
    m = turned_pad((1.0, 4.0, 9.0), DOWN, (0.0, 0.0, 30.0))
    assert math.degrees(m.yaw_sigma_rad) == pytest.approx(3.0)
    assert math.degrees(m.tilt_sigma_rad) == pytest.approx(
        math.sqrt(4.0 * 0.75 + 1.0 * 0.25)
    )  # camera x is east, y south


def test_doubt_about_the_axis_of_a_camera_that_looks_forward_is_doubt_of_the_tilt() -> None:
    forward = mounted(Camera(position_frd_m=(0.0, 0.0, 0.0), mount_deg=(0.0, 90.0, 0.0)))
    m = turned_pad((1.0, 4.0, 9.0), forward, (0.0, 0.0, 0.0))
    assert math.degrees(m.yaw_sigma_rad) == pytest.approx(2.0)  # the image's down is down
    assert math.degrees(m.tilt_sigma_rad) == pytest.approx(3.0)


def test_the_angles_of_a_tilted_pad_are_as_doubtful_as_turns_of_it_make_them() -> None:
    """Against 20,000 small turns about the axes of a camera that looks ahead and down."""
    camera, rng = mounted(Camera(position_frd_m=(0.0, 0.0, 0.0), mount_deg=(5.0, 40.0, 10.0))), np.random.default_rng(3)
    angles = tuple(math.radians(angle) for angle in (6.0, 12.0, 50.0))
    m = turned_pad((1.0, 4.0, 9.0), camera, (6.0, 12.0, 50.0))
    turns = np.radians(rng.normal(0.0, (1.0, 2.0, 3.0), (20_000, 3)))
    q_CO = quaternion_conjugate(camera.q)
    drawn = []
    for x, y, z in turns.tolist():
        turn_O = quaternion_multiply(
            quaternion_multiply(camera.q, quaternion_normalized((1.0, x / 2, y / 2, z / 2))), q_CO
        )
        drawn.append(euler_from_quaternion(quaternion_multiply(turn_O, quaternion_from_euler(*angles))))
    roll, pitch, yaw = np.std(drawn, axis=0).tolist()
    assert m.yaw_sigma_rad == pytest.approx(yaw, rel=0.03)
    assert m.tilt_sigma_rad == pytest.approx(max(roll, pitch), rel=0.03)


def test_a_forward_camera_looks_forward() -> None:
    mount = mounted(Camera(position_frd_m=(0.2, 0.0, 0.0), mount_deg=(0.0, 90.0, 0.0)))
    m = measurement_from_bearing(PadBearing(0, "front", "test", (0.0, 0.0, 1.0), 0.01), vehicle(), mount, EXACT)
    assert m.bearing_o == pytest.approx((1.0, 0.0, 0.0))
    assert m.camera is not None
    assert m.camera.position_o_m == pytest.approx((10.2, 20.0, -5.0))


def test_a_beacon_is_moved_by_the_offset_of_the_frames() -> None:
    report = PadBeacon(0, "gps", (1.0, 2.0, 3.0), (1.0, 0.0, 0.0), None, 1.5, 0.3)
    m = measurement_from_beacon(
        report, vehicle(offset=(0.5, 0.0, -1.0)), noise_sigma_m=0.3, errors=VehicleErrors(0.0, 0.0, 0.4)
    )
    assert m.position_o_m == pytest.approx((0.5, 2.0, 4.0))
    assert m.bias_sigma_m == 1.5
    assert m.velocity_sigma_m_s == pytest.approx(0.5)


def test_range_along_a_tilted_axis_is_shortened() -> None:
    m = measurement_from_range(0, 4.0, vehicle(pitch_deg=60.0))
    assert m.height_o_m == pytest.approx(-3.0)
