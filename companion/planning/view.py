"""Is the pad in the view of a camera that looks along body down?

A multirotor tilts to accelerate: its thrust points along the specific force, so body down is along `g - a`. For a fixed
position the accelerations that keep the pad within the view form a convex cone, and for a fixed acceleration so do the
positions; hence the pad is in view for every pair out of two hulls when it is for every pair of their control points.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from companion.geometry import ZERO
from companion.messages import Vec3
from companion.planning.limits import GRAVITY_M_S2


@dataclass(frozen=True, slots=True)
class FieldOfView:
    """The pad stays within `half_angle_rad` (below a right angle) of body down while higher than `min_height_m`."""

    half_angle_rad: float
    min_height_m: float = 1.0


def pad_in_view(
    view: FieldOfView, positions_m: Sequence[Vec3], accelerations_m_s2: Iterable[Vec3], pad_acceleration_m_s2: Vec3
) -> bool:
    """True where the pad is surely in view for all positions and accelerations in the hulls of the given points.

    Positions and accelerations are relative to the pad, NED; the pad's own acceleration is anywhere from zero to the one
    given. Where all positions are lower than the view's least height nothing is asked.
    """
    if all(-z < view.min_height_m for _, _, z in positions_m):
        return True
    cosine = math.cos(view.half_angle_rad)
    for ax, ay, az in accelerations_m_s2:
        for qx, qy, qz in {ZERO, pad_acceleration_m_s2}:
            wx, wy, wz = -ax - qx, -ay - qy, GRAVITY_M_S2 - az - qz
            reach = cosine * math.sqrt(wx * wx + wy * wy + wz * wz)
            for x, y, z in positions_m:
                if -(x * wx + y * wy + z * wz) < reach * math.sqrt(x * x + y * y + z * z):
                    return False
    return True
