"""A no-fly volume across the way is never flown through, whoever plans: round it, or refused with the reason."""

from __future__ import annotations

import math

import pytest

from companion.config import Planning
from companion.planning import PLANNERS, Cylinder, Limits, NoPlan, PlanRequest

MAST = Cylinder((10.0, 0.2), 2.0)
REQUEST = PlanRequest(
    t_ns=0,
    position_m=(20.0, 0.0, -6.0),
    velocity_m_s=(0.0, 0.0, 0.0),
    acceleration_m_s2=(0.0, 0.0, 0.0),
    limits=Limits(relative_speed_m_s=4.0),
    goal_position_m=(0.0, 0.0, -5.0),
    obstacles=(MAST,),
)


@pytest.mark.parametrize("name", sorted(PLANNERS))
def test_no_planner_leads_through_a_no_fly_cylinder(name: str) -> None:
    if name == "corridor":
        pytest.importorskip("piqp")
    result = PLANNERS[name](Planning(planner=name)).plan(REQUEST)
    if isinstance(result, NoPlan):
        assert name != "bspline"
        assert "no-fly volume" in result.reason
        return
    duration_s = result.trajectory.duration_s
    for k in range(1001):
        (north, east, _), _, _ = result.trajectory.sample(duration_s * k / 1000)
        assert math.dist((north, east), MAST.centre_m) >= MAST.radius_m
