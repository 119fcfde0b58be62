"""PX4's control allocation of a quad X with sequential desaturation and air mode off.

Motor = thrust +- roll/sqrt2 +- pitch/sqrt2 +- yaw (PX4's normalised columns). When a motor would leave 0..1, thrust is
lowered first, then roll and pitch are cut, then yaw is added as far as it fits (15 % over the top for yaw's sake, taken back by
lowering thrust). Motor order 1 front right, 2 rear left, 3 front left, 4 rear right. Pure functions; called at 250 Hz.
"""

from __future__ import annotations

from math import sqrt

from sitl_stub.compiled import used_by_kernels
from sitl_stub.rotation import Vec3

Motors = tuple[float, float, float, float]

_HALF = sqrt(0.5)
_ROLL: Motors = (-_HALF, _HALF, _HALF, -_HALF)
_PITCH: Motors = (_HALF, -_HALF, _HALF, -_HALF)
_YAW: Motors = (1.0, 1.0, -1.0, -1.0)
_LESS_THRUST: Motors = (-1.0, -1.0, -1.0, -1.0)
_YAW_MARGIN = 0.15
_EPSILON = 1e-6


@used_by_kernels
def _relief(column: Motors, motors: Motors, top: float) -> float:
    """How much of the column brings the motors nearest to 0..top."""
    least = most = 0.0
    for i in range(4):
        weight, motor = column[i], motors[i]
        if motor < 0.0:
            k = -motor / weight
        elif motor > top:
            k = (top - motor) / weight
        else:
            continue
        least, most = min(least, k), max(most, k)
    return least + most


@used_by_kernels
def _add(motors: Motors, column: Motors, gain: float) -> Motors:
    a, b, c, d = motors
    e, f, g, h = column
    return a + gain * e, b + gain * f, c + gain * g, d + gain * h


@used_by_kernels
def _desaturate(motors: Motors, column: Motors, top: float = 1.0, only_positive: bool = False) -> Motors:
    gain = _relief(column, motors, top)
    if only_positive and gain < 0.0:
        return motors
    motors = _add(motors, column, gain)
    gain = 0.5 * _relief(column, motors, top)
    return _add(motors, column, gain)


@used_by_kernels
def mix(thrust: float, torque: Vec3) -> tuple[Motors, Vec3]:
    """Motor commands 0..1 and, per axis, the sign of the torque that could not be given (0 when all was)."""
    roll, pitch, yaw = _HALF * torque[0], _HALF * torque[1], torque[2]
    m0, m1 = thrust - roll + pitch, thrust + roll - pitch
    m2, m3 = thrust + roll + pitch, thrust - roll - pitch
    least = abs(yaw)
    top = 1.0 - least
    if (
        m0 >= least
        and m1 >= least
        and m2 >= least
        and m3 >= least
        and m0 <= top
        and m1 <= top
        and m2 <= top
        and m3 <= top
    ):
        return (m0 + yaw, m1 + yaw, m2 - yaw, m3 - yaw), (0.0, 0.0, 0.0)
    return _mix_saturated((m0, m1, m2, m3), torque)


@used_by_kernels
def _mix_saturated(motors: Motors, torque: Vec3) -> tuple[Motors, Vec3]:
    motors = _desaturate(motors, _LESS_THRUST, only_positive=True)
    motors = _desaturate(motors, _ROLL)
    motors = _desaturate(motors, _PITCH)
    motors = _add(motors, _YAW, torque[2])
    motors = _desaturate(motors, _YAW, top=1.0 + _YAW_MARGIN)
    motors = _desaturate(motors, _LESS_THRUST, only_positive=True)
    a, b, c, d = _clip(motors[0]), _clip(motors[1]), _clip(motors[2]), _clip(motors[3])
    missing = (
        _sign(torque[0] - 0.5 * _HALF * (b + c - a - d)),
        _sign(torque[1] - 0.5 * _HALF * (a + c - b - d)),
        _sign(torque[2] - 0.25 * (a + b - c - d)),
    )
    return (a, b, c, d), missing


@used_by_kernels
def _clip(motor: float) -> float:
    return min(max(motor, 0.0), 1.0)


@used_by_kernels
def _sign(missing: float) -> float:
    return 0.0 if abs(missing) < _EPSILON else 1.0 if missing > 0.0 else -1.0
