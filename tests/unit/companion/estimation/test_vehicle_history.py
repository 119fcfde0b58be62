"""Pose at capture time and the odometric frame."""

import math

import pytest

from companion.estimation.vehicle_history import VehicleHistory
from companion.geometry import quaternion_from_euler, yaw_of
from companion.messages import Vec3, VehicleState

STEP_NS = 20_000_000


def state(k: int, position: Vec3, velocity: Vec3 = (1.0, 0.0, 0.0), yaw: float = 0.0, resets: int = 0) -> VehicleState:
    return VehicleState(k * STEP_NS, position, velocity, quaternion_from_euler(0.0, 0.0, yaw), (0.0, 0.0, 0.5), resets)


def moving(count: int = 10) -> VehicleHistory:
    """North at 1 m/s while turning at 0.5 rad/s, seen without error."""
    history = VehicleHistory(1.0)
    for k in range(count):
        history.add(state(k, (0.02 * k, 0.0, -5.0), yaw=0.01 * k))
    return history


def test_pose_between_two_samples_is_interpolated() -> None:
    pose = moving().at(3 * STEP_NS + STEP_NS // 2)
    assert pose is not None
    assert pose.position_ned_m == pytest.approx((0.07, 0.0, -5.0))
    assert yaw_of(pose.q_ned_frd) == pytest.approx(0.035)


def test_pose_shortly_after_the_last_sample_is_continued() -> None:
    pose = moving().at(9 * STEP_NS + 100_000_000)
    assert pose is not None
    assert pose.position_ned_m == pytest.approx((0.28, 0.0, -5.0))
    assert yaw_of(pose.q_ned_frd) == pytest.approx(0.14, abs=1e-4)


@pytest.mark.parametrize("t_ns", [-1, 9 * STEP_NS + 400_000_000])
def test_there_is_no_pose_outside_the_history(t_ns: int) -> None:
    assert moving().at(t_ns) is None


def test_old_samples_are_dropped() -> None:
    history = moving(100)
    assert history.at(40 * STEP_NS) is None
    assert history.at(60 * STEP_NS) is not None


def test_a_position_correction_does_not_move_the_odometric_frame() -> None:
    history = moving()
    history.add(state(10, (0.7, 0.0, -5.0)))
    pose = history.latest
    assert pose is not None
    assert pose.position_o_m == pytest.approx((0.2, 0.0, -5.0))
    assert pose.offset_m == pytest.approx((0.5, 0.0, 0.0))
    assert pose.position_ned_m == pytest.approx((0.7, 0.0, -5.0))


def flown(count: int, *, velocity_error: float, drift: float = 0.0) -> VehicleHistory:
    """North at 1 m/s; the velocity is off by one, the position moves off at the other, m/s."""
    history = VehicleHistory(10.0)
    for k in range(count):
        history.add(state(k, (0.02 * k * (1.0 + drift), 0.0, -5.0), velocity=(1.0 + velocity_error, 0.0, 0.0)))
    return history


def test_a_velocity_error_that_the_position_does_not_show_is_found_and_does_not_move_the_frame() -> None:
    first, last = flown(400, velocity_error=0.4).at(100 * STEP_NS), flown(400, velocity_error=0.4).latest
    assert first is not None
    assert last is not None
    assert last.correction_m_s == pytest.approx((-0.4, 0.0, 0.0), abs=1e-3)
    assert last.position_o_m[0] - first.position_o_m[0] == pytest.approx(299 * 0.02, abs=1e-3)


def test_without_corrections_the_frame_is_the_integral_of_the_velocity() -> None:
    last = flown(400, velocity_error=0.4, drift=0.4).latest
    assert last is not None
    assert last.correction_m_s == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    assert last.position_o_m == pytest.approx(last.position_ned_m)


def test_a_vehicle_is_continued_as_its_own_velocity_says() -> None:
    history = flown(200, velocity_error=0.4)
    last, later = history.latest, history.at(199 * STEP_NS + 100_000_000)
    assert last is not None
    assert later is not None
    assert later.position_ned_m[0] - last.position_ned_m[0] == pytest.approx(0.14, abs=1e-6)
    assert later.position_o_m[0] - last.position_o_m[0] == pytest.approx(0.10, abs=1e-3)


def test_a_velocity_that_is_reset_is_corrected_by_that_much_less() -> None:
    history = flown(200, velocity_error=0.4)
    history.add(state(200, (4.0, 0.0, -5.0), velocity=(0.9, 0.0, 0.0), resets=1))
    last = history.latest
    assert last is not None
    assert last.correction_m_s == pytest.approx((0.1, 0.0, 0.0), abs=1e-2)


def test_a_reset_is_reported_with_its_steps_and_leaves_the_odometric_position_continuous() -> None:
    history = moving()
    reset = history.add(state(10, (3.2, 0.0, -5.0), velocity=(1.4, -0.2, 0.0), resets=1))
    assert reset is not None
    assert reset.velocity_step_m_s == pytest.approx((0.4, -0.2, 0.0))
    assert reset.position_step_m == pytest.approx((3.0, 0.0, 0.0))
    pose = history.latest
    assert pose is not None
    assert pose.position_o_m == pytest.approx((0.2, 0.0, -5.0))


def test_braking_is_not_taken_for_a_reset() -> None:
    history = VehicleHistory(1.0)
    reports = [history.add(state(k, (0.0, 0.0, 0.0), velocity=(5.0 - 0.2 * k, 0.0, 0.0))) for k in range(20)]
    assert reports == [None] * 20


def test_after_a_reset_while_braking_only_the_step_counts() -> None:
    history = VehicleHistory(1.0)
    for k in range(10):
        history.add(state(k, (0.0, 0.0, 0.0), velocity=(5.0 - 0.2 * k, 0.0, 0.0)))
    reset = history.add(state(10, (0.0, 0.0, 0.0), velocity=(5.0 - 2.0 + 1.0, 0.0, 0.0), resets=1))
    assert reset is not None
    assert reset.velocity_step_m_s[0] == pytest.approx(1.0)


def test_samples_out_of_order_are_ignored() -> None:
    history = moving()
    history.add(state(5, (99.0, 0.0, 0.0)))
    pose = history.latest
    assert pose is not None
    assert math.isclose(pose.position_ned_m[0], 0.18)
