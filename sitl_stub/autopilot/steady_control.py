"""The control cascade in steady flight as one kernel over a flat state: what `Cascade.step` does when nothing but the loops has a say.

Steady: armed, flying, off the ground, a trajectory setpoint that can be flown, a valid estimate. The loops are the same functions in
the same order as in cascade.py, so that both give the same bytes. `k` is the flat state laid out below, `e` the estimator's.
W local NED, B FRD. Called by steady_flight.py, which moves the state in and out of `Cascade`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from sitl_stub.autopilot.attitude_control import AttitudeGains, control_attitude
from sitl_stub.autopilot.hover_thrust import GRAVITY_M_S2, HoverSettings, fuse
from sitl_stub.autopilot.mixer import mix
from sitl_stub.autopilot.position_control import (
    Motion,
    PositionGains,
    attitude_from_thrust,
    demand_numbers,
)
from sitl_stub.autopilot.rate_control import RateGains, control_rates
from sitl_stub.compiled import used_by_kernels

# Places in k.
RATES_SETPOINT, RATE_STATE, SATURATED, THRUST, ATTITUDE_SETPOINT, YAW_RATE = 0, 3, 7, 10, 11, 15
INTEGRAL, HOVER, TILT, LAST_VELOCITY, DERIVATIVE, SINCE_POSITION_US = 16, 19, 20, 21, 24, 27
MOTORS, TORQUE, HOVER_STATE = 28, 32, 35
ASKED_VELOCITY, ASKED_ACCELERATION, ASKED_THRUST, ASKED_YAW, SINCE_DECISION_US = 42, 45, 48, 51, 52
DETECTOR_HOVER, DETECTOR_KNOWS_HOVER = 53, 54
SIZE = 55

STEP_S = 0.004
_STEP_US = 4000.0
_POSITION_PERIOD_US = 8000.0
_TILT_SLEW_RAD_S = 0.2


class LoopConstants(NamedTuple):
    """Gains and limits of all loops."""

    rate: RateGains
    attitude: AttitudeGains
    position: PositionGains
    hover: HoverSettings
    uses_hover_estimate: bool
    speed_xy: float
    climb: float
    descent: float
    tilt: float
    thrust_min: float
    thrust_max: float
    land_speed: float
    derivative_time_s: float


class Asked(NamedTuple):
    """What is flown until the next decision: the setpoint, and what the land detector makes of it."""

    motion: Motion
    yaw_rad: float
    yaw_rate_rad_s: float
    descends: bool
    is_near_ground: bool


@used_by_kernels
def control(k: Any, e: Any, c: LoopConstants, asked: Asked) -> None:
    """One step of 4 ms: rate loop, attitude loop, and every second time the position loop."""
    torque, (k[3], k[4], k[5], k[6]) = control_rates(
        (k[3], k[4], k[5], k[6]),
        (e[64], e[65], e[66]),
        (k[0], k[1], k[2]),
        (e[67], e[68], e[69]),
        (k[7], k[8], k[9]),
        False,
        c.rate,
        STEP_S,
    )
    k[32], k[33], k[34] = torque
    (k[28], k[29], k[30], k[31]), (k[7], k[8], k[9]) = mix(k[10], torque)
    k[0], k[1], k[2] = control_attitude((e[60], e[61], e[62], e[63]), (k[11], k[12], k[13], k[14]), k[15], c.attitude)
    k[27] += _STEP_US
    if k[27] >= _POSITION_PERIOD_US:
        dt = k[27] * 1e-6
        dt = 0.04 if dt > 0.04 else dt
        k[27] = 0.0
        _follow_velocity(k, e, c.derivative_time_s, dt)
        _control_position(k, e, c, asked, dt)
        if c.uses_hover_estimate:
            _estimate_hover_thrust(k, e, c, dt)


@used_by_kernels
def _follow_velocity(k: Any, e: Any, time_s: float, dt: float) -> None:
    both_s = dt + time_s
    share, keep = dt / both_s / dt, time_s / both_s
    x, y, z = e[53], e[54], e[55]
    k[24] = keep * k[24] + share * (x - k[21])
    k[25] = keep * k[25] + share * (y - k[22])
    k[26] = keep * k[26] + share * (z - k[23])
    k[21], k[22], k[23] = x, y, z


@used_by_kernels
def _control_position(k: Any, e: Any, c: LoopConstants, asked: Asked, dt: float) -> None:
    sp, yaw_rad, k[15], _, _ = asked
    _, _, gains, _, _, speed_xy, climb, descent, tilt_max, thrust_min, thrust_max, land_speed, _ = c
    vz, speed = e[55], abs(sp[5])
    if sp[2] != sp[2] and speed > 1e-6:
        vz += min(speed / land_speed, 1.0) * (e[59] - vz)
    step, tilt = _TILT_SLEW_RAD_S * dt, tilt_max - k[20]
    k[20] += -step if tilt < -step else step if tilt > step else tilt
    vx, vy, vz, ax, ay, az, tx, ty, tz, k[16], k[17], k[18] = demand_numbers(
        sp,
        (e[50], e[51], e[52], e[53], e[54], vz, k[24], k[25], k[26]),
        (k[16], k[17], k[18]),
        k[19],
        gains,
        (speed_xy, climb, descent, k[20], thrust_min, thrust_max),
        dt,
    )
    k[42], k[43], k[44], k[45], k[46], k[47], k[48], k[49], k[50] = vx, vy, vz, ax, ay, az, tx, ty, tz
    k[51] = yaw_rad if yaw_rad == yaw_rad else e[70]
    (k[11], k[12], k[13], k[14]), k[10] = attitude_from_thrust(tx, ty, tz, k[51])


@used_by_kernels
def _estimate_hover_thrust(k: Any, e: Any, c: LoopConstants, dt: float) -> None:
    before = (k[35], k[36], k[37], k[38], k[39], k[40], k[41])
    value, k[36], is_valid, k[38], k[39], k[40], k[41] = fuse(
        before, c.hover, -e[58], -k[50], (e[53], e[54], e[55]), dt
    )
    k[35], k[37] = value, is_valid
    if is_valid > 0.0:
        # The z integrator keeps the thrust where it is.
        az = k[47]
        k[18] += (az - GRAVITY_M_S2) * k[19] / value + GRAVITY_M_S2 - az
        k[19] = value
