"""Proves limits of any piecewise polynomial trajectory.

Each piece is cut into equal parts and written in Bernstein form, whose coefficients are control points: the part lies in
their hull, and so do its derivatives in theirs. The bounds are therefore upper bounds over all times, the tighter the more
parts. Planners that have no control points of their own at hand (min snap, Bezier timing) use it, and tests judge all by it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from companion.geometry import ZERO, add, scale
from companion.messages import Vec3
from companion.planning.limits import TOLERANCE, ProvenBounds, bounds_of_control_points, excess
from companion.planning.obstacle import Obstacle, centre_at, hull_is_clear
from companion.planning.request import DescentCone, PlanRequest
from companion.planning.trajectory import Trajectory
from companion.planning.view import pad_in_view

Array = npt.NDArray[np.float64]
PARTS = 4
"""Parts a piece is cut into; four take the bounds of a quintic to within a few percent of the true maxima."""


@dataclass(frozen=True, slots=True)
class Proof:
    """What a trajectory surely keeps. `slowdown` is how many times slower the limits want it; 1 or less holds."""

    bounds: ProvenBounds
    slowdown: float
    reason: str

    @property
    def holds(self) -> bool:
        return self.slowdown <= 1.0 + TOLERANCE


def prove(trajectory: Trajectory, request: PlanRequest, parts: int = PARTS) -> Proof:
    """Bounds of the sum with the pad's motion, and whether limits, floor, cone, view and no-fly volumes hold."""
    starts, width, points = bernstein_parts(trajectory, parts)
    velocity = _derivative(points, width)
    acceleration = _derivative(velocity, width)
    jerk = _derivative(acceleration, width)
    bounds = bounds_of_control_points(
        _axes(velocity), _axes(acceleration), _axes(jerk), pad_velocities(request), request.pad_acceleration_m_s2
    )
    slowdown, reason = excess(bounds, request.limits)
    blocked = _blocked(request, starts, width, points, acceleration)
    if blocked:
        return Proof(bounds, max(slowdown, 1.0) + 0.08, blocked)
    return Proof(bounds, slowdown, reason)


def misses_volumes(trajectory: Trajectory, request: PlanRequest, parts: int = PARTS) -> bool:
    """Whether it surely misses every no-fly volume of the request; nothing else is asked."""
    starts, width, points = bernstein_parts(trajectory, parts)
    return all(_clear_of(request, obstacle, starts, width, points) for obstacle in request.obstacles)


def pad_velocities(request: PlanRequest) -> tuple[Vec3, ...]:
    """The two ends of the range in which the pad's velocity is taken to stay."""
    now = request.pad_velocity_m_s
    if request.pad_acceleration_m_s2 == ZERO:
        return (now,)
    return now, add(now, scale(request.pad_acceleration_m_s2, request.pad_preview_s))


def bernstein_parts(trajectory: Trajectory, parts: int) -> tuple[Array, Array, Array]:
    """Start times (n,), widths (n,) and control points (n, degree + 1, 3) of all parts of all pieces."""
    lengths = np.diff(trajectory.breaks_s)
    low = np.array(trajectory.pieces)[:, :, ::-1].transpose(0, 2, 1)
    width = np.repeat(lengths / parts, parts)
    offset = np.tile(np.arange(parts), len(lengths)) * width
    starts = np.repeat(trajectory.breaks_s[:-1], parts) + offset
    shifted = _taylor_shift(np.repeat(low, parts, axis=0), offset, width)
    return starts, width, np.einsum("ij,njk->nik", monomial_to_bernstein(low.shape[1] - 1), shifted)


def jerk_cost(trajectory: Trajectory) -> float:
    """Integral of squared jerk over the trajectory, m2/s5 (Gauss-Legendre, exact for the degrees in use)."""
    low = np.array(trajectory.pieces)[:, :, ::-1]
    jerk = np.polynomial.polynomial.polyder(low, 3, axis=2) if low.shape[2] > 3 else np.zeros((*low.shape[:2], 1))
    nodes, weights = np.polynomial.legendre.leggauss(jerk.shape[2])
    lengths = np.diff(trajectory.breaks_s)
    times = np.outer(lengths, 0.5 * (nodes + 1.0))
    powers = times[:, :, None] ** np.arange(jerk.shape[2])
    values = np.einsum("ntp,nap->nta", powers, jerk)
    return float((0.5 * lengths[:, None] * weights * (values**2).sum(axis=2)).sum())


def _taylor_shift(low: Array, offset: Array, width: Array) -> Array:
    """Coefficients (lowest first) of p(offset + width s) for s in [0, 1]; low is (n, degree + 1, 3)."""
    degree = low.shape[1] - 1
    result = np.zeros_like(low)
    for k in range(degree + 1):
        for m in range(k, degree + 1):
            result[:, k] += math.comb(m, k) * (offset ** (m - k) * width**k)[:, None] * low[:, m]
    return result


def monomial_to_bernstein(degree: int) -> Array:
    """Coefficients (lowest power first) on [0, 1] to Bernstein control points."""
    matrix = np.zeros((degree + 1, degree + 1))
    for i in range(degree + 1):
        for j in range(i + 1):
            matrix[i, j] = math.comb(i, j) / math.comb(degree, j)
    return matrix


def _derivative(points: Array, width: Array) -> Array:
    """Control points of the derivative of Bernstein parts; a constant's derivative is one zero."""
    degree = points.shape[1] - 1
    if degree == 0:
        return np.zeros_like(points)
    result: Array = degree * np.diff(points, axis=1) / width[:, None, None]
    return result


def _axes(points: Array) -> tuple[list[float], list[float], list[float]]:
    x, y, z = points.reshape(-1, 3).T.tolist()
    return x, y, z


def _blocked(request: PlanRequest, starts: Array, width: Array, points: Array, acceleration: Array) -> str:
    floor = request.limits.floor_m
    lowest = float(points[:, :, 2].max())
    if floor is not None and lowest > -floor + TOLERANCE:
        return f"goes {lowest + floor:.2f} m below the floor"
    if request.cone is not None and not all(in_cone(request.cone, part) for part in points.tolist()):
        return "leaves the descent cone"
    for obstacle in request.obstacles:
        if not _clear_of(request, obstacle, starts, width, points):
            return f"meets the no-fly volume of {obstacle.radius_m:.1f} m radius"
    if request.field_of_view is not None:
        for part, pushes in zip(points.tolist(), acceleration.tolist(), strict=True):
            if not pad_in_view(request.field_of_view, part, pushes, request.pad_acceleration_m_s2):
                return "loses the pad from view"
    return ""


def in_cone(cone: DescentCone, hull_m: list[Vec3]) -> bool:
    """The hull is above the cone's top, or inside the cone: both are convex, so its control points decide."""
    if all(-z >= cone.top_m - TOLERANCE for _, _, z in hull_m):
        return True
    return all(math.hypot(x, y) <= cone.radius_m - cone.slope * z + TOLERANCE for x, y, z in hull_m)


def _clear_of(request: PlanRequest, obstacle: Obstacle, starts: Array, width: Array, points: Array) -> bool:
    degree = points.shape[1] - 1
    for start, length, part in zip(starts.tolist(), width.tolist(), points.tolist(), strict=True):
        offsets: list[Vec3] = []
        for i, (x, y, z) in enumerate(part):
            cx, cy, cz = centre_at(obstacle, request.pad_velocity_m_s, start + length * i / max(degree, 1))
            offsets.append((x - cx, y - cy, z - cz))
        if not hull_is_clear(obstacle, offsets, [point[2] for point in part]):
            return False
    return True
