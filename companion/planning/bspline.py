"""The default planner: a clamped B-spline, limits proven on its control points.

Start and end state (position, velocity, acceleration) fix three control points at each end. The free ones between them
follow from least integral of squared jerk: one small matrix, made once. Derivatives of a B-spline are B-splines, so their
control points bound speed, acceleration, jerk and thrust for all times at once. The duration is the shortest for which the
bounds hold. Floor and descent cone push free control points aside; what then does not hold is refused.
Knots are uniform; `h` is their spacing, and the shape's matrices are for h = 1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from companion.config import Planning
from companion.geometry import ZERO
from companion.messages import Vec3
from companion.planning.limits import (
    TOLERANCE,
    Axes,
    ProvenBounds,
    bounds_of_control_points,
    excess,
)
from companion.planning.obstacle import Obstacle, centre_at, hull_is_clear, moved
from companion.planning.proof import in_cone, pad_velocities
from companion.planning.request import DescentCone, NoPlan, Plan, PlanRequest, joined, least_duration_s
from companion.planning.trajectory import Piece, Trajectory
from companion.planning.view import FieldOfView, pad_in_view

Array = npt.NDArray[np.float64]
Points = tuple[list[float], list[float], list[float]]
"""Control points by axis."""

GROWTH_MIN, GROWTH_MAX = 1.04, 1.6
REFINEMENTS = 4
TOP_SPEED_SHARE = 0.3
"""Share of the descent limit at which a plan passes the top of the descent cone."""


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """What depends on degree and number of control points only (unit knot spacing)."""

    degree: int
    count: int
    spans: int
    greville: tuple[float, ...]
    factors: tuple[tuple[float, ...], ...]
    """Row k: factors that take differences of the k-th derivative's control points to those of the next."""
    basis: tuple[tuple[tuple[float, ...], ...], ...]
    """[span][power, highest first][local control point]: control points to polynomial over the unit span."""
    free: tuple[tuple[float, ...], ...]
    """Rows: free control point as weights of the six fixed ones."""
    jerk_gram: tuple[tuple[float, ...], ...]
    """Integral of squared jerk as a quadratic form of the jerk's control points."""


def shape_of(degree: int, count: int) -> Shape:
    """Matrices of the clamped uniform B-spline. ValueError where the two ends would overlap or jerk is not a function."""
    if degree < 3 or count < max(6, degree + 1):
        raise ValueError(f"a B-spline of degree {degree} with {count} control points cannot meet both end states")
    spans = count - degree
    knots = np.concatenate([np.zeros(degree), np.arange(spans + 1.0), np.full(degree, float(spans))])
    factors = [(degree - k) / (knots[degree + 1 : count + degree - k] - knots[k + 1 : count]) for k in range(degree)]
    gram = _jerk_gram(degree - 3, knots[3:-3], count - 3)
    difference = _difference_matrix(factors[:3], count)
    full = difference.T @ gram @ difference
    inner, ends = list(range(3, count - 3)), [0, 1, 2, count - 3, count - 2, count - 1]
    free = -np.linalg.solve(full[np.ix_(inner, inner)], full[np.ix_(inner, ends)]) if inner else np.zeros((0, 6))
    greville = tuple(float(knots[i + 1 : i + degree + 1].mean()) for i in range(count))
    return Shape(
        degree=degree,
        count=count,
        spans=spans,
        greville=greville,
        factors=tuple(tuple(row.tolist()) for row in factors),
        basis=tuple(_span_matrix(degree, knots, span) for span in range(spans)),
        free=tuple(tuple(row) for row in free.tolist()),
        jerk_gram=tuple(tuple(row) for row in gram.tolist()),
    )


def basis_polynomials(degree: int, knots: Array, span: int) -> list[Array]:
    """Cox-de Boor on the span that starts at `knots[span]`: the degree + 1 basis functions that live there, as
    polynomials (lowest power first) of the time since the span's start."""
    start = knots[span]
    row = [np.array([1.0])]
    for k in range(1, degree + 1):
        wider = [np.zeros(k + 1) for _ in range(k + 1)]
        for j, piece in enumerate(row):
            left, right = knots[span - k + 1 + j], knots[span + 1 + j]
            rising = np.polynomial.polynomial.polymul(piece, [start - left, 1.0]) / (right - left)
            falling = np.polynomial.polynomial.polymul(piece, [right - start, -1.0]) / (right - left)
            wider[j + 1] += rising
            wider[j] += falling
        row = wider
    return row


def _span_matrix(degree: int, knots: Array, span: int) -> tuple[tuple[float, ...], ...]:
    columns = np.array(basis_polynomials(degree, knots, degree + span))
    return tuple(tuple(row) for row in columns.T[::-1].tolist())


def _difference_matrix(factors: list[Array], count: int) -> Array:
    """Control points to those of the third derivative."""
    matrix: Array = np.eye(count)
    for row in factors:
        matrix = row[:, None] * np.diff(matrix, axis=0)
    return matrix


def _jerk_gram(degree: int, knots: Array, count: int) -> Array:
    """Integrals of products of the basis functions of the jerk spline."""
    gram = np.zeros((count, count))
    for span in range(count - degree):
        polynomials = basis_polynomials(degree, knots, degree + span)
        for i, a in enumerate(polynomials):
            for j, b in enumerate(polynomials):
                product = np.polynomial.polynomial.polymul(a, b)
                gram[span + i, span + j] += float((product / np.arange(1, len(product) + 1)).sum())
    return gram


@dataclass(frozen=True, slots=True)
class Attempt:
    """One duration tried."""

    duration_s: float
    points: Points
    bounds: ProvenBounds
    jerk_points: Axes
    slowdown: float
    """How many times longer the limits want it; 1 or less holds."""
    reason: str

    @property
    def holds(self) -> bool:
        return self.slowdown <= 1.0 + TOLERANCE


class BSplinePlanner:
    """Shortest clamped B-spline whose limits are proven."""

    def __init__(self, degree: int = 3, control_points: int = 10) -> None:
        self._shape = shape_of(degree, control_points)

    @classmethod
    def from_config(cls, planning: Planning) -> BSplinePlanner:
        return cls(planning.degree, planning.control_points)

    def plan(self, request: PlanRequest) -> Plan | NoPlan:
        """A Plan, or NoPlan with what binds at the duration that came nearest."""
        impossible = start_problem(request)
        if impossible:
            return NoPlan("bspline", request.t_ns, impossible)
        nearest = self._shortest(request)
        if nearest.holds:
            return self._finish(request, nearest)
        if request.cone is not None and -request.position_m[2] >= request.cone.top_m:
            return self._by_the_top(request, request.cone)
        return NoPlan("bspline", request.t_ns, f"{nearest.reason} (at {nearest.duration_s:.1f} s)")

    def _by_the_top(self, request: PlanRequest, cone: DescentCone) -> Plan | NoPlan:
        """Two plans in a row: over the pad above the cone's top, then down inside it."""
        speed = TOP_SPEED_SHARE * max(0.0, request.limits.max_descent_m_s - request.pad_velocity_m_s[2])
        gate, sinking = (0.0, 0.0, -cone.top_m), (0.0, 0.0, speed)
        above = replace(request.limits, floor_m=max(cone.top_m, request.limits.floor_m or 0.0))
        first = self.plan(replace(request, goal_position_m=gate, goal_velocity_m_s=sinking, cone=None, limits=above))
        if isinstance(first, NoPlan):
            return replace(first, reason=f"to the top of the cone: {first.reason}")
        used = first.trajectory.duration_s
        onwards = replace(
            request,
            t_ns=first.trajectory.end_ns,
            position_m=gate,
            velocity_m_s=sinking,
            acceleration_m_s2=ZERO,
            obstacles=tuple(moved(o, request.pad_velocity_m_s, used) for o in request.obstacles),
            max_duration_s=request.max_duration_s - used,
        )
        attempt = self._shortest(onwards)
        if not attempt.holds:
            return NoPlan("bspline", request.t_ns, f"down the cone: {attempt.reason}")
        return joined(first, self._finish(onwards, attempt))

    def _shortest(self, request: PlanRequest) -> Attempt:
        """Grow the duration until the limits hold, then halve the last step."""
        duration, too_short = min(least_duration_s(request), request.max_duration_s), 0.0
        nearest = attempt = self._attempt(request, duration)
        while not attempt.holds and duration < request.max_duration_s:
            too_short = duration
            growth = min(max(attempt.slowdown, GROWTH_MIN), GROWTH_MAX)
            duration = min(duration * growth, request.max_duration_s)
            attempt = self._attempt(request, duration)
            if attempt.slowdown < nearest.slowdown:
                nearest = attempt
        if not attempt.holds:
            return nearest
        for _ in range(REFINEMENTS if too_short else 0):
            middle = self._attempt(request, 0.5 * (too_short + attempt.duration_s))
            if middle.holds:
                attempt = middle
            else:
                too_short = middle.duration_s
        return attempt

    def _attempt(self, request: PlanRequest, duration_s: float) -> Attempt:
        shape, h = self._shape, duration_s / self._shape.spans
        points = _end_points(shape, request, h)
        _shape_free_points(shape, request, points)
        velocity = _differences(points, shape.factors[0], h)
        acceleration = _differences(velocity, shape.factors[1], h)
        jerk = _differences(acceleration, shape.factors[2], h)
        bounds = bounds_of_control_points(
            velocity, acceleration, jerk, pad_velocities(request), request.pad_acceleration_m_s2
        )
        slowdown, reason = excess(bounds, request.limits)
        blocked = _blocked(shape, request, points, h)
        if blocked:
            slowdown, reason = max(slowdown, 1.0) + 0.08, blocked
        return Attempt(duration_s, points, bounds, jerk, slowdown, reason)

    def _finish(self, request: PlanRequest, attempt: Attempt) -> Plan:
        shape, h = self._shape, attempt.duration_s / self._shape.spans
        pieces = tuple(_piece(shape, attempt.points, span, h) for span in range(shape.spans))
        return Plan(
            method="bspline",
            trajectory=Trajectory(request.t_ns, tuple(h * k for k in range(shape.spans + 1)), pieces),
            proven=attempt.bounds,
            cost=_jerk_cost(shape, attempt.jerk_points, h),
            control_points_m=tuple(zip(*attempt.points, strict=True)),
        )


def start_problem(request: PlanRequest) -> str:
    """Why no plan at all can hold the request's geometry from where the vehicle is; empty where one may."""
    start = (request.position_m,)
    if request.cone is not None and not in_cone(request.cone, list(start)):
        return "starts beside the descent cone, below its top"
    view = request.field_of_view
    if view and not pad_in_view(view, start, (request.acceleration_m_s2,), request.pad_acceleration_m_s2):
        return "the pad is not in view at the start"
    return ""


def _end_points(shape: Shape, request: PlanRequest, h: float) -> Points:
    """Control points with the three at each end that meet the states there; the free ones are still zero."""
    p, n = shape.degree, shape.count
    first = h * min(2, shape.spans)
    points: Points = ([0.0] * n, [0.0] * n, [0.0] * n)
    for axis in range(3):
        x, v, a = request.position_m[axis], request.velocity_m_s[axis], request.acceleration_m_s2[axis]
        goal, goal_v = request.goal_position_m[axis], request.goal_velocity_m_s[axis]
        column = points[axis]
        column[0] = x
        column[1] = x + v * h / p
        column[2] = column[1] + (v + a * h / (p - 1)) * first / p
        column[n - 1] = goal
        column[n - 2] = goal - goal_v * h / p
        column[n - 3] = column[n - 2] - goal_v * first / p
    return points


def _shape_free_points(shape: Shape, request: PlanRequest, points: Points) -> None:
    """Least jerk, then out of the floor and into the cone."""
    n = shape.count
    for column in points:
        ends = (column[0], column[1], column[2], column[n - 3], column[n - 2], column[n - 1])
        for i, row in enumerate(shape.free, start=3):
            column[i] = sum([w * e for w, e in zip(row, ends, strict=True)])
    for i in range(3, n - 3):
        _lift(request, points, i)


def _lift(request: PlanRequest, points: Points, i: int) -> None:
    """Raise a control point to the floor and onto the cone's side, at most to the cone's top."""
    x, y, z = points[0][i], points[1][i], points[2][i]
    if request.limits.floor_m is not None:
        z = min(z, -request.limits.floor_m)
    if request.cone is not None:
        z = min(z, -_cone_height(request.cone, math.hypot(x, y)))
    points[2][i] = z


def _cone_height(cone: DescentCone, distance_m: float) -> float:
    """Lowest height above the pad that the cone allows at a horizontal distance."""
    outside = distance_m - cone.radius_m
    if outside <= 0.0:
        return -math.inf
    return min(cone.top_m, outside / cone.slope) if cone.slope > 0.0 else cone.top_m


def _differences(points: Axes, factors: tuple[float, ...], h: float) -> Points:
    """Control points of the derivative."""
    inverse = 1.0 / h
    x, y, z = points
    scaled = [f * inverse for f in factors]
    return (
        [(b - a) * f for a, b, f in zip(x, x[1:], scaled, strict=False)],
        [(b - a) * f for a, b, f in zip(y, y[1:], scaled, strict=False)],
        [(b - a) * f for a, b, f in zip(z, z[1:], scaled, strict=False)],
    )


def _blocked(shape: Shape, request: PlanRequest, points: Points, h: float) -> str:
    """Why the geometry does not hold, span by span on the hull of its control points; empty where it holds."""
    floor = request.limits.floor_m
    if floor is not None and max(points[2]) > -floor + TOLERANCE:
        return f"goes {max(points[2]) + floor:.2f} m below the floor"
    if request.cone is not None:
        hull = list(zip(*points, strict=True))
        if not all(in_cone(request.cone, hull[s : s + shape.degree + 1]) for s in range(shape.spans)):
            return "leaves the descent cone"
    for obstacle in request.obstacles:
        if not _clear_of(shape, request, obstacle, points, h):
            return f"meets the no-fly volume of {obstacle.radius_m:.1f} m radius"
    if request.field_of_view is not None and not _in_view(shape, request, request.field_of_view, points, h):
        return "loses the pad from view"
    return ""


def _in_view(shape: Shape, request: PlanRequest, view: FieldOfView, points: Points, h: float) -> bool:
    acceleration = _differences(_differences(points, shape.factors[0], h), shape.factors[1], h)
    hull, pushes = list(zip(*points, strict=True)), list(zip(*acceleration, strict=True))
    p = shape.degree
    return all(
        pad_in_view(view, hull[s : s + p + 1], pushes[s : s + p - 1], request.pad_acceleration_m_s2)
        for s in range(shape.spans)
    )


def _clear_of(shape: Shape, request: PlanRequest, obstacle: Obstacle, points: Points, h: float) -> bool:
    offsets: list[Vec3] = []
    for i, g in enumerate(shape.greville):
        cx, cy, cz = centre_at(obstacle, request.pad_velocity_m_s, g * h)
        offsets.append((points[0][i] - cx, points[1][i] - cy, points[2][i] - cz))
    width = shape.degree + 1
    return all(hull_is_clear(obstacle, offsets[s : s + width], points[2][s : s + width]) for s in range(shape.spans))


def _piece(shape: Shape, points: Points, span: int, h: float) -> Piece:
    """The polynomial of one span over seconds, highest power first."""
    p = shape.degree
    scales = [h ** (k - p) for k in range(p + 1)]
    x, y, z = (
        tuple(
            factor * sum([b * c for b, c in zip(row, column[span : span + p + 1], strict=True)])
            for row, factor in zip(shape.basis[span], scales, strict=True)
        )
        for column in points
    )
    return (x, y, z)


def _jerk_cost(shape: Shape, jerk: Axes, h: float) -> float:
    """Integral of squared jerk over the plan."""
    total = 0.0
    for column in jerk:
        for a, row in zip(column, shape.jerk_gram, strict=True):
            total += a * sum([g * b for g, b in zip(row, column, strict=True)])
    return total * h
