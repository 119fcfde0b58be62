"""Planning: from where the vehicle is to the pad, relative to the pad.

One method a file, chosen by `planning.planner`. A planner gets a `PlanRequest` and returns a `Plan` or a `NoPlan` with
the reason. See docs/planning.md.
"""

from __future__ import annotations

from collections.abc import Callable

from companion.config import Planning
from companion.planning.bspline import BSplinePlanner
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
from companion.planning.trajectory import Trajectory
from companion.planning.view import FieldOfView

__all__ = [
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


PLANNERS: dict[str, Callable[[Planning], Planner]] = {
    "bspline": BSplinePlanner.from_config,
    "min_jerk": _min_jerk,
}
"""Factories by the name in the configuration."""
