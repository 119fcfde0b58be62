"""Fourth-order Bezier landing curve with given end headings and zero end curvature (the `shivam` paper).

P2 is where the line from the start along the initial heading meets the line to the pad along the final one; P1 and P3
divide the two legs at the ratio a. Three control points in a row at each end give heading and zero curvature there. The
curve is followed by arc length: a table over 2^n chords maps distance to parameter. Headings are measured from x towards
y (yaw in NED); directions are vectors, since a slope has no value at +-90 degrees. The planner puts the curve over the
pad in three dimensions, with the z of P2 on an even glide slope.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass
from itertools import pairwise

from companion.config import Planning
from companion.geometry import add, horizontal_norm, scale, subtract
from companion.messages import Vec3
from companion.planning.proof import jerk_cost, prove
from companion.planning.request import NoPlan, Plan, PlanRequest
from companion.planning.trajectory import Piece, Trajectory, horner, quintic

PARALLEL = 1e-6
"""Sine of the angle between the headings below which their lines do not meet."""
TABLE_LEVELS = 7
SHARES = (0.0, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
"""Where, in shares of the duration, the trajectory meets the curve. The first stretch is long: the vehicle's own velocity,
which also has a vertical part, goes over into the curve's there."""
SLOWDOWNS = 20
SLOW_M_S = 0.2
"""Below this horizontal speed the vehicle's velocity says nothing about a heading."""


class ParallelHeadings(ValueError):
    """The two headings' lines do not meet ahead of the start and before the pad, so there is no P2."""


@dataclass(frozen=True, slots=True)
class BezierCurve:
    """Control points of any order; the parameter runs from 0 to 1."""

    points_m: tuple[Vec3, ...]

    def position(self, tau: float) -> Vec3:
        return _casteljau(self.points_m, tau)

    def derivatives(self, tau: float) -> tuple[Vec3, Vec3]:
        """First and second derivative against the parameter."""
        first = _hodograph(self.points_m)
        return _casteljau(first, tau), _casteljau(_hodograph(first), tau)

    def heading(self, tau: float) -> float:
        """Heading of the tangent, rad, from x towards y."""
        first, _ = self.derivatives(tau)
        return math.atan2(first[1], first[0])

    def curvature(self, tau: float) -> float:
        """Signed horizontal curvature, 1/m; positive turns from x towards y."""
        (x, y, _), (xx, yy, _) = self.derivatives(tau)
        return (x * yy - y * xx) / math.hypot(x, y) ** 3


@dataclass(frozen=True, slots=True)
class ArcLength:
    """Distance along a curve at evenly spaced parameters: `lengths_m[k]` at k / (len - 1)."""

    lengths_m: tuple[float, ...]

    @property
    def total_m(self) -> float:
        return self.lengths_m[-1]

    def parameter_at(self, distance_m: float) -> float:
        """Parameter where the distance along the curve is reached, linear between entries, held at the ends."""
        if distance_m <= 0.0:
            return 0.0
        if distance_m >= self.lengths_m[-1]:
            return 1.0
        k = bisect_right(self.lengths_m, distance_m) - 1
        share = (distance_m - self.lengths_m[k]) / (self.lengths_m[k + 1] - self.lengths_m[k])
        return (k + share) / (len(self.lengths_m) - 1)


def landing_curve(
    start_m: Vec3, start_heading_rad: float, pad_m: Vec3, pad_heading_rad: float, ratio: float
) -> BezierCurve:
    """The paper's curve. ParallelHeadings where the headings' lines do not meet ahead of the start and before the pad.

    `ratio` is a in (0, 1]: P1 = P0 + a (P2 - P0), P3 = P2 + a (P4 - P2).
    """
    if not 0.0 < ratio <= 1.0:
        raise ValueError(f"the ratio {ratio} is not in (0, 1]")
    middle = _meeting_point(start_m, start_heading_rad, pad_m, pad_heading_rad)
    first = add(start_m, scale(subtract(middle, start_m), ratio))
    third = add(middle, scale(subtract(pad_m, middle), ratio))
    return BezierCurve((start_m, first, middle, third, pad_m))


def fallback_curve(start_m: Vec3, start_heading_rad: float, pad_m: Vec3, pad_heading_rad: float) -> BezierCurve:
    """A fifth-order curve with the same end headings and zero end curvature, for headings whose lines do not meet."""
    reach = max(horizontal_norm(subtract(pad_m, start_m)), 1e-3) / 5.0
    drop = (pad_m[2] - start_m[2]) / 5.0
    step = (reach * math.cos(start_heading_rad), reach * math.sin(start_heading_rad), drop)
    last = (reach * math.cos(pad_heading_rad), reach * math.sin(pad_heading_rad), drop)
    near_pad = subtract(pad_m, last), subtract(pad_m, scale(last, 2.0))
    return BezierCurve((start_m, add(start_m, step), add(start_m, scale(step, 2.0)), near_pad[1], near_pad[0], pad_m))


def arc_length(curve: BezierCurve, levels: int = TABLE_LEVELS) -> ArcLength:
    """Table over 2^levels chords."""
    count = 2**levels
    points = [curve.position(k / count) for k in range(count + 1)]
    lengths = [0.0]
    for a, b in pairwise(points):
        lengths.append(lengths[-1] + math.dist(a, b))
    return ArcLength(tuple(lengths))


def _meeting_point(start: Vec3, start_heading: float, pad: Vec3, pad_heading: float) -> Vec3:
    ux, uy = math.cos(start_heading), math.sin(start_heading)
    wx, wy = math.cos(pad_heading), math.sin(pad_heading)
    across = ux * wy - uy * wx
    dx, dy = pad[0] - start[0], pad[1] - start[1]
    if abs(across) < PARALLEL:
        raise ParallelHeadings("the initial and the final heading are parallel: their lines have no common point P2")
    ahead, before = (dx * wy - dy * wx) / across, (ux * dy - uy * dx) / across
    if ahead <= 0.0 or before <= 0.0:
        raise ParallelHeadings(
            "the headings' lines meet behind the start or beyond the pad: the end headings would turn"
        )
    x, y = start[0] + ahead * ux, start[1] + ahead * uy
    return (x, y, start[2] + (pad[2] - start[2]) * ahead / (ahead + before))


def _casteljau(points: tuple[Vec3, ...], tau: float) -> Vec3:
    x, y, z = ([p[axis] for p in points] for axis in range(3))
    for count in range(len(points) - 1, 0, -1):
        for i in range(count):
            x[i] += (x[i + 1] - x[i]) * tau
            y[i] += (y[i + 1] - y[i]) * tau
            z[i] += (z[i + 1] - z[i]) * tau
    return (x[0], y[0], z[0])


def _hodograph(points: tuple[Vec3, ...]) -> tuple[Vec3, ...]:
    order = float(len(points) - 1)
    return tuple(scale(subtract(b, a), order) for a, b in pairwise(points))


class BezierPlanner:
    """The landing curve over the predicted pad, flown with a smooth speed along its length.

    Heading at the start is that of the relative velocity, at the pad the approach direction of the request; where those
    say nothing, the ones given, and the line of sight without. Quintics between points of the curve make it a trajectory, the first and the last take
    the exact start and goal states.
    """

    def __init__(
        self, ratio: float = 0.5, start_heading_rad: float | None = None, end_heading_rad: float | None = None
    ) -> None:
        self._ratio = ratio
        self._start_heading_rad = start_heading_rad
        self._end_heading_rad = end_heading_rad

    @classmethod
    def from_config(cls, planning: Planning) -> BezierPlanner:
        headings_deg = (planning.start_heading_deg, planning.end_heading_deg)
        start, end = (None if angle is None else math.radians(angle) for angle in headings_deg)
        return cls(planning.bezier_ratio, start, end)

    def plan(self, request: PlanRequest) -> Plan | NoPlan:
        """A Plan, or NoPlan with what binds at the slowest tried."""
        curve = self._curve(request)
        table = arc_length(curve)
        duration = max(request.min_duration_s, table.total_m / min(request.limits.relative_speed_m_s, 1e3))
        reason = ""
        for _ in range(SLOWDOWNS):
            duration = min(duration, request.max_duration_s)
            trajectory = _timed(request, curve, table, duration)
            proof = prove(trajectory, request)
            if proof.holds:
                return Plan("bezier", trajectory, proof.bounds, jerk_cost(trajectory), curve.points_m)
            reason = f"{proof.reason} (at {duration:.1f} s)"
            if duration >= request.max_duration_s:
                break
            duration *= min(max(proof.slowdown * 1.01, 1.05), 1.6)
        return NoPlan("bezier", request.t_ns, reason)

    def _curve(self, request: PlanRequest) -> BezierCurve:
        start, goal = request.position_m, request.goal_position_m
        sight = subtract(goal, start)
        line = _heading(sight, 0.0, 0.0)
        first = _heading(request.velocity_m_s, SLOW_M_S, _given(self._start_heading_rad, line))
        last = _heading(request.goal_velocity_m_s, SLOW_M_S, _given(self._end_heading_rad, line))
        if request.approach_direction is not None:
            last = _heading(request.approach_direction, 0.0, last)
        try:
            return landing_curve(start, first, goal, last, self._ratio)
        except ParallelHeadings:
            return fallback_curve(start, first, goal, last)


def _heading(vector: Vec3, least: float, otherwise: float) -> float:
    return math.atan2(vector[1], vector[0]) if horizontal_norm(vector) > least else otherwise


def _given(angle_rad: float | None, otherwise_rad: float) -> float:
    return otherwise_rad if angle_rad is None else angle_rad


def _timed(request: PlanRequest, curve: BezierCurve, table: ArcLength, duration_s: float) -> Trajectory:
    """The curve with a quintic distance over time, from the start's speed along it to the goal's."""
    start_speed = max(0.0, _along(request.velocity_m_s, curve, 0.0))
    end_speed = max(0.0, _along(request.goal_velocity_m_s, curve, 1.0))
    start_push = _along(request.acceleration_m_s2, curve, 0.0)
    distance = quintic(duration_s, (0.0, start_speed, start_push), (table.total_m, end_speed, 0.0))
    breaks = tuple(duration_s * share for share in SHARES)
    states = [(request.position_m, request.velocity_m_s, request.acceleration_m_s2)]
    states += [_state_on(curve, table, distance, t) for t in breaks[1:-1]]
    states += [(request.goal_position_m, request.goal_velocity_m_s, (0.0, 0.0, 0.0))]
    pieces = (
        _joined(late - early, a, b) for (early, late), (a, b) in zip(pairwise(breaks), pairwise(states), strict=True)
    )
    return Trajectory(request.t_ns, breaks, tuple(pieces))


def _along(vector: Vec3, curve: BezierCurve, tau: float) -> float:
    (x, y, z), _ = curve.derivatives(tau)
    size = math.sqrt(x * x + y * y + z * z)
    return (vector[0] * x + vector[1] * y + vector[2] * z) / size if size > 1e-9 else 0.0


def _state_on(curve: BezierCurve, table: ArcLength, distance: tuple[float, ...], t_s: float) -> tuple[Vec3, Vec3, Vec3]:
    """Position, velocity, acceleration on the curve at a time, by the chain rule through the parameter."""
    powers = len(distance) - 1
    rate = tuple(c * (powers - i) for i, c in enumerate(distance[:-1]))
    change = tuple(c * (powers - 1 - i) for i, c in enumerate(rate[:-1]))
    tau = table.parameter_at(horner(distance, t_s))
    first, second = curve.derivatives(tau)
    size = math.sqrt(first[0] ** 2 + first[1] ** 2 + first[2] ** 2)
    speed, push = horner(rate, t_s), horner(change, t_s)
    turn = (first[0] * second[0] + first[1] * second[1] + first[2] * second[2]) / size**2
    tau_rate = speed / size
    tau_change = push / size - turn * tau_rate * tau_rate
    velocity = scale(first, tau_rate)
    acceleration = add(scale(second, tau_rate * tau_rate), scale(first, tau_change))
    return curve.position(tau), velocity, acceleration


def _joined(width_s: float, a: tuple[Vec3, Vec3, Vec3], b: tuple[Vec3, Vec3, Vec3]) -> Piece:
    x, y, z = (quintic(width_s, (a[0][i], a[1][i], a[2][i]), (b[0][i], b[1][i], b[2][i])) for i in range(3))
    return (x, y, z)
