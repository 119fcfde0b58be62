"""Minimum snap through waypoints, plain and improved by midpoints (the `guo` paper's approach).

Septic pieces, time shared by distance, solved in closed form (snap.py). Plain minimum snap swings wide of the straight
lines between waypoints; the improved method measures each segment's largest distance from its line, puts a waypoint in the
middle of those beyond a threshold, and solves again. Paths are plain arrays; the planner wraps them for the pad: from the
vehicle through the request's waypoints to the goal, relative to the pad, NED, SI.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from companion.config import Planning
from companion.messages import Vec3
from companion.planning import snap
from companion.planning.proof import jerk_cost, prove
from companion.planning.request import NoPlan, Plan, PlanRequest
from companion.planning.trajectory import Trajectory

Array = npt.NDArray[np.float64]
SplitRule = Literal["all", "worst"]
SAMPLES = 64
"""Points a segment is measured at."""
SLOWDOWNS = 12


@dataclass(frozen=True, slots=True, eq=False)
class SnapPath:
    """`waypoints_m` (n + 1, 3), `durations_s` (n,), `state` (n + 1, 4, 3): position to jerk at each waypoint."""

    waypoints_m: Array
    durations_s: Array
    state: Array

    @property
    def cost(self) -> float:
        """Integral of squared snap, m2/s7."""
        return snap.snap_cost(self.state, self.durations_s)

    def trajectory(self, start_ns: int = 0) -> Trajectory:
        pieces = snap.polynomials(self.state, self.durations_s).tolist()
        breaks = np.concatenate([[0.0], np.cumsum(self.durations_s)]).tolist()
        return Trajectory(start_ns, tuple(breaks), tuple((tuple(x), tuple(y), tuple(z)) for x, y, z in pieces))


def minimum_snap(
    waypoints_m: Array, durations_s: Array, start: Array | None = None, end: Array | None = None
) -> SnapPath:
    """The path through all waypoints (n + 1, 3) with the least integral of squared snap.

    `start` and `end` (3, 3) hold velocity, acceleration and jerk in rows; rest if left out. ValueError where two waypoints
    are missing or a duration is not positive.
    """
    if len(waypoints_m) < 2 or len(durations_s) != len(waypoints_m) - 1 or not bool((durations_s > 0.0).all()):
        raise ValueError("minimum snap needs at least two waypoints and a positive duration between each two")
    waypoints, durations = _flat(waypoints_m), _flat(durations_s)
    rest = np.zeros((3, 3))
    first, last = rest if start is None else _flat(start), rest if end is None else _flat(end)
    return SnapPath(waypoints, durations, snap.solve(waypoints, durations, first, last, snap.GRAM))


def _flat(array: Array) -> Array:
    """One type of array for the kernel, so that it is compiled once."""
    return np.ascontiguousarray(array, dtype=np.float64)


def durations_by_distance(waypoints_m: Array, total_s: float) -> Array:
    """The whole time shared in proportion to the lengths of the segments. ValueError where two waypoints coincide."""
    lengths = np.linalg.norm(np.diff(waypoints_m, axis=0), axis=1)
    if not bool((lengths > 0.0).all()):
        raise ValueError("two successive waypoints coincide")
    shares: Array = total_s * lengths / lengths.sum()
    return shares


def improved_minimum_snap(
    waypoints_m: Array,
    total_s: float,
    threshold_m: float,
    rounds: int = 10,
    rule: SplitRule = "all",
    start: Array | None = None,
    end: Array | None = None,
) -> SnapPath:
    """Minimum snap with midpoints inserted until each segment stays within `threshold_m` of its line, or rounds run out.

    `rule` "all" splits every segment beyond the threshold in a round, "worst" only the one farthest beyond.
    """
    path = minimum_snap(waypoints_m, durations_by_distance(waypoints_m, total_s), start, end)
    for _ in range(rounds):
        deviations = segment_deviations(path)
        beyond = np.flatnonzero(deviations > threshold_m)
        if len(beyond) == 0:
            break
        if rule == "worst":
            beyond = beyond[[int(np.argmax(deviations[beyond]))]]
        middles = 0.5 * (path.waypoints_m[beyond] + path.waypoints_m[beyond + 1])
        points = np.insert(path.waypoints_m, beyond + 1, middles, axis=0)
        path = minimum_snap(points, durations_by_distance(points, total_s), start, end)
    return path


def segment_deviations(path: SnapPath, samples: int = SAMPLES) -> Array:
    """Largest distance (n,) of each segment from the straight line between its waypoints."""
    points = sample_segments(path, samples)
    distances = distance_to_segment(points, path.waypoints_m[:-1, None, :], path.waypoints_m[1:, None, :])
    return np.asarray(distances.max(axis=1))


def sample_segments(path: SnapPath, samples: int) -> Array:
    """Positions (n, samples + 1, 3) at equal times within each segment, both ends included."""
    scaled = path.durations_s[:, None] ** np.arange(4.0)
    ends = np.concatenate([path.state[:-1] * scaled[:, :, None], path.state[1:] * scaled[:, :, None]], axis=1)
    values: Array = np.matmul(_sampling(samples), ends)
    return values


_SAMPLING: dict[int, Array] = {}


def _sampling(samples: int) -> Array:
    """Hermite values to positions at equal times (samples + 1, 8); made once per count."""
    if samples not in _SAMPLING:
        _SAMPLING[samples] = np.linspace(0.0, 1.0, samples + 1)[:, None] ** np.arange(8.0) @ snap.HERMITE
    return _SAMPLING[samples]


def distance_to_segment(points: Array, a: Array, b: Array) -> Array:
    """Distance of points (..., 3) from the straight segments a to b (broadcast)."""
    along = b - a
    share = ((points - a) * along).sum(axis=-1) / np.maximum((along * along).sum(axis=-1), 1e-30)
    nearest = a + np.clip(share, 0.0, 1.0)[..., None] * along
    return np.asarray(np.sqrt(((points - nearest) ** 2).sum(axis=-1)))


class MinSnapPlanner:
    """Improved minimum snap through the request's waypoints to the goal, slowed until the limits are proven."""

    def __init__(self, threshold_m: float = 2.0, rounds: int = 4, rule: SplitRule = "all") -> None:
        self._threshold_m, self._rounds, self._rule = threshold_m, rounds, rule
        minimum_snap(np.eye(3), np.ones(2))  # compiles the kernel now, not in the air

    @classmethod
    def from_config(cls, planning: Planning) -> MinSnapPlanner:
        return cls(planning.snap_threshold_m, planning.snap_rounds, planning.snap_split)

    def plan(self, request: PlanRequest) -> Plan | NoPlan:
        """A Plan, or NoPlan with what binds at the slowest tried."""

        def path(waypoints: Array, total_s: float) -> SnapPath:
            start, end = end_derivatives(request)
            return improved_minimum_snap(waypoints, total_s, self._threshold_m, self._rounds, self._rule, start, end)

        return plan_path("min_snap", request, path)


def end_derivatives(request: PlanRequest) -> tuple[Array, Array]:
    """Velocity, acceleration, jerk (rows) at start and goal; the jerk is zero at both."""
    start = np.array([request.velocity_m_s, request.acceleration_m_s2, (0.0, 0.0, 0.0)])
    end = np.array([request.goal_velocity_m_s, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)])
    return start, end


def plan_path(method: str, request: PlanRequest, path: Callable[[Array, float], SnapPath]) -> Plan | NoPlan:
    """Fly `path(waypoints, total time)` as fast as its proven bounds allow, from fast to slow."""
    waypoints = np.array([request.position_m, *request.waypoints_m, request.goal_position_m], dtype=float)
    lengths = np.linalg.norm(np.diff(waypoints, axis=0), axis=1)
    if not bool((lengths > 1e-6).all()):
        return NoPlan(method, request.t_ns, "two successive waypoints coincide")
    cruise = min(request.limits.relative_speed_m_s, request.limits.max_speed_m_s)
    total = max(request.min_duration_s, float(lengths.sum()) / cruise)
    reason = "no duration tried"
    for _ in range(SLOWDOWNS):
        total = min(total, request.max_duration_s)
        found = path(waypoints, total)
        trajectory = found.trajectory(request.t_ns)
        proof = prove(trajectory, request)
        if proof.holds:
            points = tuple(_vec3(row) for row in found.waypoints_m)
            return Plan(method, trajectory, proof.bounds, jerk_cost(trajectory), points)
        reason = f"{proof.reason} (at {total:.1f} s)"
        if total >= request.max_duration_s:
            break
        total *= min(max(proof.slowdown * 1.01, 1.05), 2.0)
    return NoPlan(method, request.t_ns, reason)


def _vec3(row: Array) -> Vec3:
    return (float(row[0]), float(row[1]), float(row[2]))
