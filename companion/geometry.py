"""Frames, rotations and angles, in plain floats.

Monogram notation: `R_WB` takes vectors from B to W, `p_BP_W` is the position of P seen from B, written in W,
`X_WP = X_WB @ X_BC @ X_CP`. Quaternions are Hamilton, w x y z, w >= 0. Yaw is 0 at north, clockwise from above,
in (-pi, pi]. This is the only module that may know another library's quaternion order.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from companion.messages import Mat3, Quaternion, Vec3

IDENTITY_QUATERNION: Quaternion = (1.0, 0.0, 0.0, 0.0)
ZERO: Vec3 = (0.0, 0.0, 0.0)


def add(a: Vec3, b: Vec3) -> Vec3:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def subtract(a: Vec3, b: Vec3) -> Vec3:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def scale(a: Vec3, factor: float) -> Vec3:
    return (a[0] * factor, a[1] * factor, a[2] * factor)


def dot(a: Vec3, b: Vec3) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vec3, b: Vec3) -> Vec3:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def norm(a: Vec3) -> float:
    return math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


def horizontal_norm(a: Vec3) -> float:
    """Length of the north and east components."""
    return math.hypot(a[0], a[1])


def wrap_pi(angle_rad: float) -> float:
    """The same angle in (-pi, pi]."""
    wrapped = math.fmod(angle_rad + math.pi, 2.0 * math.pi)
    return wrapped + math.pi if wrapped <= 0.0 else wrapped - math.pi


def quaternion_normalized(q: Quaternion) -> Quaternion:
    """Unit length and w >= 0. A zero quaternion has no direction: ValueError."""
    length = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    if length == 0.0:
        raise ValueError("a quaternion of length zero is not a rotation")
    factor = (1.0 if q[0] >= 0.0 else -1.0) / length
    return (q[0] * factor, q[1] * factor, q[2] * factor, q[3] * factor)


def quaternion_multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """Hamilton product: `q_AC = quaternion_multiply(q_AB, q_BC)`."""
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )


def quaternion_conjugate(q: Quaternion) -> Quaternion:
    """The inverse rotation."""
    return (q[0], -q[1], -q[2], -q[3])


def rotate(q_AB: Quaternion, v_B: Vec3) -> Vec3:
    """v_A = R_AB v_B."""
    w, x, y, z = q_AB
    tx = 2.0 * (y * v_B[2] - z * v_B[1])
    ty = 2.0 * (z * v_B[0] - x * v_B[2])
    tz = 2.0 * (x * v_B[1] - y * v_B[0])
    return (
        v_B[0] + w * tx + y * tz - z * ty,
        v_B[1] + w * ty + z * tx - x * tz,
        v_B[2] + w * tz + x * ty - y * tx,
    )


def matrix_from_quaternion(q: Quaternion) -> Mat3:
    """R with the same meaning as the quaternion: R_AB from q_AB."""
    w, x, y, z = q
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


def quaternion_from_matrix(R: Mat3) -> Quaternion:
    """Inverse of `matrix_from_quaternion` for an orthonormal R (Shepperd's branch on the largest component)."""
    trace = R[0][0] + R[1][1] + R[2][2]
    if trace > max(R[0][0], R[1][1], R[2][2]):
        s = 2.0 * math.sqrt(1.0 + trace)
        q = (s / 4.0, (R[2][1] - R[1][2]) / s, (R[0][2] - R[2][0]) / s, (R[1][0] - R[0][1]) / s)
    elif R[0][0] >= R[1][1] and R[0][0] >= R[2][2]:
        s = 2.0 * math.sqrt(1.0 + R[0][0] - R[1][1] - R[2][2])
        q = ((R[2][1] - R[1][2]) / s, s / 4.0, (R[0][1] + R[1][0]) / s, (R[0][2] + R[2][0]) / s)
    elif R[1][1] >= R[2][2]:
        s = 2.0 * math.sqrt(1.0 + R[1][1] - R[0][0] - R[2][2])
        q = ((R[0][2] - R[2][0]) / s, (R[0][1] + R[1][0]) / s, s / 4.0, (R[1][2] + R[2][1]) / s)
    else:
        s = 2.0 * math.sqrt(1.0 + R[2][2] - R[0][0] - R[1][1])
        q = ((R[1][0] - R[0][1]) / s, (R[0][2] + R[2][0]) / s, (R[1][2] + R[2][1]) / s, s / 4.0)
    return quaternion_normalized(q)


def quaternion_from_euler(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Quaternion:
    """q_WB of a body that was yawed, then pitched, then rolled (PX4's and MAVLink's convention)."""
    cr, sr = math.cos(roll_rad / 2.0), math.sin(roll_rad / 2.0)
    cp, sp = math.cos(pitch_rad / 2.0), math.sin(pitch_rad / 2.0)
    cy, sy = math.cos(yaw_rad / 2.0), math.sin(yaw_rad / 2.0)
    return quaternion_normalized(
        (
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        )
    )


def euler_from_quaternion(q: Quaternion) -> Vec3:
    """(roll, pitch, yaw) in rad of q_WB. Pitch is clamped to +-pi/2 against rounding."""
    w, x, y, z = q
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x))))
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return (roll, pitch, yaw)


def yaw_of(q_WB: Quaternion) -> float:
    """Yaw of the body x axis, rad."""
    return euler_from_quaternion(q_WB)[2]


def slerp(a: Quaternion, b: Quaternion, fraction: float) -> Quaternion:
    """The rotation at `fraction` of the way from a to b along the shorter arc."""
    cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
    if cosine < 0.0:
        b, cosine = (-b[0], -b[1], -b[2], -b[3]), -cosine
    if cosine > 0.9995:  # nearly parallel: the chord is the arc to 1e-8
        ka, kb = 1.0 - fraction, fraction
    else:
        angle = math.acos(cosine)
        ka = math.sin((1.0 - fraction) * angle) / math.sin(angle)
        kb = math.sin(fraction * angle) / math.sin(angle)
    return quaternion_normalized(
        (ka * a[0] + kb * b[0], ka * a[1] + kb * b[1], ka * a[2] + kb * b[2], ka * a[3] + kb * b[3])
    )


def rotated_covariance(R: Mat3, covariance: Mat3) -> Mat3:
    """R C R^T."""
    columns = tuple(zip(*covariance, strict=True))
    half = [(dot(row, columns[0]), dot(row, columns[1]), dot(row, columns[2])) for row in R]
    a, b, c = ((dot(row, R[0]), dot(row, R[1]), dot(row, R[2])) for row in half)
    return (a, b, c)


@dataclass(frozen=True, slots=True)
class Transform:
    """X_AB: pose of frame B in frame A. `X_AC = X_AB @ X_BC`; `X_AB.point(p_B)` is the same point written in A."""

    q: Quaternion = IDENTITY_QUATERNION
    p: Vec3 = ZERO

    def __matmul__(self, other: Transform) -> Transform:
        return Transform(
            q=quaternion_normalized(quaternion_multiply(self.q, other.q)), p=add(self.p, rotate(self.q, other.p))
        )

    def inverse(self) -> Transform:
        q = quaternion_conjugate(self.q)
        return Transform(q=q, p=scale(rotate(q, self.p), -1.0))

    def point(self, p_B: Vec3) -> Vec3:
        return add(self.p, rotate(self.q, p_B))


Q_FRD_CAMERA_DOWN: Quaternion = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
"""q_BC of a camera that looks straight down with the top of its image towards the nose:
image right is body right, image down is body back, optical axis is body down (C x = B y, C y = -B x, C z = B z)."""
