"""PX4's hover thrust estimator: a one-state Kalman filter on vertical acceleration against commanded thrust.

z = g thrust / hover - g. The measurement noise is learnt from the residual and scaled up in fast flight, the state's noise is
HTE_HT_NOISE. The estimate replaces MPC_THR_HOVER in the position controller (MPC_USE_HTE) and the controller's z integrator
absorbs each change. Upwards positive, m/s^2, thrust 0..1. Called by cascade.py at 125 Hz.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import sqrt
from typing import NamedTuple

from sitl_stub.compiled import used_by_kernels
from sitl_stub.rotation import Vec3

GRAVITY_M_S2 = 9.80665
_NOISE_TIME_S = 2.0
_RESIDUAL_TIME_S = 1.0
_FIRST_NOISE_VARIANCE = 5.0
_VALID_VARIANCE = 0.001
_VALID_AFTER_S = 2.0
_SETTLED_VARIANCE = 1.6e-6


class HoverSettings(NamedTuple):
    """Constants from PX4 parameters."""

    start: float
    reach: float
    process: float
    gate: float
    first_variance: float
    fast_z: float
    fast_xy: float


class HoverState(NamedTuple):
    """The filter. `is_valid` is 0 or 1."""

    value: float
    variance: float
    is_valid: float
    noise: float = _FIRST_NOISE_VARIANCE
    residual: float = 0.0
    ratio: float = 0.0
    good_for_s: float = 0.0


HoverNumbers = tuple[float, float, float, float, float, float, float]
"""Of a HoverState; a plain tuple is made in a quarter of the time."""


@used_by_kernels
def fuse(
    s: HoverNumbers, settings: HoverSettings, acceleration_up: float, thrust_up: float, velocity: Vec3, dt: float
) -> HoverNumbers:
    """The filter after one pair of acceleration and thrust."""
    value, variance, was_valid, noise, residual, last_ratio, good_for_s = s
    start, reach, process, gate, _, fast_z, fast_xy = settings
    variance += process * dt * dt
    vx, vy, vz = velocity
    scale, fast_climb, fast_flight = 1.0, abs(vz) - fast_z + 1.0, sqrt(vx * vx + vy * vy) - fast_xy + 1.0
    if fast_climb > scale:
        scale = fast_climb
    if fast_flight > scale:
        scale = fast_flight
    lift = GRAVITY_M_S2 * thrust_up
    slope = -lift / (value * value)
    innovation_variance = slope * slope * variance + noise * scale * scale
    innovation = acceleration_up - (lift / value - GRAVITY_M_S2)
    ratio = innovation * innovation / (gate * gate * innovation_variance)
    if ratio < 1.0:
        gain = variance * slope / innovation_variance
        value += gain * innovation
        low, high = start - reach, start + reach
        low, high = 0.1 if low < 0.1 else low, 0.9 if high > 0.9 else high
        value = low if value < low else value
        value = high if value > high else value
        variance *= 1.0 - gain * slope
        variance = 1e-10 if variance < 1e-10 else 1.0 if variance > 1.0 else variance
    elif abs(last_ratio) > 0.2:
        variance += 1e3 * process * dt
    # The measurement's noise is learnt from what is left of the residual without its mean.
    left = acceleration_up - (lift / value - GRAVITY_M_S2)
    share = dt / (_RESIDUAL_TIME_S + dt)
    residual += share * (left - residual)
    part = ratio if ratio < 1.0 else 1.0
    last_ratio += share * ((part if innovation > 0.0 else -part) - last_ratio)
    steady = left - residual
    sample = steady * steady + slope * slope * variance
    noise += dt / (_NOISE_TIME_S + dt) * (sample - noise)
    noise = 1.0 if noise < 1.0 else 400.0 if noise > 400.0 else noise
    good = variance < _VALID_VARIANCE and (was_valid > 0.0 or ratio < 1.0)
    good_for_s = good_for_s + dt if good else 0.0
    valid = 1.0 if good and (was_valid > 0.0 or good_for_s >= _VALID_AFTER_S) else 0.0
    return (value, variance, valid, noise, residual, last_ratio, good_for_s)


class HoverThrust:
    """`value` is the estimate, `is_valid` whether the controller may use it; `state` is all of it."""

    def __init__(self, parameters: Mapping[str, float | int]) -> None:
        self.refresh(parameters)
        self.reset()

    def refresh(self, parameters: Mapping[str, float | int]) -> None:
        """Read the parameters again."""
        p = parameters
        self.settings = HoverSettings(
            float(p["MPC_THR_HOVER"]),
            float(p["HTE_THR_RANGE"]),
            float(p["HTE_HT_NOISE"]) ** 2,
            float(p["HTE_ACC_GATE"]),
            float(p["HTE_HT_ERR_INIT"]) ** 2,
            float(p["HTE_VZ_THR"]),
            float(p["HTE_VXY_THR"]),
        )

    @property
    def value(self) -> float:
        return self.state.value

    @property
    def variance(self) -> float:
        return self.state.variance

    @property
    def is_valid(self) -> bool:
        return self.state.is_valid > 0.0

    def reset(self) -> None:
        """Forget; the next flight starts from MPC_THR_HOVER."""
        self.state = HoverState(self.settings.start, self.settings.first_variance, 0.0)

    def start(self, value: float) -> None:
        """Begin with an estimate that has already settled (starts in the air)."""
        self.state = HoverState(value, _SETTLED_VARIANCE, 1.0, noise=1.0)

    def update(self, acceleration_up: float, thrust_up: float, velocity_ned_m_s: Vec3, dt: float) -> None:
        """Fuse one pair of acceleration and thrust."""
        self.state = HoverState(*fuse(self.state, self.settings, acceleration_up, thrust_up, velocity_ned_m_s, dt))
