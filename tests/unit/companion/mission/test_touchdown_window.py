"""The touchdown window: when the feet meet the deck."""

import pytest

from companion.config import Mission
from companion.mission.contact import time_to_contact_s

MISSION = Mission()
FEET_M = MISSION.vehicle_leg_height_m


def test_a_vehicle_that_comes_fast_is_on_the_deck_sooner() -> None:
    assert time_to_contact_s(FEET_M + 1.0, 0.5, MISSION) == pytest.approx(2.0)
    assert time_to_contact_s(FEET_M + 1.0, 1.5, MISSION) == pytest.approx(1.0)
    assert time_to_contact_s(FEET_M + 1.0, -1.0, MISSION) == pytest.approx(2.0), "it will be told to sink"
    assert time_to_contact_s(FEET_M - 0.1, 0.5, MISSION) == 0.0
