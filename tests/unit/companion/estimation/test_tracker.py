"""The whole of estimation as the pipeline uses it: messages in, the pad in W out."""

import math
from dataclasses import replace

import pytest

from companion.config import Camera, Estimation, Pad
from companion.estimation import PadTracker, make_tracker
from companion.geometry import quaternion_from_euler, quaternion_multiply
from companion.messages import (
    MeasurementVerdict,
    ObservationSource,
    PadBeacon,
    PadBearing,
    PadObservation,
    RangeMeasurement,
    Vec3,
    VehicleState,
)

NOISE = ((1e-4, 0.0, 0.0), (0.0, 1e-4, 0.0), (0.0, 0.0, 1e-4))
PAD_DOWN_M = -0.5


def tracker() -> PadTracker:
    return make_tracker(Estimation(), Pad(), {"down": Camera(position_frd_m=(0.0, 0.0, 0.0))})


def vehicle(t_s: float, *, offset: Vec3 = (0.0, 0.0, 0.0), error: float = 0.0, resets: int = 0) -> VehicleState:
    """Flies north at 1 m/s, 5 m up, level, nose north; `offset` and `error` are what its estimate is off."""
    position = (t_s + offset[0], offset[1], -5.0 + offset[2])
    q = quaternion_from_euler(0.0, 0.0, 0.0)
    return VehicleState(round(t_s * 1e9), position, (1.0 + error, 0.0, 0.0), q, (0.0, 0.0, 0.0), resets)


def sight(t_s: float) -> PadObservation:
    """The pad drives 1 m ahead of the vehicle: 1 m towards the image's top, 4.5 m below."""
    return PadObservation(round(t_s * 1e9), "down", "test", (0.0, -1.0, 4.5), NOISE)


def flown(seconds: float, **errors: float) -> PadTracker:
    result = tracker()
    for k in range(round(seconds * 50)):
        result.add_vehicle_state(vehicle(0.02 * k, **errors))
        if k % 2 and k > 3:
            result.observe(sight(0.02 * (k - 2)))
    return result


def relative(result: PadTracker) -> Vec3:
    latest = result.history.latest
    assert latest is not None
    estimate = result.estimate(latest.t_ns)
    assert estimate is not None
    p, v = estimate.position_ned_m, latest.position_ned_m
    return (p[0] - v[0], p[1] - v[1], p[2] - v[2])


def test_the_pad_is_where_the_camera_saw_it() -> None:
    assert relative(flown(2.0)) == pytest.approx((1.0, 0.0, 4.5), abs=0.01)


def test_a_position_correction_of_the_autopilot_does_not_move_the_pad_relative_to_the_vehicle() -> None:
    result = flown(2.0)
    result.add_vehicle_state(vehicle(2.0, offset=(3.0, -2.0, 1.0)))
    assert relative(result) == pytest.approx((1.0, 0.0, 4.5), abs=0.01)


def test_a_reset_of_the_autopilot_moves_neither_place_nor_closing_speed() -> None:
    result = flown(2.0)
    reset = result.add_vehicle_state(vehicle(2.0, offset=(5.0, 0.0, 0.0), error=0.5, resets=1))
    assert reset is not None
    assert relative(result) == pytest.approx((1.0, 0.0, 4.5), abs=0.02)
    estimate = result.estimate(round(2.0e9))
    assert estimate is not None
    assert estimate.velocity_ned_m_s[0] == pytest.approx(1.5, abs=0.02)


def test_a_velocity_error_of_the_autopilot_is_in_the_pads_velocity_too_and_cancels() -> None:
    estimate = flown(4.0, error=0.3).estimate(round(4.0e9))
    assert estimate is not None
    assert estimate.velocity_ned_m_s[0] == pytest.approx(1.3, abs=0.05)


def test_out_of_sight_a_changing_velocity_error_of_the_autopilot_does_not_move_the_pad() -> None:
    """Seen for 3 s with 0.3 m/s of error, then 2 s blind with the error turned round: by the velocity alone the pad is 1.2 m off,
    with it corrected by the 0.2 s over which corrections are smoothed times 0.6 m/s."""
    result = flown(3.0, error=0.3)
    for k in range(150, 250):
        result.add_vehicle_state(vehicle(0.02 * k, error=-0.3))
    assert relative(result) == pytest.approx((1.0, 0.0, 4.5), abs=0.13)
    assert_moves_as_the_autopilot_measures(result, 0.7)


def assert_moves_as_the_autopilot_measures(result: PadTracker, north_m_s: float) -> None:
    latest = result.history.latest
    assert latest is not None
    now, later = result.estimate(latest.t_ns), result.estimate(latest.t_ns + 1_000_000_000)
    motion = result.motion(latest.t_ns + 1_000_000_000)
    assert now is not None
    assert later is not None
    assert motion is not None
    assert now.velocity_ned_m_s[0] == pytest.approx(north_m_s, abs=0.03)
    assert motion.velocity_ned_m_s[0] == pytest.approx(north_m_s, abs=0.03)
    assert later.position_ned_m[0] - now.position_ned_m[0] == pytest.approx(north_m_s, abs=0.03)


def test_what_was_seen_before_the_first_vehicle_state_is_refused() -> None:
    verdict = tracker().observe(sight(0.0))
    assert verdict is not None
    assert (verdict.accepted, verdict.reason) == (False, "no vehicle state at that time")


def test_an_unknown_camera_is_refused_by_name() -> None:
    result = flown(1.0)
    verdict = result.observe(PadBearing(round(0.9e9), "side", "test", (0.0, 0.0, 1.0), 0.01))
    assert verdict is not None
    assert verdict.reason == "unknown camera"


def range_reading(t_s: float, distance_m: float | None) -> RangeMeasurement:
    return RangeMeasurement(round(t_s * 1e9), distance_m, 0.1, 40.0)


def test_range_over_the_ground_beside_the_pad_is_not_taken_for_the_deck() -> None:
    assert flown(2.0).observe(range_reading(1.96, 5.0)) is None


def test_range_over_the_deck_is_fused_once_vision_is_gone() -> None:
    result = tracker()
    for k in range(100):
        result.add_vehicle_state(vehicle(0.02 * k))
        if k % 2 and k > 3:
            t_ns = round(0.02 * (k - 2) * 1e9)
            result.observe(PadObservation(t_ns, "down", "test", (0.0, 0.0, 4.5), NOISE))
    assert result.observe(range_reading(1.97, 4.5)) is None
    for k in range(100, 120):
        result.add_vehicle_state(vehicle(0.02 * k))
    verdict = result.observe(range_reading(2.37, 4.5))
    assert verdict is not None
    assert (verdict.source, verdict.accepted) == (ObservationSource.RANGE, True)
    assert result.observe(range_reading(2.37, None)) is None


def test_range_of_a_vehicle_that_leans_above_the_deck_and_looks_beside_it_is_not_taken_for_the_deck() -> None:
    """Pitched by 15 degrees 4.5 m up, the beam ends 1.2 m ahead of where the vehicle is."""
    result = tracker()
    for k in range(120):
        q = quaternion_from_euler(0.0, math.radians(15.0) if k > 100 else 0.0, 0.0)
        result.add_vehicle_state(replace(vehicle(0.02 * k), q_ned_frd=q))
        if k % 2 and 3 < k < 100:
            t_ns = round(0.02 * (k - 2) * 1e9)
            result.observe(PadObservation(t_ns, "down", "test", (0.0, 0.0, 4.5), NOISE))
    assert result.observe(range_reading(2.37, 5.2)) is None


def test_range_goes_on_telling_the_height_where_vision_gives_bearings_only() -> None:
    config = Estimation(estimator="bearing_ukf", ground_down_m=-0.3)  # 20 cm wrong
    result = make_tracker(config, Pad(), {"down": Camera(position_frd_m=(0.0, 0.0, 0.0))})
    for k in range(150):
        result.add_vehicle_state(vehicle(0.02 * k))
        if k % 2 and k > 3:
            t_s = 0.02 * (k - 2)
            result.observe(PadBearing(round(t_s * 1e9), "down", "test", (0.0, 0.0, 1.0), 0.005))
            result.observe(range_reading(t_s, 4.5))
    assert relative(result)[2] == pytest.approx(4.5, abs=0.05)


def test_a_bearing_alone_keeps_the_track() -> None:
    result = flown(2.0)
    length = math.hypot(1.0, 4.5)
    for k in range(100, 150):
        result.add_vehicle_state(vehicle(0.02 * k))
        direction = (0.0, -1.0 / length, 4.5 / length)
        verdict = result.observe(PadBearing(round(0.02 * k * 1e9), "down", "test", direction, 0.005))
        assert verdict is not None
        assert verdict.accepted
    assert relative(result) == pytest.approx((1.0, 0.0, 4.5), abs=0.13)


def test_a_beacon_alone_gives_a_pad_with_its_own_uncertainty() -> None:
    result = tracker()
    for k in range(50):
        result.add_vehicle_state(vehicle(0.02 * k))
    report = PadBeacon(round(0.9e9), "gps", (30.0, 5.0, PAD_DOWN_M), (1.0, 0.0, 0.0), 0.0, 1.5)
    verdict = result.observe(report)
    assert verdict is not None
    assert verdict.accepted
    estimate = result.estimate(round(1.0e9))
    assert estimate is not None
    assert estimate.position_ned_m[:2] == pytest.approx((30.1, 5.0), abs=0.01)
    assert 1.4 < estimate.position_sigma_m < 1.8
    assert (estimate.vision_age_s, estimate.beacon_age_s) == (None, pytest.approx(0.1))


def test_both_readings_of_an_ambiguous_picture_reach_the_track() -> None:
    """The camera looks straight down from a level vehicle; the first reading leans 30 degrees, the second lies level."""
    result = tracker()
    for k in range(50):
        result.add_vehicle_state(vehicle(0.02 * k))
    level = quaternion_from_euler(0.0, 0.0, math.pi / 2)
    leaning = quaternion_multiply(level, quaternion_from_euler(0.0, math.radians(30.0), 0.0))
    result.observe(replace(sight(0.9), q_camera_pad=leaning, q_camera_pad_alternative=level))
    estimate = result.estimate(round(0.98e9))
    assert estimate is not None
    assert (estimate.roll_rad, estimate.pitch_rad) == pytest.approx((0.0, 0.0), abs=1e-6)


def test_a_sight_waits_for_the_vehicles_state_of_its_time() -> None:
    """On a slow link the frame comes first. Fused with an attitude continued from 0.2 s ago, a vehicle that has begun to
    roll would see the pad aside; fused with the state of its time, when that has come, it does not."""
    result = flown(2.0)
    seen_s = 1.98 + 0.2
    rolled = quaternion_from_euler(math.radians(20.0), 0.0, 0.0)
    ahead_in_level_frame = (0.0, -1.0, 4.5)
    roll_rad = math.radians(20.0)
    _, y, z = ahead_in_level_frame
    sideways = (z * -math.sin(-roll_rad), y, z * math.cos(roll_rad))  # camera x is body right; level: right 0, down 4.5
    message = PadObservation(round(seen_s * 1e9), "down", "test", sideways, NOISE)
    assert result.observe(message) is None
    assert result.observe_waiting() == []
    for k in range(100, 112):
        state = vehicle(0.02 * k)
        result.add_vehicle_state(replace(state, q_ned_frd=rolled) if k >= 105 else state)
        verdicts = result.observe_waiting()
        if verdicts:
            break
    assert [verdict.accepted for verdict in verdicts] == [True]
    assert relative(result) == pytest.approx((1.0, 0.0, 4.5), abs=0.03)
    assert result.observe_waiting() == []


def test_a_sight_far_ahead_of_a_silent_link_is_refused_at_once() -> None:
    verdict = flown(2.0).observe(sight(1.98 + 0.4))
    assert verdict is not None
    assert verdict.reason == "no vehicle state at that time"


def test_a_question_changes_no_verdict() -> None:
    """The shell asks for each frame what it should show; a replay without frames asks nothing and must decide the same."""

    def judged(*, asked: bool) -> MeasurementVerdict | None:
        result = tracker()
        for k in range(110):
            result.add_vehicle_state(vehicle(0.02 * k))
            if k <= 97:
                result.observe(PadObservation(round(0.02 * k * 1e9), "down", "test", (0.0, 0.0, 4.5), NOISE))
            if k == 105:
                assert result.estimate_now(round(2.1e9)) is not None
        if asked:
            result.estimate(round(2.25e9))
        return result.observe(range_reading(2.18, 4.5))

    assert judged(asked=True) == judged(asked=False)
