"""Cubic B-spline with four control points (the `dalang` paper).

Clamped with four points it has one span. P0 is the vehicle, P3 the goal, P1 stands a quarter of the horizontal way at three
times the clearance, P2 at three quarters at half of that. It does not know the vehicle's velocity: the reference starts with
the curve's own, as in the paper. The duration is the shortest for which the limits are proven. Relative to the pad, NED.
"""

from __future__ import annotations

import numpy as np

from companion.config import Planning
from companion.messages import Vec3
from companion.planning.catmull_rom import BEZIER_TO_POLYNOMIAL
from companion.planning.proof import jerk_cost, prove
from companion.planning.request import NoPlan, Plan, PlanRequest
from companion.planning.trajectory import Trajectory

SLOWDOWNS = 30
ALTITUDE_FACTOR = 3.0
"""The paper's z_c over the clearance."""


def control_points(start_m: Vec3, goal_m: Vec3, clearance_m: float) -> tuple[Vec3, Vec3, Vec3, Vec3]:
    """The paper's four points; z down, heights from the pad's surface."""
    height = ALTITUDE_FACTOR * clearance_m
    return start_m, _part_way(start_m, goal_m, 0.25, -height), _part_way(start_m, goal_m, 0.75, -height / 2.0), goal_m


def _part_way(start: Vec3, goal: Vec3, share: float, z: float) -> Vec3:
    return (start[0] + share * (goal[0] - start[0]), start[1] + share * (goal[1] - start[1]), z)


def four_point_trajectory(points_m: tuple[Vec3, Vec3, Vec3, Vec3], duration_s: float, start_ns: int = 0) -> Trajectory:
    """The one cubic of the four points, flown in `duration_s`."""
    unit = (BEZIER_TO_POLYNOMIAL @ np.array(points_m)).T
    x, y, z = (unit / duration_s ** np.arange(3.0, -1.0, -1.0)).tolist()
    return Trajectory(start_ns, (0.0, duration_s), ((tuple(x), tuple(y), tuple(z)),))


class FourPointPlanner:
    """The paper's curve over the predicted pad, as fast as the limits allow."""

    def __init__(self, clearance_m: float = 0.5) -> None:
        self._clearance_m = clearance_m

    @classmethod
    def from_config(cls, planning: Planning) -> FourPointPlanner:
        return cls(planning.clearance_m)

    def plan(self, request: PlanRequest) -> Plan | NoPlan:
        """A Plan whose start velocity is the curve's, or NoPlan with what binds at the slowest tried."""
        points = control_points(request.position_m, request.goal_position_m, self._clearance_m)
        duration, reason = request.min_duration_s, ""
        for _ in range(SLOWDOWNS):
            trajectory = four_point_trajectory(points, duration, request.t_ns)
            proof = prove(trajectory, request)
            if proof.holds:
                return Plan("four_point", trajectory, proof.bounds, jerk_cost(trajectory), points)
            reason = f"{proof.reason} (at {duration:.1f} s)"
            if duration >= request.max_duration_s:
                break
            duration = min(duration * min(max(proof.slowdown * 1.01, 1.05), 2.0), request.max_duration_s)
        return NoPlan("four_point", request.t_ns, reason)
