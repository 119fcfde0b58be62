"""Planning: from where the vehicle is to the pad, relative to the pad.

One method a file, chosen by `planning.planner`. A planner gets a `PlanRequest` and returns a `Plan` or a `NoPlan` with
the reason. See docs/planning.md.
"""

from __future__ import annotations

from collections.abc import Callable

from companion.config import Planning
from companion.planning.bezier import BezierPlanner
from companion.planning.bspline import BSplinePlanner
from companion.planning.follower import Follower, ReferenceFollower
from companion.planning.four_point import FourPointPlanner
from companion.planning.ground_follower import GroundFollower
from companion.planning.limits import Limits, ProvenBounds, limits_from_config
from companion.planning.obstacle import Cylinder, Obstacle, Sphere
from companion.planning.request import (
    DescentCone,
    NoPlan,
    Plan,
    Planner,
    PlanRequest,
    admitting_start,
    plan_made,
)
from companion.planning.round_volumes import RoundVolumes
from companion.planning.trajectory import Trajectory
from companion.planning.view import FieldOfView

__all__ = [
    "FOLLOWERS",
    "PLANNERS",
    "Cylinder",
    "DescentCone",
    "FieldOfView",
    "Limits",
    "NoPlan",
    "Obstacle",
    "Plan",
    "PlanRequest",
    "Planner",
    "ProvenBounds",
    "Sphere",
    "Trajectory",
    "admitting_start",
    "limits_from_config",
    "plan_made",
]


def _min_jerk(planning: Planning) -> Planner:
    from companion.planning.min_jerk import MinJerkPlanner  # compiles: only for those who ask for it

    return MinJerkPlanner.from_config(planning)


def _min_snap(planning: Planning) -> Planner:
    from companion.planning.min_snap import MinSnapPlanner  # compiles

    return MinSnapPlanner.from_config(planning)


def _corridor(planning: Planning) -> Planner:
    from companion.planning.corridor import CorridorPlanner  # needs the extra `qp`

    return CorridorPlanner.from_config(planning)


def _round_volumes(planner: Callable[[Planning], Planner]) -> Callable[[Planning], Planner]:
    return lambda planning: RoundVolumes(planner(planning))


PLANNERS: dict[str, Callable[[Planning], Planner]] = {
    "bspline": _round_volumes(BSplinePlanner.from_config),
    "bezier": _round_volumes(BezierPlanner.from_config),
    "corridor": _round_volumes(_corridor),
    "four_point": FourPointPlanner.from_config,  # two of its curves in a row would dip to the paper's heights between
    "min_jerk": _round_volumes(_min_jerk),
    "min_snap": _round_volumes(_min_snap),
}
"""Factories by the name in the configuration."""

FOLLOWERS: dict[str, Callable[[Planner, Planning], Follower]] = {"pad": ReferenceFollower, "ground": GroundFollower}
"""What a plan is fixed to, by the name in `planning.follower`."""
