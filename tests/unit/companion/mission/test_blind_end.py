"""The last metres out of sight: down only where the deck is surely under the feet, with the estimate's own error added."""

from dataclasses import replace
from typing import Any

import pytest
from mission_samples import FACTS, PAD

from companion.config import Mission, Safety
from companion.messages import PadEstimate, Phase
from companion.mission.contact import Contact
from companion.mission.facts import Facts
from companion.mission.goals import may_descend
from companion.mission.guards import Context, commit_unsafe, off_the_deck_unseen, ready_to_commit

MISSION = Mission()
AHEAD = Contact(in_s=1.0, miss_m=0.1, deck_tilt_rad=0.0, deck_climb_m_s=0.0)


def known_to(sigma_m: float, axis: int = 0) -> PadEstimate:
    """A pad whose place is known worse along one axis."""
    variances = [0.01] * 6
    variances[axis] = sigma_m**2
    rows = tuple(tuple(variances[i] if i == j else 0.0 for j in range(6)) for i in range(6))
    return replace(PAD, covariance=rows)


SURE, UNSURE = known_to(0.15), known_to(0.3, axis=1)


def unseen(height_m: float, pad: PadEstimate = SURE, *, for_s: float = 1.0, **changes: Any) -> Facts:
    seen = replace(
        FACTS,
        pad=replace(pad, vision_age_s=for_s),
        sight_age_s=for_s,
        relative_position_m=(0.1, 0.0, -height_m),
        relative_velocity_m_s=(0.0, 0.0, 0.5),
        contact=AHEAD,
    )
    return replace(seen, **changes)


def context(phase: Phase) -> Context:
    return Context(phase, 1.0, 30.0, 0.0, 0, 0.0, MISSION, Safety())


def test_a_marker_that_vanishes_low_over_a_well_known_pad_does_not_stop_the_descent() -> None:
    assert may_descend(unseen(1.5), MISSION)
    assert ready_to_commit(unseen(0.7), context(Phase.DESCEND))
    assert commit_unsafe(unseen(0.7), context(Phase.COMMIT)) is None


@pytest.mark.parametrize(
    "facts",
    [
        unseen(1.5, UNSURE),
        unseen(1.5, contact=replace(AHEAD, miss_m=0.3)),  # on its way off the deck
        unseen(1.5, half_deck_m=0.35),  # a deck of 0.7 m
        unseen(2.5),  # covered by somebody, perhaps
        unseen(1.5, contact=None),
    ],
    ids=["unsure", "drifts off", "narrow deck", "high up", "nothing foreseen"],
)
def test_out_of_sight_nothing_goes_lower_that_might_miss_the_deck(facts: Facts) -> None:
    assert not may_descend(facts, MISSION)
    assert "not seen" in (off_the_deck_unseen(facts, MISSION) or "")


def test_a_commit_whose_deck_is_lost_goes_around_while_it_can() -> None:
    assert ready_to_commit(unseen(0.7, UNSURE), context(Phase.DESCEND)) is None
    assert "unsure" in (commit_unsafe(unseen(0.7, UNSURE), context(Phase.COMMIT)) or "")
    assert commit_unsafe(unseen(0.4, UNSURE), context(Phase.COMMIT)) is None, "the last decimetres are always blind"


def test_a_pad_in_sight_need_not_be_sure() -> None:
    facts = unseen(0.7, UNSURE, for_s=0.1)
    assert off_the_deck_unseen(facts, MISSION) is None
    assert ready_to_commit(facts, context(Phase.DESCEND))
