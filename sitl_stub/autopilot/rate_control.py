"""PX4's body-rate loop: PID with the D term on the measured angular acceleration, and its integrator's rules.

The integrator stops against a saturated direction, weakens with large errors (beyond 100 degrees/s) and stands still on the
ground. Torques are normalised: 1 is the most the mixer can give. The yaw torque passes a first-order filter (MC_YAW_TQ_CUTOFF).
Pure functions; called by cascade.py at 250 Hz.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import pi, radians
from typing import NamedTuple

from sitl_stub.rotation import Vec3

_WEAKEN_RAD_S = radians(400.0)


class RateGains(NamedTuple):
    """Constants from PX4 parameters; p, i, d, feed-forward and integrator limit for roll, pitch, yaw."""

    p: Vec3
    i: Vec3
    d: Vec3
    feed_forward: Vec3
    integral_max: Vec3
    yaw_torque_time_constant: float


class RateState(NamedTuple):
    """Integrators and the filtered yaw torque."""

    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0
    yaw_torque: float = 0.0


def rate_gains(parameters: Mapping[str, float | int]) -> RateGains:
    """Gains by their PX4 names; the K of an axis multiplies its P, I and D."""
    axes = ("ROLL", "PITCH", "YAW")

    def three(letter: str) -> Vec3:
        roll, pitch, yaw = (parameters[f"MC_{axis}RATE_{letter}"] * parameters[f"MC_{axis}RATE_K"] for axis in axes)
        return roll, pitch, yaw

    cutoff_hz = parameters["MC_YAW_TQ_CUTOFF"]
    return RateGains(
        three("P"),
        three("I"),
        three("D"),
        (parameters["MC_ROLLRATE_FF"], parameters["MC_PITCHRATE_FF"], parameters["MC_YAWRATE_FF"]),
        (parameters["MC_RR_INT_LIM"], parameters["MC_PR_INT_LIM"], parameters["MC_YR_INT_LIM"]),
        1.0 / (2.0 * pi * cutoff_hz) if cutoff_hz > 0.0 else 0.0,
    )


def _integrate(integral: float, error: float, gain: float, limit: float, saturated: float, dt: float) -> float:
    if saturated > 0.0:
        error = min(error, 0.0)
    elif saturated < 0.0:
        error = max(error, 0.0)
    weak = error / _WEAKEN_RAD_S
    integral += max(0.0, 1.0 - weak * weak) * gain * error * dt
    return min(max(integral, -limit), limit)


def control_rates(
    state: RateState,
    rates: Vec3,
    demand: Vec3,
    acceleration: Vec3,
    saturated: Vec3,
    landed: bool,
    gains: RateGains,
    dt: float,
) -> tuple[Vec3, RateState]:
    """Normalised torques and the new state. `saturated` holds the sign of the torque the mixer could not give, per axis."""
    e0, e1, e2 = demand[0] - rates[0], demand[1] - rates[1], demand[2] - rates[2]
    p, i, d, ff, most = gains.p, gains.i, gains.d, gains.feed_forward, gains.integral_max
    roll = p[0] * e0 + state.roll - d[0] * acceleration[0] + ff[0] * demand[0]
    pitch = p[1] * e1 + state.pitch - d[1] * acceleration[1] + ff[1] * demand[1]
    yaw = p[2] * e2 + state.yaw - d[2] * acceleration[2] + ff[2] * demand[2]
    yaw = state.yaw_torque + dt / (dt + gains.yaw_torque_time_constant) * (yaw - state.yaw_torque)
    if landed:
        return (roll, pitch, yaw), RateState(state.roll, state.pitch, state.yaw, yaw)
    return (roll, pitch, yaw), RateState(
        _integrate(state.roll, e0, i[0], most[0], saturated[0], dt),
        _integrate(state.pitch, e1, i[1], most[1], saturated[1], dt),
        _integrate(state.yaw, e2, i[2], most[2], saturated[2], dt),
        yaw,
    )
