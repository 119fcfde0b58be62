"""PX4's attitude loop: proportional on the quaternion error, roll and pitch before yaw (MC_YAW_WEIGHT).

The direction of thrust is corrected along the shortest way; of the remaining turn about B z only the yaw weight's part is
asked for, with a gain that makes up for it. The commanded heading rate is fed forward about W down. q_WB Hamilton, rates in
B, rad/s. Pure functions; called by cascade.py at 250 Hz.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import atan2, cos, radians, sin, sqrt
from typing import NamedTuple

from sitl_stub.compiled import used_by_kernels
from sitl_stub.rotation import Quaternion, Vec3, multiply


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


@used_by_kernels
def _error(q: Quaternion, qd: Quaternion, weight: float) -> Quaternion:
    """Turn in B from q to a desired attitude with full tilt and a part of the turn about B z.

    The whole error is a turn about B z followed by the shortest tilt; their half angles are read off its components.
    """
    w, x, y, z = q
    w, x, y, z = multiply((w, -x, -y, -z), qd)
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    cosine = sqrt(w * w + z * z)
    if cosine < 1e-5:
        return w, x, y, z
    # Of the tilt's axis, what is left after taking the turn (w, z) / cosine out.
    cw, sw = w / cosine, z / cosine
    tx, ty = x * cw - y * sw, x * sw + y * cw
    half = weight * atan2(sw, cw)
    c, s = cos(half), sin(half)
    return cosine * c, tx * c + ty * s, ty * c - tx * s, cosine * s


@used_by_kernels
def control_attitude(q: Quaternion, qd: Quaternion, yaw_rate: float, gains: AttitudeGains) -> Vec3:
    """Body rates that take the vehicle from q towards qd, limited by MC_*RATE_MAX."""
    roll, pitch, yaw, yaw_weight, most_p, most_t, most_r = gains
    _, ex, ey, ez = _error(q, qd, yaw_weight)
    p, t, r = 2.0 * ex * roll, 2.0 * ey * pitch, 2.0 * ez * yaw
    if yaw_rate != 0.0:
        # Down, seen from B, times the commanded heading rate.
        w, x, y, z = q
        p += 2.0 * (x * z - w * y) * yaw_rate
        t += 2.0 * (y * z + w * x) * yaw_rate
        r += (w * w - x * x - y * y + z * z) * yaw_rate
    return (
        -most_p if p < -most_p else most_p if p > most_p else p,
        -most_t if t < -most_t else most_t if t > most_t else t,
        -most_r if r < -most_r else most_r if r > most_r else r,
    )
