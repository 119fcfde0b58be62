"""`mission.sight = "beacon"`: the pad's own report stands in for the camera, and only where that is asked for."""

from __future__ import annotations

from dataclasses import replace

from companion.config import Mission, Safety
from companion.messages import Phase
from companion.mission.goals import may_descend
from companion.mission.guards import Context, above_pad, is_above_pad, is_in_sight
from tests.unit.companion.mission.mission_samples import FACTS, PAD

UNSEEN = replace(PAD, vision_age_s=None, beacon_age_s=0.1)
ABOVE = replace(
    FACTS,
    pad=UNSEEN,
    relative_position_m=(0.05, 0.0, -3.0),
    relative_velocity_m_s=(0.0, 0.0, 0.0),
    sight_age_s=None,
)
CAMERA, BEACON = Mission(), Mission(sight="beacon")


def test_a_pad_that_only_reports_itself_is_not_in_sight_of_a_camera() -> None:
    assert not is_in_sight(ABOVE, CAMERA)
    assert not is_above_pad(ABOVE, CAMERA)
    assert not may_descend(ABOVE, CAMERA)


def test_where_the_report_is_trusted_it_is_as_good_as_sight_while_it_is_fresh() -> None:
    assert is_in_sight(ABOVE, BEACON)
    assert is_above_pad(ABOVE, BEACON)
    assert may_descend(ABOVE, BEACON)
    stale = replace(ABOVE, pad=replace(UNSEEN, beacon_age_s=0.6))
    assert not is_in_sight(stale, BEACON)
    assert not may_descend(stale, BEACON)


def context(mission: Mission) -> Context:
    return Context(
        phase=Phase.FOLLOW,
        phase_age_s=5.0,
        flight_age_s=5.0,
        above_pad_for_s=2.0,
        go_arounds=0,
        stable_sight_for_s=2.0,
        mission=mission,
        safety=Safety(),
    )


def test_the_descent_waits_for_the_end_of_the_plan_where_that_is_asked_for() -> None:
    patient = Mission(follow_to_the_end=True)
    assert above_pad(replace(ABOVE, plan_to_go_s=1.5), context(CAMERA)) is not None
    assert above_pad(replace(ABOVE, plan_to_go_s=1.5), context(patient)) is None
    assert above_pad(replace(ABOVE, plan_to_go_s=None), context(patient)) is None
    assert above_pad(replace(ABOVE, plan_to_go_s=0.0), context(patient)) is not None
