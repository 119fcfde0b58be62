"""A forced disarm in the air is a crash: each single sign alone must never prove a touchdown."""

from __future__ import annotations

from dataclasses import replace

import pytest

from companion.config import Mission
from companion.mission.touchdown import TouchdownDetector, TouchdownEvidence, TouchdownSigns

HOVER = 0.5
ON_DECK = TouchdownSigns(
    height_m=0.15,
    range_m=0.14,
    sink_rate_m_s=0.02,
    relative_speed_m_s=0.1,
    commanded_sink_m_s=0.6,
    thrust_normalized=0.2,
    lean_rad=0.1,
)


def weighed(signs: TouchdownSigns, seconds: float = 1.0) -> TouchdownEvidence:
    detector = TouchdownDetector(Mission())
    detector.learn_hover_thrust(HOVER, dt_s=0.02)
    for _ in range(round(seconds / 0.02) - 1):
        detector.update(signs, dt_s=0.02)
    return detector.update(signs, dt_s=0.02)


def test_all_signs_together_prove_it_after_their_time() -> None:
    evidence = weighed(ON_DECK)
    assert evidence.proven_for_s == pytest.approx(1.0)
    assert len(evidence.signs) == 5


@pytest.mark.parametrize(
    "sign",
    [
        {"height_m": 3.0, "range_m": None},
        {"range_m": 2.0},
        {"height_m": 3.0},
        {"height_m": None},
        {"sink_rate_m_s": 0.5},
        {"sink_rate_m_s": None},
        {"relative_speed_m_s": 1.5},
        {"relative_speed_m_s": None},
        {"commanded_sink_m_s": 0.0},
        {"thrust_normalized": 0.48},
        {"thrust_normalized": None},
        {"lean_rad": 0.35},
        {"lean_rad": None},
    ],
    ids=str,
)
def test_one_missing_sign_is_enough_to_keep_the_motors_running(sign: dict[str, float | None]) -> None:
    assert weighed(replace(ON_DECK, **sign)).proven_for_s == 0.0


def test_what_carries_may_move_as_differently_as_the_estimate_may_be_wrong() -> None:
    """Measured: a second out of view, a pad that turns at 4.2 m/s is 0.8 m/s from where the estimate says it goes."""
    unsure = replace(ON_DECK, relative_speed_m_s=0.8, pad_speed_m_s=4.2, pad_velocity_sigma_m_s=0.6)
    assert weighed(unsure).proven_for_s == pytest.approx(1.0)
    assert weighed(replace(unsure, pad_velocity_sigma_m_s=0.2)).proven_for_s == 0.0


def test_a_vehicle_that_stands_beside_a_pad_that_drives_on_is_not_carried() -> None:
    beside = replace(ON_DECK, relative_speed_m_s=4.2, pad_speed_m_s=4.2, pad_velocity_sigma_m_s=5.0)
    assert weighed(beside).proven_for_s == 0.0


def test_a_range_sensor_stuck_at_zero_proves_nothing_in_the_air() -> None:
    assert not weighed(replace(ON_DECK, range_m=0.1, height_m=4.0)).suspected


def test_without_a_hover_thrust_nothing_is_proven() -> None:
    detector = TouchdownDetector(Mission())
    assert detector.update(ON_DECK, dt_s=5.0).proven_for_s == 0.0


def test_one_sign_that_drops_out_starts_the_clock_again() -> None:
    detector = TouchdownDetector(Mission())
    detector.learn_hover_thrust(HOVER, dt_s=0.02)
    detector.update(ON_DECK, dt_s=0.5)
    detector.update(replace(ON_DECK, thrust_normalized=0.5), dt_s=0.02)
    assert detector.update(ON_DECK, dt_s=0.02).proven_for_s == pytest.approx(0.02)


def test_clear_of_the_deck_is_airborne() -> None:
    assert weighed(replace(ON_DECK, height_m=1.0, range_m=1.0)).airborne
    assert not weighed(ON_DECK).airborne


def test_a_descent_in_free_air_at_the_decks_height_raises_no_suspicion() -> None:
    """Steady sinking reaches most of what is commanded: measured 0.55 of 0.72 m/s."""
    falling = replace(ON_DECK, height_m=0.3, range_m=0.3, sink_rate_m_s=0.55, commanded_sink_m_s=0.72)
    assert not weighed(falling).suspected


def test_a_vehicle_still_tilting_onto_its_second_foot_is_suspected_and_not_proven() -> None:
    tilting = replace(ON_DECK, sink_rate_m_s=0.25, commanded_sink_m_s=0.72)
    evidence = weighed(tilting)
    assert evidence.suspected
    assert evidence.proven_for_s == 0.0
