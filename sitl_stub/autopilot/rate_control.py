"""PX4's body-rate loop: PID with the D term on the measured angular acceleration, and its integrator's rules.

The integrator stops against a saturated direction, weakens with large errors (beyond 100 degrees/s) and stands still on the
ground. Torques are normalised: 1 is the most the mixer can give. The yaw torque passes a first-order filter (MC_YAW_TQ_CUTOFF).
Pure functions; called by cascade.py at 250 Hz.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import pi, radians
from typing import NamedTuple

from sitl_stub.compiled import used_by_kernels
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


@used_by_kernels
def _integrate(integral: float, error: float, gain: float, limit: float, saturated: float, dt: float) -> float:
    if saturated != 0.0 and error * saturated > 0.0:
        return integral
    weak = error / _WEAKEN_RAD_S
    part = 1.0 - weak * weak
    if part <= 0.0:
        return integral
    integral += part * gain * error * dt
    return limit if integral > limit else -limit if integral < -limit else integral


@used_by_kernels
def control_rates(
    state: tuple[float, float, float, float],
    rates: Vec3,
    demand: Vec3,
    acceleration: Vec3,
    saturated: Vec3,
    landed: bool,
    gains: RateGains,
    dt: float,
) -> tuple[Vec3, tuple[float, float, float, float]]:
    """Normalised torques and the numbers of the new RateState. `saturated` holds the sign of the torque the mixer could not give, per axis."""
    (p0, p1, p2), (g0, g1, g2), (d0, d1, d2), (f0, f1, f2), (most0, most1, most2), yaw_time_s = gains
    (s0, s1, s2), (a0, a1, a2) = demand, acceleration
    e0, e1, e2 = s0 - rates[0], s1 - rates[1], s2 - rates[2]
    i0, i1, i2, yaw_torque = state
    roll = p0 * e0 + i0 - d0 * a0 + f0 * s0
    pitch = p1 * e1 + i1 - d1 * a1 + f1 * s1
    yaw = p2 * e2 + i2 - d2 * a2 + f2 * s2
    yaw_torque += dt / (dt + yaw_time_s) * (yaw - yaw_torque)
    if not landed:
        i0 = _integrate(i0, e0, g0, most0, saturated[0], dt)
        i1 = _integrate(i1, e1, g1, most1, saturated[1], dt)
        i2 = _integrate(i2, e2, g2, most2, saturated[2], dt)
    return (roll, pitch, yaw_torque), (i0, i1, i2, yaw_torque)
