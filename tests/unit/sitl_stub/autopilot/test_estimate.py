"""The error of the autopilot's own state: size, memory, jumps, and that it can be switched off."""

from math import radians

import numpy as np
import pytest

from sitl_stub.autopilot.estimate import NO_ERRORS, EstimateErrors, Estimator, SlowError, Wander
from sitl_stub.autopilot.noise import NormalTape
from sitl_stub.autopilot.parameters import Parameters
from sitl_stub.multirotor import VehicleTruth
from sitl_stub.rotation import from_euler, inverse, multiply, roll_pitch_yaw

PX4 = Parameters().as_mapping()
STEP_S = 0.004
RECORDED = EstimateErrors()


def _truth(on_surface: bool = False, rate: float = 0.0) -> VehicleTruth:
    return VehicleTruth(
        (1.0, 2.0, -30.0),
        (0.5, 0.0, -0.2),
        from_euler(0.1, -0.2, 1.0),
        (rate, 0.0, 0.0),
        (0.0, 0.0, -9.8),
        (0.0, 0.0, 0.0),
        on_surface,
    )


def _errors(seconds: float, seed: int = 0, errors: EstimateErrors = RECORDED, **truth: bool) -> dict[str, np.ndarray]:
    estimator, t = Estimator(PX4, np.random.default_rng(seed), errors), _truth(**truth)
    position, velocity, attitude, rates = [], [], [], []
    for i in range(round(seconds / STEP_S)):
        e = estimator.step(i * 4000, t, STEP_S)
        if i % 10:
            continue
        position.append(np.subtract(e.position_ned_m, t.position_ned_m))
        velocity.append(np.subtract(e.velocity_ned_m_s, t.velocity_ned_m_s))
        attitude.append(roll_pitch_yaw(multiply(e.q_ned_frd, inverse(t.q_ned_frd))))
        rates.append(e.angular_velocity_frd_rad_s)
    return {
        "position": np.array(position),
        "velocity": np.array(velocity),
        "attitude": np.array(attitude),
        "rates": np.array(rates),
    }


@pytest.fixture(scope="module")
def long() -> dict[str, np.ndarray]:
    return _errors(300.0)


def test_switched_off_the_estimate_is_the_truth() -> None:
    estimator, truth = Estimator(PX4, np.random.default_rng(0), NO_ERRORS), _truth()
    for i in range(100):
        e = estimator.step(i * 4000, truth, STEP_S)
    assert e.position_ned_m == truth.position_ned_m
    assert e.velocity_ned_m_s == truth.velocity_ned_m_s
    assert e.q_ned_frd == pytest.approx(truth.q_ned_frd)
    assert e.height_rate_ned_m_s == truth.velocity_ned_m_s[2]


def test_errors_are_as_large_as_the_recorded_ones(long: dict[str, np.ndarray]) -> None:
    """Fact 22: velocity 0.14 to 0.31 m/s, vertical 0.19; position 0.1 to 0.3 m, height 0.3 to 0.4 m."""
    vx, vy, vz = long["velocity"].std(axis=0)
    x, y, z = long["position"].std(axis=0)
    assert 0.12 < vx < 0.31
    assert 0.14 < vy < 0.31
    assert 0.10 < vz < 0.25
    assert 0.1 < x < 0.4
    assert 0.1 < y < 0.4
    assert 0.25 < z < 0.7
    roll, pitch, yaw = np.degrees(long["attitude"].std(axis=0))
    assert 0.5 < roll < 1.5
    assert 0.3 < pitch < 1.5
    assert 2.0 < yaw < 6.0


def test_velocity_error_grows_as_recorded(long: dict[str, np.ndarray]) -> None:
    """Recorded growth over 0.2 s: north 0.02, east 0.053, down 0.039 m/s, heading near north; here heading 1 rad, so down only."""
    v = long["velocity"]
    assert (v[5:] - v[:-5]).std(axis=0)[2] == pytest.approx(0.040, rel=0.15)
    assert np.hypot(*(v[5:] - v[:-5]).std(axis=0)[:2]) == pytest.approx(np.hypot(0.02, 0.053), rel=0.15)


def test_velocity_error_is_forgotten_within_seconds(long: dict[str, np.ndarray]) -> None:
    v = long["velocity"] - long["velocity"].mean(axis=0)

    def correlation(seconds: float) -> float:
        n = round(seconds / 0.04)
        return float(np.mean(v[n:] * v[:-n]) / np.mean(v * v))

    assert correlation(1.0) > 0.6
    assert correlation(5.0) < 0.6
    assert abs(correlation(40.0)) < 0.25


def test_position_drifts_with_the_velocity_error(long: dict[str, np.ndarray]) -> None:
    for axis in (0, 1):
        assert np.corrcoef(long["velocity"][:, axis], long["position"][:, axis])[0, 1] > 0.5


def test_rates_carry_the_filtered_gyro_noise_that_was_recorded(long: dict[str, np.ndarray]) -> None:
    assert long["rates"].std(axis=0) == pytest.approx([0.083, 0.042, 0.0174], rel=0.05)


def test_height_on_the_ground_is_not_zero_and_differs_between_seeds() -> None:
    offsets = [_errors(0.1, seed, on_surface=True)["position"][-1, 2] for seed in range(20)]
    assert 0.2 < np.std(offsets) < 0.8
    assert max(abs(offset) for offset in offsets) < 1.5


def _velocity_errors(estimator: Estimator, seconds: float, *, on_surface: bool = True) -> np.ndarray:
    """Every 4 ms, shape (n, 3)."""
    truth = _truth(on_surface)
    steps = range(round(seconds / STEP_S))
    estimates = (estimator.step(i * 4000, truth, STEP_S).velocity_ned_m_s for i in steps)
    return np.array([np.subtract(velocity, truth.velocity_ned_m_s) for velocity in estimates])


def test_vehicles_that_stand_with_stopped_motors_have_little_velocity_error() -> None:
    estimator = Estimator(PX4, np.random.default_rng(0))
    estimator.begin_at_rest()
    assert np.abs(_velocity_errors(estimator, 60.0)).max() < 0.1


def test_running_motors_keep_the_velocity_error_whole_on_the_ground() -> None:
    """Recorded: the vertical speed of a vehicle that stood was wrong by up to 0.44 m/s, for 20 s."""
    standing = _velocity_errors(Estimator(PX4, np.random.default_rng(0)), 300.0)
    assert standing.std(axis=0) == pytest.approx(_errors(300.0)["velocity"].std(axis=0), rel=1e-6, abs=0.02)


def test_the_velocity_error_comes_and_goes_without_a_step() -> None:
    estimator = Estimator(PX4, np.random.default_rng(0))
    flown = _velocity_errors(estimator, 20.0, on_surface=False)
    stood = _velocity_errors(estimator, 4.0)
    estimator.motors_run = False
    rested = _velocity_errors(estimator, 30.0)
    estimator.motors_run = True
    started = _velocity_errors(estimator, 30.0)
    roughest = np.abs(np.diff(flown, axis=0)).max()
    together = np.concatenate([flown, stood, rested, started])
    assert np.abs(np.diff(together, axis=0)).max() <= 1.2 * roughest
    assert np.abs(rested[-1000:]).max() < 0.1 < np.abs(started[-1000:]).max()


def test_errors_scale_one_by_one() -> None:
    only_yaw = _errors(20.0, errors=EstimateErrors(0.0, 0.0, 2.0, 0.0, 0.0))
    assert np.abs(only_yaw["position"]).max() == 0.0
    assert np.abs(only_yaw["attitude"][:, :2]).max() < 1e-9
    once = _errors(20.0, errors=EstimateErrors(0.0, 0.0, 1.0, 0.0, 0.0))
    assert only_yaw["attitude"][:, 2] == pytest.approx(2.0 * once["attitude"][:, 2])


def test_same_seed_same_errors() -> None:
    assert np.array_equal(_errors(2.0, 3)["position"], _errors(2.0, 3)["position"])
    assert not np.array_equal(_errors(2.0, 3)["position"], _errors(2.0, 4)["position"])


def test_without_gnss_the_position_error_grows_and_dead_reckoning_is_told() -> None:
    finals = []
    for seed in range(4):
        estimator, truth = Estimator(PX4, np.random.default_rng(seed)), _truth()
        estimator.gnss_available = False
        for i in range(round(60.0 / STEP_S)):
            e = estimator.step(i * 4000, truth, STEP_S)
            if i == 100:
                assert not e.is_dead_reckoning
        assert e.is_dead_reckoning
        finals.append(np.hypot(e.position_ned_m[0] - 1.0, e.position_ned_m[1] - 2.0))
    assert np.median(finals) > 5.0


@pytest.mark.parametrize("kind", ["position", "height", "velocity", "yaw"])
def test_a_jump_moves_the_estimate_and_counts(kind: str) -> None:
    estimator, truth = Estimator(PX4, np.random.default_rng(0), NO_ERRORS), _truth()
    estimator.step(0, truth, STEP_S)
    if kind == "position":
        estimator.jump_position(3.0, -1.0)
    elif kind == "height":
        estimator.jump_height(2.0)
    elif kind == "velocity":
        estimator.jump_velocity(0.5, 0.25)
    else:
        estimator.jump_yaw(radians(20.0))
    for i in range(1, 4):
        e = estimator.step(i * 4000, truth, STEP_S)
    moved = {
        "position": (e.position_ned_m[0] - 1.0, e.position_xy_resets, e.position_xy_jump_m[0]),
        "height": (e.position_ned_m[2] + 30.0, e.position_z_resets, e.position_z_jump_m),
        "velocity": (e.velocity_ned_m_s[0] - 0.5, e.velocity_xy_resets, e.velocity_xy_jump_m_s[0]),
        "yaw": (e.yaw_rad - 1.0, e.yaw_resets, e.yaw_jump_rad),
    }[kind]
    size = {"position": 3.0, "height": 2.0, "velocity": 0.5, "yaw": radians(20.0)}[kind]
    assert moved == pytest.approx((size, 1, size), abs=1e-6)


def test_settling_starts_the_gyro_filter_without_a_jump() -> None:
    estimator, truth = Estimator(PX4, np.random.default_rng(0), NO_ERRORS), _truth(rate=1.0)
    estimator.settle(truth)
    e = estimator.step(0, truth, STEP_S)
    assert e.angular_velocity_frd_rad_s[0] == pytest.approx(1.0)
    assert e.angular_acceleration_frd_rad_s2[0] == pytest.approx(0.0, abs=1e-6)


def test_slow_errors_have_the_sigma_that_was_asked_for() -> None:
    noise = NormalTape(np.random.default_rng(1))
    slow, walk = SlowError(0.5, 2.0, noise), Wander(0.5, 2.0, noise)
    values = []
    for _ in range(200_000):
        slow.step(0.02)
        walk.step(0.02)
        values.append((slow.value, walk.value))
    assert np.std(values, axis=0) == pytest.approx([0.5, 0.5], rel=0.1)
