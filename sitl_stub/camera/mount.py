"""How a camera is mounted, and poses as the renderer uses them.

R_BC takes vectors from the camera's optical frame C (right, down, forward) to the body B (forward, right, down).
At mount_deg (0, 0, 0) the camera looks straight down with the top of its image towards the nose: axis C x points along
B y, C y along -B x, C z along B z. For mount_deg = (roll, pitch, yaw)

    R_BC = Rz(yaw) Ry(pitch) Rx(roll) R_BC_down

so a positive pitch tilts the optical axis from down towards the nose: (0, 90, 0) looks forward with the image upright,
(0, 45, 0) half way. Yaw turns the camera about body down, clockwise seen from above; roll tips the axis to the left.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sitl_stub.camera.image import Floats, Quaternion, Vec3

R_BC_DOWN: Floats = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def mount_rotation(mount_deg: Vec3) -> Floats:
    """R_BC (3 x 3) of a camera mounted at (roll, pitch, yaw) in degrees."""
    roll, pitch, yaw = (math.radians(angle) for angle in mount_deg)
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    rx = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    ry = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
    rz = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
    R_BC: Floats = rz @ ry @ rx @ R_BC_DOWN
    return R_BC


def rotation_matrix(q: Quaternion) -> Floats:
    """R_AB (3 x 3) from q_AB, Hamilton w x y z, unit."""
    w, x, y, z = q
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """X_AB as matrices: R_AB (3 x 3) and p_AB (3)."""

    R: Floats
    p: Floats

    def __matmul__(self, other: Pose) -> Pose:
        """X_AC = X_AB @ X_BC."""
        return Pose(self.R @ other.R, self.p + self.R @ other.p)

    def inverse(self) -> Pose:
        return Pose(self.R.T, -(self.R.T @ self.p))


def pose(position: Vec3, q: Quaternion) -> Pose:
    """X_AB from p_AB and q_AB."""
    return Pose(rotation_matrix(q), np.array(position))
