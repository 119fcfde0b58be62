"""Air over a moving deck."""

from __future__ import annotations

import pytest

from sitl_stub.carriers.deck import deck_state
from sitl_stub.contact import DeckShape
from sitl_stub.shelter import sheltered

DECK = deck_state((10.0, 0.0, -1.0, 0.0, 0.0, 0.0), (15.0, 0.0, 0.0, 0.0, 0.0, 0.0))
SHAPE = DeckShape(length_m=1.5, width_m=1.5)
WIND = (-3.0, 1.0, 0.0)


def test_air_on_a_fully_sheltered_deck_moves_with_it_and_high_above_or_beside_it_does_not() -> None:
    assert sheltered(WIND, 1.0, (10.0, 0.0, -1.2), DECK, SHAPE) == pytest.approx((15.0, 0.0, 0.0))
    assert sheltered(WIND, 1.0, (10.0, 0.0, -3.0), DECK, SHAPE) == WIND
    assert sheltered(WIND, 1.0, (13.0, 0.0, -1.2), DECK, SHAPE) == WIND


def test_half_a_shelter_takes_half_of_the_relative_wind_and_fades_with_height() -> None:
    on_deck = sheltered(WIND, 0.5, (10.0, 0.0, -1.2), DECK, SHAPE)
    above = sheltered(WIND, 0.5, (10.0, 0.0, -1.95), DECK, SHAPE)
    assert on_deck[0] == pytest.approx(6.0)
    assert above[0] == pytest.approx(1.5)
