"""From the camera to the odometric frame: hand-written facts."""

import math

import pytest

from companion.config import Camera
from companion.estimation.measurement import (
    VehicleErrors,
    measurement_from_beacon,
    measurement_from_bearing,
    measurement_from_observation,
    measurement_from_range,
)
from companion.estimation.vehicle_history import VehiclePose
from companion.geometry import quaternion_from_euler
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
