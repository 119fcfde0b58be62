"""PX4's hover thrust estimator: a one-state Kalman filter on vertical acceleration against commanded thrust.

z = g thrust / hover - g. The measurement noise is learnt from the residual and scaled up in fast flight, the state's noise is
HTE_HT_NOISE. The estimate replaces MPC_THR_HOVER in the position controller (MPC_USE_HTE) and the controller's z integrator
absorbs each change. Upwards positive, m/s^2, thrust 0..1. Called by cascade.py at 125 Hz.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import hypot

from sitl_stub.rotation import Vec3

GRAVITY_M_S2 = 9.80665
_NOISE_TIME_S = 2.0
_RESIDUAL_TIME_S = 1.0
_FIRST_NOISE_VARIANCE = 5.0
_VALID_VARIANCE = 0.001
_VALID_AFTER_S = 2.0
_SETTLED_VARIANCE = 1.6e-6


class HoverThrust:
    """`value` is the estimate, `is_valid` whether the controller may use it."""

    def __init__(self, parameters: Mapping[str, float | int]) -> None:
        self.refresh(parameters)
        self.reset()

    def refresh(self, parameters: Mapping[str, float | int]) -> None:
        """Read the parameters again."""
        p = parameters
        self._start = float(p["MPC_THR_HOVER"])
        self._range = float(p["HTE_THR_RANGE"])
        self._process = float(p["HTE_HT_NOISE"]) ** 2
        self._gate = float(p["HTE_ACC_GATE"])
        self._first_variance = float(p["HTE_HT_ERR_INIT"]) ** 2
        self._fast_z, self._fast_xy = float(p["HTE_VZ_THR"]), float(p["HTE_VXY_THR"])

    def reset(self) -> None:
        """Forget; the next flight starts from MPC_THR_HOVER."""
        self.value = self._start
        self.variance = self._first_variance
        self.is_valid = False
        self._noise = _FIRST_NOISE_VARIANCE
        self._residual = 0.0
        self._ratio = 0.0
        self._good_for_s = 0.0

    def start(self, value: float) -> None:
        """Begin with an estimate that has already settled (starts in the air)."""
        self.value, self.variance, self.is_valid = value, _SETTLED_VARIANCE, True
        self._noise = 1.0

    def update(self, acceleration_up: float, thrust_up: float, velocity_ned_m_s: Vec3, dt: float) -> None:
        """Fuse one pair of acceleration and thrust."""
        self.variance += self._process * dt * dt
        vx, vy, vz = velocity_ned_m_s
        scale = max(abs(vz) - self._fast_z + 1.0, hypot(vx, vy) - self._fast_xy + 1.0, 1.0)
        slope = -GRAVITY_M_S2 * thrust_up / (self.value * self.value)
        noise = self._noise * scale * scale
        innovation_variance = slope * slope * self.variance + noise
        innovation = acceleration_up - self._predict(thrust_up)
        ratio = innovation * innovation / (self._gate * self._gate * innovation_variance)
        if ratio < 1.0:
            gain = self.variance * slope / innovation_variance
            low, high = max(self._start - self._range, 0.1), min(self._start + self._range, 0.9)
            self.value = min(max(self.value + gain * innovation, low), high)
            self.variance = min(max((1.0 - gain * slope) * self.variance, 1e-10), 1.0)
        elif abs(self._ratio) > 0.2:
            self.variance += 1e3 * self._process * dt
        self._learn(
            acceleration_up - self._predict(thrust_up), slope, min(ratio, 1.0) * (1 if innovation > 0 else -1), dt
        )
        self._judge(ratio, dt)

    def _predict(self, thrust_up: float) -> float:
        return GRAVITY_M_S2 * thrust_up / self.value - GRAVITY_M_S2

    def _learn(self, residual: float, slope: float, signed_ratio: float, dt: float) -> None:
        share = dt / (_RESIDUAL_TIME_S + dt)
        self._residual += share * (residual - self._residual)
        self._ratio += share * (signed_ratio - self._ratio)
        share = dt / (_NOISE_TIME_S + dt)
        steady = residual - self._residual
        sample = steady * steady + slope * slope * self.variance
        self._noise = min(max(self._noise + share * (sample - self._noise), 1.0), 400.0)

    def _judge(self, ratio: float, dt: float) -> None:
        good = self.variance < _VALID_VARIANCE and (self.is_valid or ratio < 1.0)
        self._good_for_s = self._good_for_s + dt if good else 0.0
        self.is_valid = good and (self.is_valid or self._good_for_s >= _VALID_AFTER_S)
