"""The simulator's own quaternion maths in plain floats: Hamilton, w x y z, q_WB takes a vector of B to W.

Angles are radians, aerospace order (yaw, then pitch, then roll). Pure functions on tuples of floats, so that numba can
compile them. Used by dynamics, control cascade and estimate error; the application has its own maths, on purpose.
"""

from __future__ import annotations

from math import asin, atan2, copysign, cos, pi, sin, sqrt

from sitl_stub.compiled import used_by_kernels

Vec3 = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

IDENTITY: Quaternion = (1.0, 0.0, 0.0, 0.0)


@used_by_kernels
def multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """a then, in the frame that a made, b."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def inverse(q: Quaternion) -> Quaternion:
    """Inverse of a unit quaternion."""
    return (q[0], -q[1], -q[2], -q[3])


@used_by_kernels
def normalise(q: Quaternion) -> Quaternion:
    """Unit length, w >= 0. A zero quaternion raises ZeroDivisionError."""
    w, x, y, z = q
    scale = copysign(1.0 / sqrt(w * w + x * x + y * y + z * z), w)
    return (w * scale, x * scale, y * scale, z * scale)


def rotate(q: Quaternion, v: Vec3) -> Vec3:
    """R(q) v."""
    w, x, y, z = q
    vx, vy, vz = v
    tx, ty, tz = 2.0 * (y * vz - z * vy), 2.0 * (z * vx - x * vz), 2.0 * (x * vy - y * vx)
    return (vx + w * tx + y * tz - z * ty, vy + w * ty + z * tx - x * tz, vz + w * tz + x * ty - y * tx)


def rotate_back(q: Quaternion, v: Vec3) -> Vec3:
    """R(q) transposed times v."""
    return rotate((q[0], -q[1], -q[2], -q[3]), v)


def z_axis(q: Quaternion) -> Vec3:
    """Third column of R(q): B z (down) in W."""
    w, x, y, z = q
    return (2.0 * (x * z + w * y), 2.0 * (y * z - w * x), w * w - x * x - y * y + z * z)


@used_by_kernels
def from_rotation_vector(x_rad: float, y_rad: float, z_rad: float) -> Quaternion:
    """Turn by the vector's length about its direction."""
    angle = sqrt(x_rad * x_rad + y_rad * y_rad + z_rad * z_rad)
    if angle < 1e-9:
        return (1.0, 0.5 * x_rad, 0.5 * y_rad, 0.5 * z_rad)
    half = 0.5 * angle
    scale = sin(half) / angle
    return (cos(half), x_rad * scale, y_rad * scale, z_rad * scale)


def from_euler(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Quaternion:
    """Yaw about down, then pitch, then roll."""
    cr, sr = cos(0.5 * roll_rad), sin(0.5 * roll_rad)
    cp, sp = cos(0.5 * pitch_rad), sin(0.5 * pitch_rad)
    cy, sy = cos(0.5 * yaw_rad), sin(0.5 * yaw_rad)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


@used_by_kernels
def roll_pitch_yaw(q: Quaternion) -> Vec3:
    """(roll, pitch, yaw), pitch clipped at +-pi/2."""
    w, x, y, z = q
    sine = 2.0 * (w * y - z * x)
    sine = sine if sine < 1.0 else 1.0
    sine = sine if sine > -1.0 else -1.0
    return (atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)), asin(sine), yaw_of(q))


@used_by_kernels
def yaw_of(q: Quaternion) -> float:
    """Heading, 0 north, clockwise from above."""
    w, x, y, z = q
    return atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def wrap(angle_rad: float) -> float:
    """The same angle in (-pi, pi]."""
    wrapped = (angle_rad + pi) % (2.0 * pi) - pi
    return wrapped if wrapped != -pi else pi
