"""The touchdown window: when the feet meet the deck, and how it will lean against the vehicle then."""

import math

import pytest

from companion.config import Mission
from companion.estimation import DeckMotion
from companion.messages import Vec3
from companion.mission.contact import Contact, contact, time_to_contact_s, window_is_closed

MISSION = Mission()
FEET_M = MISSION.vehicle_leg_height_m
DEG = math.radians(1.0)


def hanging(north_deg: float) -> Vec3:
    """Body down leans so far to the north."""
    return (math.sin(north_deg * DEG), 0.0, math.cos(north_deg * DEG))


def swinging(*, pitch_deg: float, mean_deg: float = 0.0, yaw_deg: float = 0.0, hangs_deg: float = 0.0) -> Contact:
    deck = DeckMotion(0.0, 0.0, pitch_deg * DEG, (0.0, mean_deg * DEG))
    return contact(
        0.5, (0.1, 0.0, -0.5), (0.0, 0.0, 0.5), deck, deck_yaw_rad=yaw_deg * DEG, hanging_down=hanging(hangs_deg)
    )


def test_a_vehicle_that_comes_fast_is_on_the_deck_sooner() -> None:
    assert time_to_contact_s(FEET_M + 1.0, 0.5, MISSION) == pytest.approx(2.0)
    assert time_to_contact_s(FEET_M + 1.0, 1.5, MISSION) == pytest.approx(1.0)
    assert time_to_contact_s(FEET_M + 1.0, -1.0, MISSION) == pytest.approx(2.0), "it will be told to sink"
    assert time_to_contact_s(FEET_M - 0.1, 0.5, MISSION) == 0.0


def test_the_lean_is_between_the_deck_and_the_vehicle_as_it_hangs() -> None:
    level = swinging(pitch_deg=5.0)
    assert (level.lean_rad, level.mean_lean_rad) == (pytest.approx(5.0 * DEG), pytest.approx(0.0))
    # Nose up: the deck's down points forward, here to the north, as the vehicle's does.
    with_it = swinging(pitch_deg=5.0, hangs_deg=3.0)
    assert (with_it.lean_rad, with_it.mean_lean_rad) == (pytest.approx(2.0 * DEG), pytest.approx(3.0 * DEG))
    assert swinging(pitch_deg=5.0, hangs_deg=3.0, yaw_deg=180.0).lean_rad == pytest.approx(8.0 * DEG)


def test_a_swinging_deck_is_waited_for_and_then_taken_as_it_is() -> None:
    then = swinging(pitch_deg=6.0)
    assert "waiting" in (window_is_closed(then, MISSION, waited_s=0.0) or "")
    assert window_is_closed(then, MISSION, waited_s=MISSION.quiet_wait_s) is None
    assert window_is_closed(swinging(pitch_deg=3.0), MISSION, waited_s=0.0) is None
    assert window_is_closed(swinging(pitch_deg=9.0), MISSION, waited_s=1e3) is not None


def test_what_waiting_cannot_mend_is_not_waited_for() -> None:
    """Wind leans the vehicle, a road slopes: neither swings."""
    assert window_is_closed(swinging(pitch_deg=0.0, hangs_deg=20.0), MISSION, waited_s=0.0) is None
    assert window_is_closed(swinging(pitch_deg=6.0, mean_deg=6.0), MISSION, waited_s=0.0) is None
