"""A pad with an upright marker: the vehicle waits behind it, and in Hold while it sees nothing, where that is asked for."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from mission_samples import FACTS, PAD
from test_machine import DT_S, Flight

from companion.config import Mission
from companion.messages import AutopilotMode, CommandKind, OperatorAction, Phase
from companion.mission.guards import is_above_pad
from companion.mission.waiting_place import waiting_place_m

BEHIND = Mission(follow_behind_m=5.0, follow_height_m=0.5, follow_radius_m=0.7, sight_lost_action="hold")
LOST_S = BEHIND.vision_lost_descend_s + 0.1


def test_the_waiting_place_lies_behind_the_pads_heading() -> None:
    facts = replace(FACTS, pad=replace(PAD, yaw_rad=math.radians(90.0)))
    assert waiting_place_m(0.5, facts, BEHIND) == pytest.approx((0.0, -5.0, -0.5))
    assert waiting_place_m(3.0, facts, Mission()) == (0.0, 0.0, -3.0)
    assert waiting_place_m(0.5, replace(facts, pad=None), BEHIND) == (0.0, 0.0, -0.5)


def test_a_heading_that_trembles_leaves_the_place_where_it_is() -> None:
    places = {waiting_place_m(0.5, replace(FACTS, pad=replace(PAD, yaw_rad=yaw)), BEHIND) for yaw in (0.5, 0.52, 0.54)}
    assert len(places) == 1


@pytest.mark.parametrize(
    ("position_m", "expected"),
    [((-5.2, 0.1, -0.5), True), ((0.0, 0.0, -0.5), False), ((-5.2, 0.1, -1.2), False)],
    ids=["behind", "above the pad", "too high"],
)
def test_the_landing_begins_behind_the_pad_at_the_markers_height(
    position_m: tuple[float, float, float], expected: bool
) -> None:
    facts = replace(
        FACTS,
        pad=replace(PAD, yaw_rad=0.0),
        sight_age_s=0.02,
        relative_position_m=position_m,
        relative_velocity_m_s=(0.0, 0.0, 0.0),
    )
    assert is_above_pad(facts, BEHIND) is expected


def held(flight: Flight) -> Flight:
    """Descending, then blind for longer than allowed."""
    assert flight.tick(sight_age_s=LOST_S, pad=replace(PAD, vision_age_s=LOST_S)) is Phase.HOLD
    assert flight.commands[-1] is CommandKind.HOLD
    return flight


def hold_mission() -> Flight:
    return Flight(Mission(sight_lost_action="hold")).to(Phase.DESCEND)


def test_sight_lost_in_the_descent_leads_to_hold_and_its_return_to_offboard() -> None:
    flight = held(hold_mission())
    flight.tick(1.0, status=flight.status(mode=AutopilotMode.HOLD))
    assert flight.machine.phase is Phase.HOLD
    assert flight.tick(0.5, pad=PAD, sight_age_s=0.02) is Phase.ENGAGE
    assert flight.machine.resumes


def test_a_hold_that_a_person_asked_for_is_not_left_by_sight() -> None:
    flight = held(hold_mission())
    flight.tick(status=flight.status(mode=AutopilotMode.HOLD), operator=OperatorAction.HOLD)
    assert flight.tick(1.0, pad=PAD, sight_age_s=0.02) is Phase.HOLD
    other = hold_mission()
    assert other.tick(operator=OperatorAction.HOLD) is Phase.HOLD
    assert other.tick(1.0, status=other.status(mode=AutopilotMode.HOLD)) is Phase.HOLD


def test_a_pilot_who_takes_over_in_that_hold_keeps_the_vehicle() -> None:
    flight = held(hold_mission())
    flight.tick(status=flight.status(mode=AutopilotMode.HOLD))
    assert flight.tick(DT_S, status=flight.status(mode=AutopilotMode.POSITION)) is Phase.IDLE
    assert flight.tick(1.0, pad=PAD, sight_age_s=0.02) is Phase.IDLE


def test_without_that_setting_lost_sight_leads_to_a_go_around() -> None:
    flight = Flight().to(Phase.DESCEND)
    assert flight.tick(sight_age_s=LOST_S, pad=replace(PAD, vision_age_s=LOST_S)) is Phase.GO_AROUND
