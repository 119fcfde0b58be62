"""What to fly for in each phase: a point (and speed) relative to the pad, or to where the search began."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from companion.config import Mission
from companion.geometry import ZERO
from companion.messages import Phase, Vec3
from companion.mission.contact import window_is_closed
from companion.mission.facts import Facts
from companion.mission.guards import off_the_deck_unseen, waits_for_straight
from companion.mission.press import press
from companion.mission.waiting_place import waiting_place_m

Frame = Literal["pad", "start"]
Style = Literal["plan", "level", "ramp", "press", "pattern", "stay"]


@dataclass(frozen=True, slots=True)
class Goal:
    """`position_m` is vehicle minus pad (or minus start), NED axes.

    Styles: `plan` a planner flies there; `level` the same at the height of the moment; `ramp` straight down at `velocity_m_s`; `press` no position feedback, only the
    pad's velocity, a push down and `acceleration_m_s2`; `pattern` the search; `stay` hold where control was taken up.
    """

    frame: Frame
    style: Style
    position_m: Vec3 = ZERO
    velocity_m_s: Vec3 = ZERO
    acceleration_m_s2: Vec3 = ZERO
    max_descent_m_s: float | None = None


WAIT_MARGIN_M = 0.4
"""Above the commit height: from here the touchdown window counts."""


def goal_of(phase: Phase, facts: Facts, mission: Mission, *, phase_age_s: float = 0.0) -> Goal | None:
    """None where no setpoint is to be sent."""
    match phase:
        case Phase.ENGAGE:
            return Goal("start", "stay")
        case Phase.SEARCH:
            return Goal("start", "pattern")
        case Phase.APPROACH:
            return Goal("pad", "plan", waiting_place_m(mission.approach_height_m, facts, mission))
        case Phase.FOLLOW | Phase.GO_AROUND | Phase.ABORT:
            return Goal("pad", "plan", waiting_place_m(mission.follow_height_m, facts, mission))
        case Phase.DESCEND:
            return _descent(facts, mission, waited_s=phase_age_s)
        case Phase.COMMIT:
            return Goal("pad", "ramp", ZERO, (0.0, 0.0, mission.final_descent_speed_m_s))
        case Phase.TOUCHDOWN:
            sink_m_s, down_m_s2 = press(phase_age_s, mission)
            return Goal("pad", "press", ZERO, (0.0, 0.0, sink_m_s), (0.0, 0.0, down_m_s2))
        case _:
            return None


def _above(height_m: float) -> Goal:
    return Goal("pad", "plan", (0.0, 0.0, -height_m))


def _descent(facts: Facts, mission: Mission, *, waited_s: float) -> Goal:
    """Down to where the last metre begins; level while the pad is out of sight or the vehicle outside the cone."""
    if not may_descend(facts, mission):
        return Goal("pad", "level")
    if waits_for_straight(facts, mission, waited_s=waited_s):
        return _above(min(mission.straight_height_m, mission.follow_height_m))
    if _waits_for_the_deck(facts, mission):
        return _above(mission.commit_height_m)
    end = (0.0, 0.0, -0.9 * mission.commit_height_m)
    down = (0.0, 0.0, mission.final_descent_speed_m_s)
    return Goal("pad", "plan", end, down, max_descent_m_s=mission.descent_speed_m_s)


def _waits_for_the_deck(facts: Facts, mission: Mission) -> bool:
    """Low above a deck that heaves or tilts too much at the time of contact."""
    height = facts.height_above_pad_m
    low = height is not None and height < mission.commit_height_m + WAIT_MARGIN_M
    return low and window_is_closed(facts.contact, mission) is not None


def may_descend(facts: Facts, mission: Mission) -> bool:
    """Inside the cone, and the pad seen a moment ago or so well known that it need not be."""
    height, miss = facts.height_above_pad_m, facts.miss_m
    if height is None or miss is None:
        return False
    inside = miss <= mission.cone_radius_m + mission.cone_slope * height
    return inside and off_the_deck_unseen(facts, mission) is None
