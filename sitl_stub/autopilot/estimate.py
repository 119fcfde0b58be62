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

import numpy as np

from sitl_stub.autopilot.low_pass import Butterworth, butterworth, filter_sample, settled
from sitl_stub.autopilot.noise import NormalTape
from sitl_stub.autopilot.vehicle_estimate import VehicleEstimate
from sitl_stub.multirotor import VehicleTruth
from sitl_stub.rotation import Quaternion, Vec3, from_rotation_vector, multiply, normalise, wrap, yaw_of

_SAMPLE_HZ = 250.0
_ERROR_PERIOD_US = 8_000
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

    __slots__ = ("_noise", "_rate", "_time_s", "value")

    def __init__(self, rate: float, time_s: float, noise: NormalTape) -> None:
        self._rate, self._time_s, self._noise = rate, time_s, noise
        self.value = rate * sqrt(0.5 * time_s) * noise.next()

    def step(self, dt_s: float) -> None:
        self.value += -dt_s / self._time_s * self.value + self._rate * sqrt(dt_s) * self._noise.next()


class SlowError:
    """A stationary process of given sigma and correlation time, smoothed so that its derivative stays small."""

    __slots__ = ("_noise", "_raw", "_sigma", "_smooth_s", "_time_s", "value")

    def __init__(self, sigma: float, time_s: float, noise: NormalTape, smooth_s: float = 1.0) -> None:
        self._sigma = sigma * sqrt(1.0 + smooth_s / time_s)
        self._time_s, self._smooth_s, self._noise = time_s, smooth_s, noise
        self._raw = self._sigma * noise.next()
        self.value = self._raw * time_s / (time_s + smooth_s)

    def step(self, dt_s: float) -> None:
        share = dt_s / self._time_s
        self._raw += -share * self._raw + self._sigma * sqrt(2.0 * share) * self._noise.next()
        self.value += dt_s / self._smooth_s * (self._raw - self.value)


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
_STANDING_PART = 0.1
"""What is left of the velocity error while the estimator knows that the vehicle stands."""
_ACCELERATION_NOISE_PART = 0.6


class Estimator:
    """Fills one `VehicleEstimate` from truth. `gnss_available` False is a GNSS loss."""

    def __init__(
        self,
        parameters: Mapping[str, float | int],
        rng: np.random.Generator,
        errors: EstimateErrors = EstimateErrors(),
    ) -> None:
        self.estimate = VehicleEstimate()
        self.gnss_available = True
        self._errors = errors
        self._parameters = parameters
        self._noise = NormalTape(rng)
        self._start_errors(errors, self._noise)
        self._offset: Vec3 = (0.0, 0.0, 0.0)
        self._velocity_offset: Vec3 = (0.0, 0.0, 0.0)
        self._yaw_offset = 0.0
        self._without_gnss_us = 0
        self._since_error_us = _ERROR_PERIOD_US
        self._since_slow_s = 0.0
        self.refresh()
        self._gyro = [[0.0, 0.0], [0.0, 0.0], [0.0, 0.0]]
        self._gyro_last: Vec3 = (0.0, 0.0, 0.0)

    def _start_errors(self, errors: EstimateErrors, noise: NormalTape) -> None:
        scale, root = errors.position, sqrt(_SENSOR_STEP_S)
        self._velocity_walk = [Wander(scale * sigma * root, _VELOCITY_PULL_S, noise) for sigma in _ACCEL_NOISE_M_S2]
        self._slow_velocity = [
            SlowError(scale * sigma, _SLOW_VELOCITY_TIME_S, noise) for sigma in _SLOW_VELOCITY_SIGMA_M_S
        ]
        self._tilt_walk = [Wander(errors.tilt * sigma * root, _TILT_PULL_S, noise) for sigma in _GYRO_NOISE_RAD_S[:2]]
        self._slow_tilt = [SlowError(errors.tilt * _SLOW_TILT_SIGMA_RAD, _SLOW_TILT_TIME_S, noise) for _ in range(2)]
        self._yaw = SlowError(errors.yaw * _YAW_SIGMA_RAD, _YAW_TIME_S, noise)
        self._ground = SlowError(errors.ground_height * _GROUND_HEIGHT_SIGMA_M, _GROUND_HEIGHT_TIME_S, noise, 5.0)
        self._walks = (*self._velocity_walk, *self._tilt_walk)
        self._slow = (*self._slow_velocity, *self._slow_tilt, self._yaw, self._ground)
        self._velocity_error: Vec3 = (0.0, 0.0, 0.0)
        self._position_error: Vec3 = (0.0, 0.0, 0.0)
        self._reckoning = (0.0, 0.0)
        self._height_error_rate = 0.0
        self._acceleration_noise: Vec3 = (0.0, 0.0, 0.0)
        self._attitude_error: Quaternion = (1.0, 0.0, 0.0, 0.0)

    def refresh(self) -> None:
        """Read the filter parameters again."""
        self._gyro_filter: Butterworth = butterworth(float(self._parameters["IMU_GYRO_CUTOFF"]), _SAMPLE_HZ)
        cutoff_hz = float(self._parameters["IMU_DGYRO_CUTOFF"])
        self._derivative_time_s = 1.0 / (2.0 * pi * cutoff_hz) if cutoff_hz > 0.0 else 0.0

    def settle(self, truth: VehicleTruth) -> None:
        """Start the filters as if the vehicle had been turning like this for long (starts in the air)."""
        self._gyro = [[settled(self._gyro_filter, rate)] * 2 for rate in truth.angular_velocity_frd_rad_s]
        self._gyro_last = truth.angular_velocity_frd_rad_s
        self.estimate.angular_acceleration_frd_rad_s2 = (0.0, 0.0, 0.0)

    def step(self, t_us: int, truth: VehicleTruth, range_m: float | None, dt_s: float) -> VehicleEstimate:
        """Advance the errors by dt_s and return the estimate (the same object each time)."""
        self._since_error_us += round(dt_s * 1e6)
        if self._since_error_us >= _ERROR_PERIOD_US:
            self._step_errors(self._since_error_us * 1e-6, truth)
            self._since_error_us = 0
        e = self.estimate
        e.t_us = t_us
        self._put_motion(e, truth)
        self._put_attitude(e, truth)
        self._put_rates(e, truth, dt_s)
        e.height_above_bottom_m = range_m
        return e

    def _step_errors(self, dt_s: float, truth: VehicleTruth) -> None:
        aided = self.gnss_available
        self._without_gnss_us = 0 if aided else self._without_gnss_us + round(dt_s * 1e6)
        self.estimate.is_dead_reckoning = self._without_gnss_us > _DEAD_RECKONING_AFTER_US
        for walk in self._walks:
            walk.step(dt_s)
        self._since_slow_s += dt_s
        if self._since_slow_s >= _SLOW_PERIOD_S:
            for slow in self._slow:
                slow.step(self._since_slow_s)
            self._since_slow_s = 0.0
        self._reckon(dt_s)
        yaw_rad = yaw_of(truth.q_ned_frd)
        self._velocity_error = self._velocity_errors(cos(yaw_rad), sin(yaw_rad), truth.on_surface)
        self._drift(dt_s, aided)
        scale = self._errors.position * _ACCELERATION_NOISE_PART
        if scale > 0.0:
            next_number = self._noise.next
            x, y, z = (scale * sigma * next_number() for sigma in _ACCEL_NOISE_M_S2)
            self._acceleration_noise = (x, y, z)
        # Roll and pitch errors turn in B, the yaw error about down in W; small angles.
        roll, pitch = (walk.value + slow.value for walk, slow in zip(self._tilt_walk, self._slow_tilt, strict=True))
        c, s = cos(yaw_rad), sin(yaw_rad)
        self._attitude_error = from_rotation_vector(
            c * roll - s * pitch, s * roll + c * pitch, self._yaw.value + self._yaw_offset
        )

    def _velocity_errors(self, c: float, s: float, standing: bool) -> Vec3:
        """Body-axis walks turned by the heading, slow errors and dead reckoning in W."""
        forward, right, down = self._velocity_walk
        north, east, slow_down = self._slow_velocity
        part = _STANDING_PART if standing else 1.0
        x = c * forward.value - s * right.value + north.value + self._reckoning[0]
        y = s * forward.value + c * right.value + east.value + self._reckoning[1]
        return (part * x, part * y, part * (down.value + slow_down.value))

    def _drift(self, dt_s: float, aided: bool) -> None:
        """Position error follows the velocity error; GNSS and barometer pull it back."""
        (x, y, z), (vx, vy, vz) = self._position_error, self._velocity_error
        pull_x, pull_y, pull_z = _POSITION_PULL_S
        self._height_error_rate = vz - z / pull_z
        if aided:
            vx, vy = vx - x / pull_x, vy - y / pull_y
        self._position_error = (x + vx * dt_s, y + vy * dt_s, z + self._height_error_rate * dt_s)

    def _reckon(self, dt_s: float) -> None:
        """Velocity error that grows without GNSS as a random walk, and goes back quickly with it."""
        x, y = self._reckoning
        if self.gnss_available:
            self._reckoning = (x * (1.0 - dt_s), y * (1.0 - dt_s))
            return
        step = self._errors.position * _DEAD_RECKONING_DRIFT_M_S2 * sqrt(dt_s)
        self._reckoning = (x + step * self._noise.next(), y + step * self._noise.next())

    def _put_motion(self, e: VehicleEstimate, truth: VehicleTruth) -> None:
        (x, y, z), (vx, vy, vz) = truth.position_ned_m, truth.velocity_ned_m_s
        (dx, dy, dz), (ex, ey, ez) = self._position_error, self._velocity_error
        (ox, oy, oz), (ux, uy, uz) = self._offset, self._velocity_offset
        (ax, ay, az), (nx, ny, nz) = truth.acceleration_ned_m_s2, self._acceleration_noise
        e.position_ned_m = (x + dx + ox, y + dy + oy, z + dz + self._ground.value + oz)
        e.velocity_ned_m_s = (vx + ex + ux, vy + ey + uy, vz + ez + uz)
        e.height_rate_ned_m_s = vz + self._height_error_rate
        e.acceleration_ned_m_s2 = (ax + nx, ay + ny, az + nz)

    def _put_attitude(self, e: VehicleEstimate, truth: VehicleTruth) -> None:
        q = normalise(multiply(self._attitude_error, truth.q_ned_frd))
        e.q_ned_frd = q
        e.yaw_rad = yaw_of(q)

    def _put_rates(self, e: VehicleEstimate, truth: VehicleTruth, dt_s: float) -> None:
        scale, c, noise = self._errors.gyro_noise, self._gyro_filter, self._noise
        rates = []
        for axis, rate in enumerate(truth.angular_velocity_frd_rad_s):
            if scale > 0.0:
                rate += scale * _GYRO_NOISE_RAD_S[axis] * noise.next()
            state = self._gyro[axis]
            y, state[0], state[1] = filter_sample(c, rate, state[0], state[1])
            rates.append(y)
        keep = self._derivative_time_s / (dt_s + self._derivative_time_s)
        share = (1.0 - keep) / dt_s
        (p, q, r), (lp, lq, lr) = rates, self._gyro_last
        dp, dq, dr = e.angular_acceleration_frd_rad_s2
        e.angular_acceleration_frd_rad_s2 = (
            keep * dp + share * (p - lp),
            keep * dq + share * (q - lq),
            keep * dr + share * (r - lr),
        )
        e.angular_velocity_frd_rad_s = self._gyro_last = (p, q, r)

    def jump_position(self, north_m: float, east_m: float) -> None:
        """The estimator resets its horizontal position by this much (a fault, or GNSS coming back)."""
        x, y, z = self._offset
        self._offset = (x + north_m, y + east_m, z)
        self.estimate.position_xy_resets += 1
        self.estimate.position_xy_jump_m = (north_m, east_m)

    def jump_height(self, down_m: float) -> None:
        """The estimator resets its height by this much."""
        x, y, z = self._offset
        self._offset = (x, y, z + down_m)
        self.estimate.position_z_resets += 1
        self.estimate.position_z_jump_m = down_m

    def jump_velocity(self, north_m_s: float, east_m_s: float) -> None:
        """The estimator resets its horizontal velocity by this much."""
        x, y, z = self._velocity_offset
        self._velocity_offset = (x + north_m_s, y + east_m_s, z)
        self.estimate.velocity_xy_resets += 1
        self.estimate.velocity_xy_jump_m_s = (north_m_s, east_m_s)

    def jump_yaw(self, angle_rad: float) -> None:
        """The estimator resets its heading by this much."""
        self._yaw_offset = wrap(self._yaw_offset + angle_rad)
        self.estimate.yaw_resets += 1
        self.estimate.yaw_jump_rad = angle_rad
