"""Position and velocity loops of PX4's mc_pos_control: from a trajectory setpoint to a thrust vector in W.

Position P with velocity feed-forward; velocity PID whose D acts on the filtered derivative of the measured velocity; the
sum is an acceleration, which becomes a direction (tilt limited, z decoupled from xy by MPC_ACC_DECOUPLE) and a thrust
scaled by the hover thrust. Under saturation height wins, but a margin of thrust stays for xy (MPC_THR_XY_MARG); the xy
integrator unwinds by tracking anti-windup with gain 2/P, the z integrator stops. NaN = not controlled. NED, thrust
normalised 0..1. Pure functions on flat tuples (numba compiles them); called by cascade.py at 125 Hz.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import acos, cos, inf, isfinite, nan, radians, sin, sqrt
from typing import NamedTuple

from sitl_stub.compiled import used_by_kernels
from sitl_stub.rotation import Quaternion, Vec3

GRAVITY_M_S2 = 9.80665
_LEAST_THRUST = 1e-3


class PositionGains(NamedTuple):
    """Constants from PX4 parameters."""

    position_xy: float
    position_z: float
    p_xy: float
    i_xy: float
    d_xy: float
    p_z: float
    i_z: float
    d_z: float
    horizontal_margin: float
    decoupled: bool


class PositionLimits(NamedTuple):
    """What may be asked for now; the take-off ramp makes `climb` negative at first."""

    speed_xy: float
    climb: float
    descent: float
    tilt: float
    thrust_min: float
    thrust_max: float


Numbers = tuple[float, ...]
"""Of one of the tuples above or below, without their names: a plain tuple is made and taken apart in a quarter of the time."""


class Motion(NamedTuple):
    """Estimated state, or a setpoint's first nine fields: position, velocity, acceleration."""

    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float
    ax: float
    ay: float
    az: float


UNSET_MOTION = Motion(nan, nan, nan, nan, nan, nan, nan, nan, nan)


class PositionDemand(NamedTuple):
    """Result: velocity and acceleration asked for, normalised thrust vector in W, integrator afterwards."""

    vx: float
    vy: float
    vz: float
    ax: float
    ay: float
    az: float
    tx: float
    ty: float
    tz: float
    ix: float
    iy: float
    iz: float


def position_gains(parameters: Mapping[str, float | int]) -> PositionGains:
    """Gains by their PX4 names."""
    p = parameters
    return PositionGains(
        p["MPC_XY_P"],
        p["MPC_Z_P"],
        p["MPC_XY_VEL_P_ACC"],
        p["MPC_XY_VEL_I_ACC"],
        p["MPC_XY_VEL_D_ACC"],
        p["MPC_Z_VEL_P_ACC"],
        p["MPC_Z_VEL_I_ACC"],
        p["MPC_Z_VEL_D_ACC"],
        p["MPC_THR_XY_MARG"],
        bool(p["MPC_ACC_DECOUPLE"]),
    )


def is_flyable(setpoint: Motion, state: Motion) -> bool:
    """PX4's check: every axis controlled somehow, x and y in pairs, and an estimate for what is controlled."""
    x, y, z = isfinite(setpoint.x), isfinite(setpoint.y), isfinite(setpoint.z)
    vx, vy, vz = isfinite(setpoint.vx), isfinite(setpoint.vy), isfinite(setpoint.vz)
    ax, ay, az = isfinite(setpoint.ax), isfinite(setpoint.ay), isfinite(setpoint.az)
    if x != y or vx != vy or ax != ay or not ((x or vx or ax) and (z or vz or az)):
        return False
    has_place = (not x or isfinite(state.x + state.y)) and (not z or isfinite(state.z))
    has_speed = (not vx or isfinite(state.vx + state.vy)) and (not vz or isfinite(state.vz))
    return has_place and has_speed


@used_by_kernels
def constrain_xy(x0: float, y0: float, x1: float, y1: float, limit: float) -> tuple[float, float]:
    """Sum of two vectors with a limited length; the first one has priority, the second is shortened."""
    x, y = x0 + x1, y0 + y1
    if sqrt(x * x + y * y) <= limit:
        return x, y
    first = sqrt(x0 * x0 + y0 * y0)
    if first >= limit:
        return x0 / first * limit, y0 / first * limit
    second = sqrt(x1 * x1 + y1 * y1)
    if first < 1e-3 or abs(x1 - x0) + abs(y1 - y0) < 1e-3:
        return x1 / second * limit, y1 / second * limit
    ux, uy = x1 / second, y1 / second
    along = ux * x0 + uy * y0
    reach = -along + sqrt(along * along - first * first + limit * limit)
    return x0 + ux * reach, y0 + uy * reach


@used_by_kernels
def _velocity_demand(
    px: float, py: float, pz: float, vx: float, vy: float, vz: float, speed_xy: float, climb: float, descent: float
) -> Vec3:
    """The part from position (P) plus feed-forward (V), limited; the part from position has priority in xy."""
    if px != px:
        if vx == vx:
            vx, vy = constrain_xy(0.0, 0.0, vx, vy, speed_xy)
    elif vx != vx:
        vx, vy = constrain_xy(px, py, 0.0, 0.0, speed_xy)
    else:
        vx, vy = constrain_xy(px, py, vx, vy, speed_xy)
    if pz == pz:
        vz = pz if vz != vz else pz + vz
    if vz == vz:
        vz = -climb if vz < -climb else vz
        vz = descent if descent < vz else vz
    return vx, vy, vz


@used_by_kernels
def _thrust_direction(ax: float, ay: float, az: float, decoupled: bool, tilt_max: float) -> Vec3:
    """Unit vector of B z asked for: against the acceleration, tilted no more than the limit."""
    bx, by, bz = -ax, -ay, GRAVITY_M_S2 if decoupled else GRAVITY_M_S2 - az
    length = sqrt(bx * bx + by * by + bz * bz)
    if length < 1e-6:
        return 0.0, 0.0, 1.0
    bx, by, bz = bx / length, by / length, bz / length
    if bz < cos(tilt_max):
        tilt = min(acos(min(max(bz, -1.0), 1.0)), tilt_max)
        flat = sqrt(bx * bx + by * by)
        if flat < 1e-9:
            bx, by, flat = 1.0, 0.0, 1.0
        scale = sin(tilt) / flat
        return bx * scale, by * scale, cos(tilt)
    return bx, by, bz


@used_by_kernels
def control_position(
    sp: Motion,
    at: Motion,
    integral: Vec3,
    hover_thrust: float,
    gains: PositionGains,
    limits: PositionLimits,
    dt: float,
) -> PositionDemand:
    """One step of both loops. `at.ax..az` is the filtered derivative of the estimated velocity."""
    return PositionDemand(*demand_numbers(sp, at, integral, hover_thrust, gains, limits, dt))


@used_by_kernels
def demand_numbers(
    sp: Numbers,
    at: Numbers,
    integral: Vec3,
    hover_thrust: float,
    gains: PositionGains,
    limits: Numbers,
    dt: float,
) -> tuple[float, float, float, float, float, float, float, float, float, float, float, float]:
    """The numbers of the PositionDemand, from those of two Motions and of the PositionLimits."""
    sx, sy, sz, svx, svy, svz, sax, say, saz = sp
    x, y, z, x_dot, y_dot, z_dot, x_ddot, y_ddot, z_ddot = at
    position_xy, position_z, p_xy, i_xy, d_xy, p_z, i_z, d_z, horizontal_margin, decoupled = gains
    speed_xy, climb, descent, tilt, thrust_min, thrust_max = limits
    vx, vy, vz = _velocity_demand(
        position_xy * (sx - x), position_xy * (sy - y), position_z * (sz - z), svx, svy, svz, speed_xy, climb, descent
    )
    ex, ey, ez = vx - x_dot, vy - y_dot, vz - z_dot
    ix, iy, iz = integral

    # A velocity that is not controlled leaves the acceleration feed-forward alone, and the other way round.
    ax = p_xy * ex + ix - d_xy * x_ddot
    ay = p_xy * ey + iy - d_xy * y_ddot
    az = p_z * ez + iz - d_z * z_ddot
    ax = sax if ax != ax else ax if sax != sax else ax + sax
    ay = say if ay != ay else ay if say != say else ay + say
    az = saz if az != az else az if saz != saz else az + saz

    bx, by, bz = _thrust_direction(ax, ay, az, decoupled, tilt)
    least = thrust_min if thrust_min > _LEAST_THRUST else _LEAST_THRUST
    # A down-looking B z that is level (bz = 0) would need infinite thrust; saturation below cuts it.
    collective = (hover_thrust - az * hover_thrust / GRAVITY_M_S2) / bz if bz > 0.0 else inf
    collective = least if collective < least else 1e3 if collective > 1e3 else collective
    tx, ty, tz = -bx * collective, -by * collective, -bz * collective

    if (tz >= -least and ez >= 0.0) or (tz <= -thrust_max and ez <= 0.0):
        ez = 0.0

    # Height first, with a margin for xy; then what is left for xy.
    flat = sqrt(tx * tx + ty * ty)
    square = thrust_max * thrust_max
    reserved = horizontal_margin if horizontal_margin < flat else flat
    left = square - reserved * reserved
    tz_min = -sqrt(0.0 if left < 0.0 else left)
    tz = tz_min if tz < tz_min else tz
    left = square - tz * tz
    flat_max = sqrt(0.0 if left < 0.0 else left)
    if flat > flat_max:
        tx, ty = tx / flat * flat_max, ty / flat * flat_max

    # Tracking anti-windup: feed back what saturation took away, never what it added.
    scale = GRAVITY_M_S2 / hover_thrust
    px, py = tx * scale, ty * scale
    if ax * ax + ay * ay > px * px + py * py:
        gain = 2.0 / p_xy
        ex, ey = ex - gain * (ax - px), ey - gain * (ay - py)
    ix += i_xy * ex * dt if ex == ex else 0.0
    iy += i_xy * ey * dt if ey == ey else 0.0
    iz += i_z * ez * dt if ez == ez else 0.0
    iz = -GRAVITY_M_S2 if iz < -GRAVITY_M_S2 else GRAVITY_M_S2 if iz > GRAVITY_M_S2 else iz
    return vx, vy, vz, ax, ay, az, tx, ty, tz, ix, iy, iz


@used_by_kernels
def attitude_from_thrust(tx: float, ty: float, tz: float, yaw_rad: float) -> tuple[Quaternion, float]:
    """Attitude whose -B z points along the thrust vector, nose at the yaw; and the thrust's length."""
    length = sqrt(tx * tx + ty * ty + tz * tz)
    bx, by, bz = (-tx / length, -ty / length, -tz / length) if length > 1e-6 else (0.0, 0.0, 1.0)
    # B x is perpendicular to B z and to the heading's right-hand direction.
    cx, cy = -sin(yaw_rad), cos(yaw_rad)
    x0, x1, x2 = cy * bz, -cx * bz, cx * by - cy * bx
    norm = sqrt(x0 * x0 + x1 * x1 + x2 * x2)
    x0, x1, x2 = (x0 / norm, x1 / norm, x2 / norm) if abs(bz) > 1e-6 else (0.0, 0.0, 1.0)
    if bz < 0.0:
        x0, x1, x2 = -x0, -x1, -x2
    y0, y1, y2 = by * x2 - bz * x1, bz * x0 - bx * x2, bx * x1 - by * x0
    return _quaternion(x0, y0, bx, x1, y1, by, x2, y2, bz), length


@used_by_kernels
def _quaternion(
    r00: float, r01: float, r02: float, r10: float, r11: float, r12: float, r20: float, r21: float, r22: float
) -> Quaternion:
    """Unit quaternion of a rotation matrix, from its largest component for accuracy."""
    trace = r00 + r11 + r22
    if trace > 0.0:
        s = sqrt(trace + 1.0)
        t = 0.5 / s
        return 0.5 * s, (r21 - r12) * t, (r02 - r20) * t, (r10 - r01) * t
    if r00 >= r11 and r00 >= r22:
        s = sqrt(1.0 + r00 - r11 - r22)
        t = 0.5 / s
        return (r21 - r12) * t, 0.5 * s, (r01 + r10) * t, (r02 + r20) * t
    if r11 >= r22:
        s = sqrt(1.0 + r11 - r00 - r22)
        t = 0.5 / s
        return (r02 - r20) * t, (r01 + r10) * t, 0.5 * s, (r12 + r21) * t
    s = sqrt(1.0 + r22 - r00 - r11)
    t = 0.5 / s
    return (r10 - r01) * t, (r02 + r20) * t, (r12 + r21) * t, 0.5 * s


def tilt_limit_rad(parameters: Mapping[str, float | int], is_flying: bool) -> float:
    """MPC_TILTMAX_AIR, or MPC_TILTMAX_LND before and during take-off."""
    return radians(parameters["MPC_TILTMAX_AIR" if is_flying else "MPC_TILTMAX_LND"])
