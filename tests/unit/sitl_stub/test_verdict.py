"""Endings that a flight rarely gives on demand, fed to the judge by hand."""

from __future__ import annotations

import math

import pytest

from sitl_stub.carriers.deck import DeckState
from sitl_stub.contact import ContactState
from sitl_stub.scenario import Success
from sitl_stub.verdict import Ending, Judge, pad_distance, pad_offset, relative_velocity, tilt_between

FLAT = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
DECK = DeckState((10.0, 0.0, -0.5), (2.0, 0.0, 0.0), FLAT, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
LEVEL = (1.0, 0.0, 0.0, 0.0)
ON_DECK = ContactState(feet_on_deck=4, gap_m=0.0)
ON_GROUND = ContactState(feet_on_ground=4, gap_m=0.0)
IN_AIR = ContactState(gap_m=1.0)


class Story:
    """Tells a judge what happened, in stretches of time."""

    def __init__(self) -> None:
        self.judge = Judge(Success(), 100.0, starts_in_air=True)
        self.t_s = 0.0
        self.then(0.5, IN_AIR)

    def then(
        self,
        duration_s: float,
        contact: ContactState,
        *,
        x_m: float = 10.2,
        velocity: tuple[float, float, float] = (2.0, 0.0, 0.0),
        q: tuple[float, float, float, float] = LEVEL,
        motors: bool = True,
    ) -> Story:
        for _ in range(round(duration_s / 0.01)):
            self.t_s += 0.01
            self.judge.update(
                self.t_s,
                0.01,
                position_ned_m=(x_m, 0.0, -0.65),
                velocity_ned_m_s=velocity,
                q_ned_frd=q,
                deck=DECK,
                contact=contact,
                motors_run=motors,
                is_armed=motors,
            )
        return self

    @property
    def ending(self) -> Ending:
        return self.judge.verdict(self.t_s).ending


def test_standing_on_the_deck_with_motors_off_is_on_pad_after_the_settling_time() -> None:
    story = Story().then(0.01, ON_DECK, velocity=(2.3, 0.0, 0.6)).then(0.5, ON_DECK).then(1.9, ON_DECK, motors=False)
    assert story.ending is Ending.FLYING
    verdict = story.then(0.2, ON_DECK, motors=False).judge.verdict(story.t_s)
    assert verdict.ending is Ending.ON_PAD
    assert verdict.touchdown_error_m is not None
    assert math.isclose(verdict.touchdown_error_m, 0.2)
    assert verdict.touchdown_relative_speed_horizontal_m_s is not None
    assert math.isclose(verdict.touchdown_relative_speed_horizontal_m_s, 0.3)
    assert verdict.touchdown_relative_speed_vertical_m_s == 0.6
    assert not verdict.forced_disarm_in_air


def test_leaving_the_deck_after_standing_on_it_is_slid_off() -> None:
    story = Story().then(1.0, ON_DECK).then(0.5, ON_DECK, motors=False).then(0.4, IN_AIR, motors=False)
    assert story.then(2.5, ON_GROUND, velocity=(0.0, 0.0, 0.0), motors=False).ending is Ending.SLID_OFF


def test_going_round_and_then_landing_on_the_ground_is_off_pad() -> None:
    story = Story().then(1.0, ON_DECK).then(8.0, IN_AIR).then(1.0, ON_GROUND, velocity=(0.0, 0.0, 0.3))
    assert story.then(2.5, ON_GROUND, velocity=(0.0, 0.0, 0.0), motors=False).ending is Ending.OFF_PAD


def test_a_second_touchdown_is_the_one_that_counts() -> None:
    story = Story().then(0.2, ON_DECK, x_m=10.6).then(3.0, IN_AIR).then(0.5, ON_DECK, x_m=10.1)
    verdict = story.judge.verdict(story.t_s)
    assert verdict.touchdowns == 2
    assert verdict.touchdown_error_m is not None
    assert math.isclose(verdict.touchdown_error_m, 0.1, abs_tol=1e-9)


def test_a_bounce_is_not_a_second_touchdown_and_stopping_in_it_is_not_stopping_in_the_air() -> None:
    story = Story().then(0.1, ON_DECK).then(0.1, ContactState(gap_m=0.02)).then(0.5, ON_DECK, motors=False)
    verdict = story.judge.verdict(story.t_s)
    assert verdict.touchdowns == 1
    assert not verdict.forced_disarm_in_air


def test_turning_over_is_tipped_even_with_motors_running() -> None:
    over = (math.cos(math.radians(45.0)), math.sin(math.radians(45.0)), 0.0, 0.0)
    lying = ContactState(feet_on_deck=2, frame_on_deck=2, gap_m=0.0)
    assert Story().then(0.5, ON_DECK).then(1.5, lying, q=over).ending is Ending.TIPPED


def test_striking_the_side_and_ending_on_the_ground_is_hit_side() -> None:
    struck = ContactState(side_hits=2, gap_m=0.3)
    story = Story().then(0.1, struck).then(0.3, IN_AIR, motors=False)
    # The motors stopped while it rebounded from the side: what came first has the name.
    assert story.then(2.5, ON_GROUND, velocity=(0.0, 0.0, 0.0), motors=False).ending is Ending.HIT_SIDE
    alive = Story().then(0.1, struck).then(0.3, IN_AIR).then(0.2, ON_GROUND, velocity=(0.0, 0.0, 0.0))
    assert alive.then(2.5, ON_GROUND, velocity=(0.0, 0.0, 0.0), motors=False).ending is Ending.HIT_SIDE


def test_striking_the_ground_too_fast_is_a_crash() -> None:
    story = Story().then(0.05, ON_GROUND, velocity=(0.0, 0.0, 6.0))
    assert story.then(2.5, ON_GROUND, velocity=(0.0, 0.0, 0.0), motors=False).ending is Ending.CRASHED


def test_distance_speed_and_tilt_are_those_of_the_turning_tilted_deck() -> None:
    slope = math.radians(10.0)
    tilted = (math.cos(slope), 0.0, math.sin(slope), 0.0, 1.0, 0.0, -math.sin(slope), 0.0, math.cos(slope))
    deck = DeckState((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), tilted, (0.0, 0.0, 0.5), (0.0, slope, 0.0))
    along = (2.0 * math.cos(slope), 0.0, -2.0 * math.sin(slope))
    assert math.isclose(pad_distance(along, deck), 2.0)
    assert pad_offset((along[0], -0.5, along[2]), deck) == pytest.approx((2.0, -0.5))
    assert math.isclose(tilt_between(LEVEL, deck), slope)
    assert relative_velocity((2.0, 0.0, 0.0), (1.0, 1.0, 0.0), deck) == (0.0, 0.0, 0.0)
