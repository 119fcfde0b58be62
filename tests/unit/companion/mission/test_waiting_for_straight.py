"""Where the vehicle waits while the pad turns too hard to be touched."""

from __future__ import annotations

from dataclasses import replace

import pytest
from mission_samples import FACTS, PAD

from companion.config import Mission
from companion.messages import Phase
from companion.mission.goals import goal_of

BENT = replace(
    FACTS, pad=PAD, relative_position_m=(0.1, 0.0, -1.5), relative_velocity_m_s=(0.0, 0.0, 0.5), pad_is_bent=True
)


@pytest.mark.parametrize(("follow_height_m", "height_m"), [(5.0, 2.0), (1.2, 1.2)])
def test_it_waits_where_the_camera_still_sees_the_pad(follow_height_m: float, height_m: float) -> None:
    goal = goal_of(Phase.DESCEND, BENT, Mission(follow_height_m=follow_height_m), phase_age_s=3.0)
    assert goal is not None
    assert goal.position_m == (0.0, 0.0, -height_m)


@pytest.mark.parametrize(("bent", "age_s"), [(False, 3.0), (True, 12.0)])
def test_it_goes_on_when_the_pad_goes_straight_or_the_time_is_over(bent: bool, age_s: float) -> None:
    goal = goal_of(Phase.DESCEND, replace(BENT, pad_is_bent=bent), Mission(), phase_age_s=age_s)
    assert goal is not None
    assert goal.position_m[2] == pytest.approx(-0.72)
