"""PX4's attitude loop: proportional on the quaternion error, roll and pitch before yaw (MC_YAW_WEIGHT).

The direction of thrust is corrected along the shortest way; of the remaining turn about B z only the yaw weight's part is
asked for, with a gain that makes up for it. The commanded heading rate is fed forward about W down. q_WB Hamilton, rates in
B, rad/s. Pure functions; called by cascade.py at 250 Hz.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import acos, asin, cos, radians, sin
from typing import NamedTuple

from sitl_stub.rotation import Quaternion, Vec3, between, inverse, multiply, z_axis


class AttitudeGains(NamedTuple):
    """Constants from PX4 parameters."""

    roll: float
    pitch: float
    yaw: float
    yaw_weight: float
    roll_rate_max: float
    pitch_rate_max: float
    yaw_rate_max: float


def attitude_gains(parameters: Mapping[str, float | int]) -> AttitudeGains:
    """Gains by their PX4 names."""
    weight = min(max(float(parameters["MC_YAW_WEIGHT"]), 0.0), 1.0)
    return AttitudeGains(
        parameters["MC_ROLL_P"],
        parameters["MC_PITCH_P"],
        parameters["MC_YAW_P"] / weight if weight > 1e-4 else parameters["MC_YAW_P"],
        weight,
        radians(parameters["MC_ROLLRATE_MAX"]),
        radians(parameters["MC_PITCHRATE_MAX"]),
        radians(parameters["MC_YAWRATE_MAX"]),
    )


def _weaken_yaw(q: Quaternion, qd: Quaternion, weight: float) -> Quaternion:
    """Desired attitude with full tilt and a part of the turn about B z."""
    ex, ey, ez = z_axis(q)
    dx, dy, dz = z_axis(qd)
    tilt = between((ex, ey, ez), (dx, dy, dz))
    if abs(tilt[1]) > 1.0 - 1e-5 or abs(tilt[2]) > 1.0 - 1e-5:
        return qd
    reduced = multiply(tilt, q)
    w, _, _, z = multiply(inverse(reduced), qd)
    if w < 0.0:
        w, z = -w, -z
    w, z = min(max(w, -1.0), 1.0), min(max(z, -1.0), 1.0)
    return multiply(reduced, (cos(weight * acos(w)), 0.0, 0.0, sin(weight * asin(z))))


def control_attitude(q: Quaternion, qd: Quaternion, yaw_rate: float, gains: AttitudeGains) -> Vec3:
    """Body rates that take the vehicle from q towards qd, limited by MC_*RATE_MAX."""
    ew, ex, ey, ez = multiply(inverse(q), _weaken_yaw(q, qd, gains.yaw_weight))
    two = 2.0 if ew >= 0.0 else -2.0
    # Down, seen from B, times the commanded heading rate.
    w, x, y, z = q
    dx, dy, dz = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z
    p = two * ex * gains.roll + dx * yaw_rate
    r = two * ez * gains.yaw + dz * yaw_rate
    t = two * ey * gains.pitch + dy * yaw_rate
    return (
        min(max(p, -gains.roll_rate_max), gains.roll_rate_max),
        min(max(t, -gains.pitch_rate_max), gains.pitch_rate_max),
        min(max(r, -gains.yaw_rate_max), gains.yaw_rate_max),
    )
