"""The state estimator as its users see it: truth plus the errors that PX4's EKF shows in simulation.

Not a filter but a model of one's error, with the recorded causes. Accelerometer noise is integrated into a random walk of the
velocity in body axes, gyro noise into one of roll and pitch, each pulled back within seconds; slower errors come on top. The
position error follows the velocity error and is pulled back by GNSS, so both drift together. Height has an offset from the start
that wanders; without GNSS the pull ends and the velocity error grows (dead reckoning). Rates are filtered as PX4 filters its
gyro. W local NED with its origin at the start, B FRD. All randomness from the generator given. Called by the autopilot each
step, between truth and cascade; `VehicleEstimate` is what it fills.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, pi, radians, sin, sqrt
from typing import Any, NamedTuple, cast

import numpy as np

from sitl_stub.autopilot.bottom_distance import BottomDistance
from sitl_stub.autopilot.low_pass import Butterworth, butterworth, settled
from sitl_stub.autopilot.noise import NormalTape
from sitl_stub.autopilot.vehicle_estimate import VehicleEstimate
from sitl_stub.compiled import COMPILED, compiled, room, used_by_kernels
from sitl_stub.multirotor import BodyState, VehicleTruth
from sitl_stub.rotation import Vec3, from_rotation_vector, multiply, normalise, wrap, yaw_of

_SAMPLE_HZ = 250.0
_ERROR_PERIOD_US = 8_000
_ERROR_DUE_US = _ERROR_PERIOD_US - 0.5
_NO_MOTORS = (0.0, 0.0, 0.0, 0.0)
_SLOW_PERIOD_S = 0.031


@dataclass(frozen=True, slots=True)
class EstimateErrors:
    """Factors on each kind of error: 1 is what the recorded PX4 shows, 0 switches it off."""

    position: float = 1.0
    """Drift of position and velocity."""
    tilt: float = 1.0
    yaw: float = 1.0
    ground_height: float = 1.0
    """Height that is not zero on the ground."""
    gyro_noise: float = 1.0

    @classmethod
    def scaled(cls, factor: float) -> EstimateErrors:
        """All of them by the same factor."""
        return cls(factor, factor, factor, factor, factor)


NO_ERRORS = EstimateErrors.scaled(0.0)


class Wander:
    """A stationary random walk with a pull to zero: rough, as integrated sensor noise is.

    `rate` is the walk's growth per square root of a second.
    """

    __slots__ = ("_noise", "rate", "time_s", "value")

    def __init__(self, rate: float, time_s: float, noise: NormalTape) -> None:
        self.rate, self.time_s, self._noise = rate, time_s, noise
        self.value = rate * sqrt(0.5 * time_s) * noise.next()

    def step(self, dt_s: float) -> None:
        self.value += -dt_s / self.time_s * self.value + self.rate * sqrt(dt_s) * self._noise.next()


class SlowError:
    """A stationary process of given sigma and correlation time, smoothed so that its derivative stays small."""

    __slots__ = ("_noise", "raw", "sigma", "smooth_s", "time_s", "value")

    def __init__(self, sigma: float, time_s: float, noise: NormalTape, smooth_s: float = 1.0) -> None:
        self.sigma = sigma * sqrt(1.0 + smooth_s / time_s)
        self.time_s, self.smooth_s, self._noise = time_s, smooth_s, noise
        self.raw = self.sigma * noise.next()
        self.value = self.raw * time_s / (time_s + smooth_s)

    def step(self, dt_s: float) -> None:
        share = dt_s / self.time_s
        self.raw += -share * self.raw + self.sigma * sqrt(2.0 * share) * self._noise.next()
        self.value += dt_s / self.smooth_s * (self.raw - self.value)


# Measured on the recorded flights (velocity error, attitude error and their growth over 0.05 to 8 s; facts 22 to 24).
_SENSOR_STEP_S = 0.004
_ACCEL_NOISE_M_S2 = (0.5, 1.7, 1.4)
_GYRO_NOISE_RAD_S = (0.14, 0.07, 0.03)
_VELOCITY_PULL_S, _TILT_PULL_S = 5.0, 4.0
_SLOW_VELOCITY_SIGMA_M_S = (0.14, 0.18, 0.08)
_SLOW_VELOCITY_TIME_S = 6.0
_POSITION_PULL_S = (1.4, 1.4, 2.2)
_SLOW_TILT_SIGMA_RAD, _SLOW_TILT_TIME_S = radians(0.6), 40.0
_YAW_SIGMA_RAD, _YAW_TIME_S = radians(4.0), 15.0
_GROUND_HEIGHT_SIGMA_M, _GROUND_HEIGHT_TIME_S = 0.4, 60.0
_DEAD_RECKONING_AFTER_US = 1_000_000
_DEAD_RECKONING_DRIFT_M_S2 = 0.15
_RESTING_PART = 0.1
"""What is left of the velocity error on the ground with stopped motors: nothing shakes the accelerometer there.

While the motors run the error is whole, on the ground too: the recorded one stayed up to 0.7 m/s for 20 s after touchdown. It
comes and goes with the pull of the random walk, without a step."""
_ACCELERATION_NOISE_PART = 0.6


# Places in the estimator's flat state. The kernel's functions write them as numbers: a name is looked up at each use.
_WALK = 0  # velocity forward, right, down; roll, pitch
_RAW = 5  # slow errors: velocity north, east, down; roll, pitch; yaw; height of the ground
_SLOW = 12
_VELOCITY_ERROR = 19
_POSITION_ERROR = 22
_RECKONING = 25
_HEIGHT_ERROR_RATE = 27
_ACCELERATION_NOISE = 28
_ATTITUDE_ERROR = 31
_GYRO = 35
_OFFSET = 41
_VELOCITY_OFFSET = 44
_YAW_OFFSET = 47
_SINCE_ERROR_US = 48
_SINCE_SLOW_S = 49
POSITION, VELOCITY, ACCELERATION, HEIGHT_RATE, ATTITUDE, RATES, RATES_DOT, YAW = 50, 53, 56, 59, 60, 64, 67, 70
_PART = 71  # of the velocity error that there is now
SIZE = 72
MOST_NUMBERS_A_STEP = 20
"""More random numbers than a step can draw."""

Three = tuple[float, float, float]
Five = tuple[float, float, float, float, float]
Seven = tuple[float, float, float, float, float, float, float]


class ErrorModel(NamedTuple):
    """Constants of `step_estimate`: what drives each error, and the gyro's filters."""

    walk_pull_s: Five
    walk_rate: Five
    slow_sigma: Seven
    slow_time_s: Seven
    slow_smooth_s: Seven
    reckoning_drift: float
    acceleration_noise: Three
    gyro_noise: Three
    gyro_filter: Butterworth
    derivative_time_s: float


@used_by_kernels
def _step_walks(e: Any, m: ErrorModel, tape: Any, at: int, dt_s: float) -> int:
    root = sqrt(dt_s)
    t0, t1, t2, t3, t4 = m.walk_pull_s
    r0, r1, r2, r3, r4 = m.walk_rate
    e[0] += -dt_s / t0 * e[0] + r0 * root * tape[at]
    e[1] += -dt_s / t1 * e[1] + r1 * root * tape[at + 1]
    e[2] += -dt_s / t2 * e[2] + r2 * root * tape[at + 2]
    e[3] += -dt_s / t3 * e[3] + r3 * root * tape[at + 3]
    e[4] += -dt_s / t4 * e[4] + r4 * root * tape[at + 4]
    e[49] += dt_s
    if e[49] < _SLOW_PERIOD_S:
        return at + 5
    slow_s = e[49]
    e[49] = 0.0
    sigmas, times_s, smooths_s = m.slow_sigma, m.slow_time_s, m.slow_smooth_s
    for i in range(7):
        share = slow_s / times_s[i]
        raw = e[5 + i]
        raw += -share * raw + sigmas[i] * sqrt(2.0 * share) * tape[at + 5 + i]
        e[5 + i] = raw
        e[12 + i] += slow_s / smooths_s[i] * (raw - e[12 + i])
    return at + 12


@used_by_kernels
def _reckon(e: Any, m: ErrorModel, tape: Any, at: int, dt_s: float, aided: bool) -> int:
    """Velocity error that grows without GNSS as a random walk, and goes back quickly with it."""
    if aided:
        e[25], e[26] = e[25] * (1.0 - dt_s), e[26] * (1.0 - dt_s)
        return at
    step = m.reckoning_drift * sqrt(dt_s)
    e[25] += step * tape[at]
    e[26] += step * tape[at + 1]
    return at + 2


@used_by_kernels
def _drift(e: Any, dt_s: float, aided: bool) -> None:
    """Position error follows the velocity error; GNSS and barometer pull it back."""
    x, y, z = e[22], e[23], e[24]
    vx, vy, vz = e[19], e[20], e[21]
    pull_x, pull_y, pull_z = _POSITION_PULL_S
    rate = vz - z / pull_z
    e[27] = rate
    if aided:
        vx, vy = vx - x / pull_x, vy - y / pull_y
    e[22], e[23], e[24] = x + vx * dt_s, y + vy * dt_s, z + rate * dt_s


@used_by_kernels
def _part_of_error(part: float, dt_s: float, resting: bool) -> float:
    """It decays at rest as the walk's pull has it; else its square grows as a walk's variance does."""
    share = dt_s / _VELOCITY_PULL_S
    if resting:
        return part + share * (_RESTING_PART - part)
    return sqrt(part * part + 2.0 * share * (1.0 - part * part))


@used_by_kernels
def _step_errors(
    e: Any, m: ErrorModel, tape: Any, at: int, yaw_rad: float, dt_s: float, aided: bool, resting: bool
) -> int:
    at = _step_walks(e, m, tape, at, dt_s)
    at = _reckon(e, m, tape, at, dt_s, aided)
    # Body-axis walks turned by the heading, slow errors and dead reckoning in W.
    c, s = cos(yaw_rad), sin(yaw_rad)
    forward, right = e[0], e[1]
    part = _part_of_error(e[71], dt_s, resting)
    e[71] = part
    e[19] = part * (c * forward - s * right + e[12] + e[25])
    e[20] = part * (s * forward + c * right + e[13] + e[26])
    e[21] = part * (e[2] + e[14])
    _drift(e, dt_s, aided)
    nx, ny, nz = m.acceleration_noise
    if nx > 0.0:
        e[28], e[29] = nx * tape[at], ny * tape[at + 1]
        e[30] = nz * tape[at + 2]
        at += 3
    # Roll and pitch errors turn in B, the yaw error about down in W; small angles.
    roll, pitch = e[3] + e[15], e[4] + e[16]
    w, x, y, z = from_rotation_vector(c * roll - s * pitch, s * roll + c * pitch, e[17] + e[47])
    e[31], e[32], e[33], e[34] = w, x, y, z
    return at


@used_by_kernels
def _step_rates(e: Any, m: ErrorModel, tape: Any, at: int, p: float, q: float, r: float, dt_s: float) -> int:
    """Gyro noise, PX4's low pass, and the filtered derivative."""
    nx, ny, nz = m.gyro_noise
    if nx > 0.0:
        p, q, r = p + nx * tape[at], q + ny * tape[at + 1], r + nz * tape[at + 2]
        at += 3
    b0, b1, b2, a1, a2 = m.gyro_filter
    p1, p2, q1, q2, r1, r2 = e[35], e[36], e[37], e[38], e[39], e[40]
    p0, q0, r0 = p - a1 * p1 - a2 * p2, q - a1 * q1 - a2 * q2, r - a1 * r1 - a2 * r2
    e[35], e[36], e[37], e[38], e[39], e[40] = p0, p1, q0, q1, r0, r1
    p, q, r = b0 * p0 + b1 * p1 + b2 * p2, b0 * q0 + b1 * q1 + b2 * q2, b0 * r0 + b1 * r1 + b2 * r2
    time_s = m.derivative_time_s
    keep = time_s / (dt_s + time_s)
    share = (1.0 - keep) / dt_s
    e[67] = keep * e[67] + share * (p - e[64])
    e[68] = keep * e[68] + share * (q - e[65])
    e[69] = keep * e[69] + share * (r - e[66])
    e[64], e[65], e[66] = p, q, r
    return at


@compiled
def step_estimate(
    e: Any,
    m: ErrorModel,
    tape: Any,
    at: int,
    state: tuple[float, ...],
    acceleration: Vec3,
    dt_s: float,
    aided: bool,
    resting: bool,
) -> int:
    """Advance errors and estimate, both in the flat state `e`, from truth; gives the place on the tape after the numbers drawn."""
    x, y, z, vx, vy, vz, qw, qx, qy, qz, p, q, r, _, _, _, _ = state
    e[48] += dt_s * 1e6
    if e[48] >= _ERROR_DUE_US:
        yaw_rad = yaw_of((qw, qx, qy, qz))
        at = _step_errors(e, m, tape, at, yaw_rad, e[48] * 1e-6, aided, resting)
        e[48] = 0.0
    ax, ay, az = acceleration
    e[50], e[51], e[52] = x + e[22] + e[41], y + e[23] + e[42], z + e[24] + e[18] + e[43]
    e[53], e[54], e[55] = vx + e[19] + e[44], vy + e[20] + e[45], vz + e[21] + e[46]
    e[56], e[57], e[58] = ax + e[28], ay + e[29], az + e[30]
    e[59] = vz + e[27]
    attitude = normalise(multiply((e[31], e[32], e[33], e[34]), (qw, qx, qy, qz)))
    e[60], e[61], e[62], e[63] = attitude
    e[70] = yaw_of(attitude)
    return _step_rates(e, m, tape, at, p, q, r, dt_s)


class Estimator:
    """Fills one `VehicleEstimate` from truth. `gnss_available` False is a GNSS loss; `motors_run` False is told by the autopilot."""

    def __init__(
        self,
        parameters: Mapping[str, float | int],
        rng: np.random.Generator,
        errors: EstimateErrors = EstimateErrors(),
    ) -> None:
        self.estimate = VehicleEstimate()
        self.gnss_available = True
        self.motors_run = True
        self.tape = NormalTape(rng)
        self._errors = errors
        self._parameters = parameters
        self._without_gnss_us = 0
        self._bottom = BottomDistance()
        self._start_errors(errors, self.tape)
        self.refresh()

    def _start_errors(self, errors: EstimateErrors, tape: NormalTape) -> None:
        scale, root = errors.position, sqrt(_SENSOR_STEP_S)
        walks = [Wander(scale * sigma * root, _VELOCITY_PULL_S, tape) for sigma in _ACCEL_NOISE_M_S2]
        slow = [SlowError(scale * sigma, _SLOW_VELOCITY_TIME_S, tape) for sigma in _SLOW_VELOCITY_SIGMA_M_S]
        walks += [Wander(errors.tilt * sigma * root, _TILT_PULL_S, tape) for sigma in _GYRO_NOISE_RAD_S[:2]]
        slow += [SlowError(errors.tilt * _SLOW_TILT_SIGMA_RAD, _SLOW_TILT_TIME_S, tape) for _ in range(2)]
        slow.append(SlowError(errors.yaw * _YAW_SIGMA_RAD, _YAW_TIME_S, tape))
        slow.append(SlowError(errors.ground_height * _GROUND_HEIGHT_SIGMA_M, _GROUND_HEIGHT_TIME_S, tape, 5.0))
        self._walks, self._slow = walks, slow
        values = [0.0] * SIZE
        values[_WALK:_RAW] = [walk.value for walk in walks]
        values[_RAW:_SLOW] = [error.raw for error in slow]
        values[_SLOW:_VELOCITY_ERROR] = [error.value for error in slow]
        values[_ATTITUDE_ERROR] = values[ATTITUDE] = values[_PART] = 1.0
        values[_SINCE_ERROR_US] = float(_ERROR_PERIOD_US)
        self.flat: Any = room(values)

    def refresh(self) -> None:
        """Read the filter parameters again."""
        errors, cutoff_hz = self._errors, float(self._parameters["IMU_DGYRO_CUTOFF"])
        walks, slow = self._walks, self._slow
        accelerometer = errors.position * _ACCELERATION_NOISE_PART
        x, y, z = (accelerometer * sigma for sigma in _ACCEL_NOISE_M_S2)
        p, q, r = (errors.gyro_noise * sigma for sigma in _GYRO_NOISE_RAD_S)
        self.model = ErrorModel(
            cast(Five, tuple(walk.time_s for walk in walks)),
            cast(Five, tuple(walk.rate for walk in walks)),
            cast(Seven, tuple(error.sigma for error in slow)),
            cast(Seven, tuple(error.time_s for error in slow)),
            cast(Seven, tuple(error.smooth_s for error in slow)),
            errors.position * _DEAD_RECKONING_DRIFT_M_S2,
            (x, y, z),
            (p, q, r),
            butterworth(float(self._parameters["IMU_GYRO_CUTOFF"]), _SAMPLE_HZ),
            1.0 / (2.0 * pi * cutoff_hz) if cutoff_hz > 0.0 else 0.0,
        )

    def begin_at_rest(self) -> None:
        """The vehicle has stood with stopped motors for long."""
        self.motors_run = False
        self.flat[_PART] = _RESTING_PART

    def settle(self, truth: VehicleTruth) -> None:
        """Start the filters as if the vehicle had been turning like this for long (starts in the air)."""
        self.motors_run = True
        self.flat[_PART] = 1.0
        for axis, rate in enumerate(truth.angular_velocity_frd_rad_s):
            self.flat[_GYRO + 2 * axis] = self.flat[_GYRO + 2 * axis + 1] = settled(self.model.gyro_filter, rate)
            self.flat[RATES + axis] = rate
            self.flat[RATES_DOT + axis] = 0.0
        self.estimate.angular_acceleration_frd_rad_s2 = (0.0, 0.0, 0.0)

    def see_range(self, t_us: int, range_m: float | None) -> None:
        """A new reading of the range sensor, None where it measures nothing."""
        self.estimate.height_above_bottom_m = self._bottom.take(t_us, range_m)

    def step(self, t_us: int, truth: VehicleTruth, dt_s: float) -> VehicleEstimate:
        """Advance the errors by dt_s and return the estimate (the same object each time)."""
        self._watch_gnss(dt_s)
        tape = self.tape
        tape.reserve(MOST_NUMBERS_A_STEP)
        state = BodyState(
            *truth.position_ned_m,
            *truth.velocity_ned_m_s,
            *truth.q_ned_frd,
            *truth.angular_velocity_frd_rad_s,
            *_NO_MOTORS,
        )
        tape.at = step_estimate(
            self.flat,
            self.model,
            tape.numbers,
            tape.at,
            state,
            truth.acceleration_ned_m_s2,
            dt_s,
            self.gnss_available,
            truth.on_surface and not self.motors_run,
        )
        return self.show(t_us, self.flat)

    def show(self, t_us: int, flat: Any) -> VehicleEstimate:
        """Copy a flat state into the estimate that everybody reads."""
        e = self.estimate
        shown = flat[POSITION:_PART].tolist() if COMPILED else flat[POSITION:_PART]
        x, y, z, vx, vy, vz, ax, ay, az, e.height_rate_ned_m_s, qw, qx, qy, qz, p, q, r, dp, dq, dr, e.yaw_rad = shown
        e.t_us = t_us
        e.position_ned_m, e.velocity_ned_m_s, e.acceleration_ned_m_s2 = (x, y, z), (vx, vy, vz), (ax, ay, az)
        e.q_ned_frd = (qw, qx, qy, qz)
        e.angular_velocity_frd_rad_s, e.angular_acceleration_frd_rad_s2 = (p, q, r), (dp, dq, dr)
        return e

    def _watch_gnss(self, dt_s: float) -> None:
        """PX4 says that it reckons dead a second after the last aiding."""
        self._without_gnss_us = 0 if self.gnss_available else self._without_gnss_us + round(dt_s * 1e6)
        self.estimate.is_dead_reckoning = self._without_gnss_us > _DEAD_RECKONING_AFTER_US

    def jump_position(self, north_m: float, east_m: float) -> None:
        """The estimator resets its horizontal position by this much (a fault, or GNSS coming back)."""
        self.flat[_OFFSET] += north_m
        self.flat[_OFFSET + 1] += east_m
        self.estimate.position_xy_resets += 1
        self.estimate.position_xy_jump_m = (north_m, east_m)

    def jump_height(self, down_m: float) -> None:
        """The estimator resets its height by this much."""
        self.flat[_OFFSET + 2] += down_m
        self.estimate.position_z_resets += 1
        self.estimate.position_z_jump_m = down_m

    def jump_velocity(self, north_m_s: float, east_m_s: float) -> None:
        """The estimator resets its horizontal velocity by this much."""
        self.flat[_VELOCITY_OFFSET] += north_m_s
        self.flat[_VELOCITY_OFFSET + 1] += east_m_s
        self.estimate.velocity_xy_resets += 1
        self.estimate.velocity_xy_jump_m_s = (north_m_s, east_m_s)

    def jump_yaw(self, angle_rad: float) -> None:
        """The estimator resets its heading by this much."""
        self.flat[_YAW_OFFSET] = wrap(float(self.flat[_YAW_OFFSET]) + angle_rad)
        self.estimate.yaw_resets += 1
        self.estimate.yaw_jump_rad = angle_rad
