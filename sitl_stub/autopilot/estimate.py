"""The state estimator as its users see it: truth plus the errors that PX4's EKF shows in simulation.

Not a filter but a model of one's error. Velocity error per axis is a slowly varying process; position error follows its integral,
pulled back by GNSS, so both drift together. Roll and pitch have a slow bias, yaw a larger one, height an offset that is there from
the start and wanders while the vehicle stands. Without GNSS the pull ends and the velocity error grows: dead reckoning. Gyro
noise passes PX4's own filters. W local NED with its origin at the start, B FRD. All randomness from the generator given.
Called by the autopilot each step, between truth and cascade; `VehicleEstimate` is what it fills.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi, radians, sqrt

import numpy as np

from sitl_stub.autopilot.low_pass import Butterworth, butterworth, filter_sample, settled
from sitl_stub.autopilot.vehicle_estimate import VehicleEstimate
from sitl_stub.multirotor import VehicleTruth
from sitl_stub.rotation import Vec3, from_euler, multiply, normalise, wrap, yaw_of

_SAMPLE_HZ = 250.0
_ERROR_PERIOD_US = 8_000
_BLOCK = 4096


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


class Noise:
    """Standard normal numbers from a generator, drawn in blocks."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._block: list[float] = []

    def draw(self) -> float:
        if not self._block:
            self._block = self._rng.standard_normal(_BLOCK).tolist()
        return self._block.pop()


class SlowError:
    """A stationary process of given sigma and correlation time, smoothed so that its derivative stays small."""

    __slots__ = ("_noise", "_raw", "_sigma", "_smooth_s", "_time_s", "value")

    def __init__(self, sigma: float, time_s: float, noise: Noise, smooth_s: float = 0.5) -> None:
        self._sigma = sigma * sqrt(1.0 + smooth_s / time_s)
        self._time_s, self._smooth_s, self._noise = time_s, smooth_s, noise
        self._raw = self._sigma * noise.draw()
        self.value = self._raw * time_s / (time_s + smooth_s)

    def step(self, dt_s: float) -> float:
        share = dt_s / self._time_s
        self._raw += -share * self._raw + self._sigma * sqrt(2.0 * share) * self._noise.draw()
        self.value += dt_s / self._smooth_s * (self._raw - self.value)
        return self.value


class DriftAxis:
    """Velocity error of one axis and the position error it makes."""

    __slots__ = ("_pull_s", "position", "velocity")

    def __init__(self, sigma_m_s: float, time_s: float, pull_s: float, noise: Noise) -> None:
        self.velocity = SlowError(sigma_m_s, time_s, noise)
        self._pull_s = pull_s
        self.position = 0.0

    def step(self, dt_s: float, aided: bool) -> None:
        rate = self.velocity.step(dt_s)
        if aided:
            rate -= self.position / self._pull_s
        self.position += rate * dt_s


# Fact 22 of the recording: horizontal velocity error 0.14 to 0.31 m/s, vertical 0.19, correlation 4 to 8 s; position 0.1 to 0.3 m,
# height 0.3 to 0.4 m; yaw up to 8 degrees slowly, roll and pitch 1 to 1.5 degrees. The pull times make the position sigmas.
_VELOCITY_SIGMA_M_S = (0.2, 0.2, 0.19)
_VELOCITY_TIME_S = (5.0, 5.0, 6.0)
_POSITION_PULL_S = (1.4, 1.4, 2.2)
_TILT_SIGMA_RAD, _TILT_TIME_S = radians(1.0), 40.0
_YAW_SIGMA_RAD, _YAW_TIME_S = radians(3.5), 40.0
_GROUND_HEIGHT_SIGMA_M, _GROUND_HEIGHT_TIME_S = 0.45, 60.0
_GYRO_NOISE_RAD_S = (0.14, 0.07, 0.03)
_DEAD_RECKONING_AFTER_US = 1_000_000
_DEAD_RECKONING_DRIFT_M_S2 = 0.15


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
        noise = self._noise = Noise(rng)
        self._drift = [
            DriftAxis(errors.position * sigma, time, pull, noise)
            for sigma, time, pull in zip(_VELOCITY_SIGMA_M_S, _VELOCITY_TIME_S, _POSITION_PULL_S, strict=True)
        ]
        self._tilt = [SlowError(errors.tilt * _TILT_SIGMA_RAD, _TILT_TIME_S, noise, 2.0) for _ in range(2)]
        self._yaw = SlowError(errors.yaw * _YAW_SIGMA_RAD, _YAW_TIME_S, noise, 2.0)
        self._ground = SlowError(errors.ground_height * _GROUND_HEIGHT_SIGMA_M, _GROUND_HEIGHT_TIME_S, noise, 5.0)
        self._offset: Vec3 = (0.0, 0.0, 0.0)
        self._velocity_offset: Vec3 = (0.0, 0.0, 0.0)
        self._yaw_offset = 0.0
        self._without_gnss_us = 0
        self._reckoning: Vec3 = (0.0, 0.0, 0.0)
        self._since_error_us = _ERROR_PERIOD_US
        self._attitude_error = (1.0, 0.0, 0.0, 0.0)
        self.refresh()
        self._gyro = [[0.0, 0.0], [0.0, 0.0], [0.0, 0.0]]
        self._gyro_last: Vec3 = (0.0, 0.0, 0.0)

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
            self._step_errors(self._since_error_us * 1e-6, truth.on_surface)
            self._since_error_us = 0
        e = self.estimate
        e.t_us = t_us
        self._put_motion(e, truth)
        self._put_attitude(e, truth)
        self._put_rates(e, truth, dt_s)
        e.height_above_bottom_m = range_m
        return e

    def _step_errors(self, dt_s: float, on_surface: bool) -> None:
        aided = self.gnss_available
        self._without_gnss_us = 0 if aided else self._without_gnss_us + round(dt_s * 1e6)
        for axis in self._drift:
            axis.step(dt_s, aided)
        self._ground.step(dt_s)
        roll, pitch, yaw = self._tilt[0].step(dt_s), self._tilt[1].step(dt_s), self._yaw.step(dt_s)
        self._attitude_error = from_euler(roll, pitch, yaw + self._yaw_offset)
        self._reckon(dt_s)
        self.estimate.is_dead_reckoning = self._without_gnss_us > _DEAD_RECKONING_AFTER_US

    def _reckon(self, dt_s: float) -> None:
        """Velocity error that grows without GNSS as a random walk, and goes back quickly with it."""
        if self.gnss_available:
            keep = 1.0 - dt_s
            self._reckoning = (self._reckoning[0] * keep, self._reckoning[1] * keep, 0.0)
            return
        step = self._errors.position * _DEAD_RECKONING_DRIFT_M_S2 * sqrt(dt_s)
        x, y, _ = self._reckoning
        self._reckoning = (x + step * self._noise.draw(), y + step * self._noise.draw(), 0.0)

    def _put_motion(self, e: VehicleEstimate, truth: VehicleTruth) -> None:
        (x, y, z), (vx, vy, vz) = truth.position_ned_m, truth.velocity_ned_m_s
        dx, dy, dz = self._drift
        ox, oy, oz = self._offset
        ux, uy, uz = self._velocity_offset
        rx, ry, _ = self._reckoning
        e.position_ned_m = (x + dx.position + ox, y + dy.position + oy, z + dz.position + self._ground.value + oz)
        if truth.on_surface:
            # At rest the estimator knows that it stands (zero-velocity update): only a trace of the error is left.
            e.velocity_ned_m_s = (
                vx + 0.1 * dx.velocity.value,
                vy + 0.1 * dy.velocity.value,
                vz + 0.1 * dz.velocity.value,
            )
        else:
            e.velocity_ned_m_s = (
                vx + dx.velocity.value + ux + rx,
                vy + dy.velocity.value + uy + ry,
                vz + dz.velocity.value + uz,
            )
        e.acceleration_ned_m_s2 = truth.acceleration_ned_m_s2

    def _put_attitude(self, e: VehicleEstimate, truth: VehicleTruth) -> None:
        q = normalise(multiply(self._attitude_error, truth.q_ned_frd))
        e.q_ned_frd = q
        e.yaw_rad = yaw_of(q)

    def _put_rates(self, e: VehicleEstimate, truth: VehicleTruth, dt_s: float) -> None:
        scale, c, noise = self._errors.gyro_noise, self._gyro_filter, self._noise
        rates = []
        for axis, rate in enumerate(truth.angular_velocity_frd_rad_s):
            if scale > 0.0:
                rate += scale * _GYRO_NOISE_RAD_S[axis] * noise.draw()
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
