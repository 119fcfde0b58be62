"""The mission as a table: phase x event -> next phase.

Events are listed in the order in which they are asked: the first that holds and that the phase answers wins. Every pair is
decided: TABLE holds the transitions, IGNORED names why the rest changes nothing; a test proves that the two together are
complete. docs/mission.md is drawn from this table by docs/make_mission.py.
"""

from __future__ import annotations

from enum import StrEnum

from companion.messages import Phase


class Event(StrEnum):
    """What can happen. Each has its guard of the same name in guards.py."""

    DISARMED = "disarmed"
    PILOT_TOOK_OVER = "pilot took over"
    AUTOPILOT_FAILSAFE = "autopilot failsafe"
    LINK_LOST = "link lost"
    STALLED = "stalled"
    OPERATOR_ABORT = "operator: abort"
    OPERATOR_RETURN = "operator: return"
    OPERATOR_HOLD = "operator: hold"
    OPERATOR_GO_AROUND = "operator: go around"
    START_IN_AIR = "operator: start, in the air"
    START_ON_GROUND = "operator: start, on the ground"
    OUTSIDE_FENCE = "outside the fence"
    BATTERY_LOW = "battery low"
    FLIGHT_TOO_LONG = "flight too long"
    REQUEST_REFUSED = "autopilot refused"
    AIRBORNE = "airborne"
    OFFBOARD_GRANTED = "offboard granted"
    NO_LANDING_HERE = "no landing here"
    TOUCHDOWN_SUSPECTED = "touchdown suspected"
    TOUCHDOWN_LOST = "in the air again"
    TOO_MANY_GO_AROUNDS = "too many go-arounds"
    COMMIT_UNSAFE = "unsafe to touch"
    OUTSIDE_CONE = "far outside the cone"
    NO_PLAN = "no plan"
    READY_TO_COMMIT = "ready to commit"
    ABOVE_PAD = "above the pad and with it"
    CLIMBED = "climbed"
    PAD_IN_SIGHT = "pad in sight"
    SIGHT_LOST_HOLD = "pad out of sight: hold"
    SIGHT_BACK = "pad in sight again"
    VISION_LOST = "pad out of sight"
    PAD_LOST = "pad lost"
    PAD_KNOWN = "pad known"
    LOST_FOR_GOOD_HOLD = "not found: hold"
    LOST_FOR_GOOD_RETURN = "not found: return"


class Ignored(StrEnum):
    """Why a phase does not answer an event."""

    NOT_OURS = "Companion does not fly the vehicle"
    AUTOPILOT_FLIES = "the autopilot flies by its own mode and keeps its own limits"
    ALREADY = "what is asked for is under way"
    FINISH = "on the deck finishing is the safe way"
    WAITS = "the vehicle keeps its place against the pad and asks again; everybody is told why"
    GIVING_UP = "the attempt is being given up"
    OTHER_PHASE = "belongs to another part of the flight"
    ANOTHER_EVENT = "another event of this phase covers it"


_ALWAYS: dict[Event, Phase] = {
    Event.DISARMED: Phase.IDLE,
    Event.PILOT_TOOK_OVER: Phase.IDLE,
    Event.AUTOPILOT_FAILSAFE: Phase.IDLE,
    Event.LINK_LOST: Phase.IDLE,
    Event.STALLED: Phase.IDLE,
    Event.OPERATOR_HOLD: Phase.HOLD,
    Event.OPERATOR_RETURN: Phase.RETURN,
    Event.OUTSIDE_FENCE: Phase.HOLD,
    Event.BATTERY_LOW: Phase.RETURN,
    Event.FLIGHT_TOO_LONG: Phase.RETURN,
}
"""Every phase in which Companion flies the vehicle answers these."""

_PILOT: dict[Event, Phase] = {
    Event.PILOT_TOOK_OVER: Phase.IDLE,
    Event.AUTOPILOT_FAILSAFE: Phase.IDLE,
    Event.LINK_LOST: Phase.IDLE,
    Event.STALLED: Phase.IDLE,
}

TABLE: dict[Phase, dict[Event, Phase]] = {
    Phase.IDLE: {
        Event.START_IN_AIR: Phase.ENGAGE,
        Event.START_ON_GROUND: Phase.TAKEOFF,
    },
    Phase.TAKEOFF: {
        **_PILOT,
        Event.OPERATOR_ABORT: Phase.HOLD,
        Event.OPERATOR_HOLD: Phase.HOLD,
        Event.OPERATOR_RETURN: Phase.RETURN,
        Event.BATTERY_LOW: Phase.RETURN,
        Event.REQUEST_REFUSED: Phase.IDLE,
        Event.AIRBORNE: Phase.ENGAGE,
    },
    Phase.ENGAGE: {
        **_PILOT,
        Event.DISARMED: Phase.IDLE,
        Event.OPERATOR_ABORT: Phase.HOLD,
        Event.OPERATOR_HOLD: Phase.HOLD,
        Event.OPERATOR_RETURN: Phase.RETURN,
        Event.OUTSIDE_FENCE: Phase.HOLD,
        Event.BATTERY_LOW: Phase.RETURN,
        Event.REQUEST_REFUSED: Phase.IDLE,
        Event.OFFBOARD_GRANTED: Phase.SEARCH,
    },
    Phase.SEARCH: {
        **_ALWAYS,
        Event.OPERATOR_ABORT: Phase.HOLD,
        Event.TOO_MANY_GO_AROUNDS: Phase.HOLD,
        Event.PAD_IN_SIGHT: Phase.FOLLOW,
        Event.PAD_KNOWN: Phase.APPROACH,
        Event.LOST_FOR_GOOD_HOLD: Phase.HOLD,
        Event.LOST_FOR_GOOD_RETURN: Phase.RETURN,
    },
    Phase.APPROACH: {
        **_ALWAYS,
        Event.OPERATOR_ABORT: Phase.HOLD,
        Event.TOO_MANY_GO_AROUNDS: Phase.HOLD,
        Event.PAD_IN_SIGHT: Phase.FOLLOW,
        Event.PAD_LOST: Phase.SEARCH,
    },
    Phase.FOLLOW: {
        **_ALWAYS,
        Event.OPERATOR_ABORT: Phase.HOLD,
        Event.TOO_MANY_GO_AROUNDS: Phase.HOLD,
        Event.ABOVE_PAD: Phase.DESCEND,
        Event.VISION_LOST: Phase.APPROACH,
        Event.PAD_LOST: Phase.SEARCH,
    },
    Phase.DESCEND: {
        **_ALWAYS,
        Event.OPERATOR_ABORT: Phase.ABORT,
        Event.OPERATOR_GO_AROUND: Phase.GO_AROUND,
        Event.NO_LANDING_HERE: Phase.GO_AROUND,
        Event.TOUCHDOWN_SUSPECTED: Phase.TOUCHDOWN,
        Event.OUTSIDE_CONE: Phase.GO_AROUND,
        Event.NO_PLAN: Phase.GO_AROUND,
        Event.READY_TO_COMMIT: Phase.COMMIT,
        Event.SIGHT_LOST_HOLD: Phase.HOLD,
        Event.VISION_LOST: Phase.GO_AROUND,
    },
    Phase.COMMIT: {
        **_ALWAYS,
        Event.OPERATOR_ABORT: Phase.ABORT,
        Event.OPERATOR_GO_AROUND: Phase.GO_AROUND,
        Event.NO_LANDING_HERE: Phase.GO_AROUND,
        Event.TOUCHDOWN_SUSPECTED: Phase.TOUCHDOWN,
        Event.COMMIT_UNSAFE: Phase.GO_AROUND,
    },
    Phase.TOUCHDOWN: {
        **_PILOT,
        Event.DISARMED: Phase.DONE,
        Event.OPERATOR_ABORT: Phase.ABORT,
        Event.OPERATOR_GO_AROUND: Phase.GO_AROUND,
        Event.TOUCHDOWN_LOST: Phase.GO_AROUND,
    },
    Phase.GO_AROUND: {
        **_ALWAYS,
        Event.OPERATOR_ABORT: Phase.ABORT,
        Event.TOO_MANY_GO_AROUNDS: Phase.ABORT,
        Event.CLIMBED: Phase.FOLLOW,
        Event.PAD_LOST: Phase.SEARCH,
    },
    Phase.ABORT: {
        **_ALWAYS,
        Event.CLIMBED: Phase.HOLD,
        Event.PAD_LOST: Phase.HOLD,
    },
    Phase.HOLD: {
        Event.DISARMED: Phase.IDLE,
        Event.PILOT_TOOK_OVER: Phase.IDLE,
        Event.AUTOPILOT_FAILSAFE: Phase.IDLE,
        Event.LINK_LOST: Phase.IDLE,
        Event.OPERATOR_RETURN: Phase.RETURN,
        Event.START_IN_AIR: Phase.ENGAGE,
        Event.SIGHT_BACK: Phase.ENGAGE,
    },
    Phase.RETURN: {
        Event.DISARMED: Phase.IDLE,
        Event.PILOT_TOOK_OVER: Phase.IDLE,
        Event.AUTOPILOT_FAILSAFE: Phase.IDLE,
        Event.LINK_LOST: Phase.IDLE,
        Event.OPERATOR_HOLD: Phase.HOLD,
        Event.OPERATOR_ABORT: Phase.HOLD,
    },
    Phase.DONE: {},
}
"""The transitions."""

_START = (Event.START_IN_AIR, Event.START_ON_GROUND)
_LIMITS = (Event.OUTSIDE_FENCE, Event.BATTERY_LOW, Event.FLIGHT_TOO_LONG)
_HANDOVER = (Event.REQUEST_REFUSED, Event.AIRBORNE, Event.OFFBOARD_GRANTED)
_CONTACT = (Event.TOUCHDOWN_SUSPECTED, Event.TOUCHDOWN_LOST)
_LANDING = (Event.COMMIT_UNSAFE, Event.OUTSIDE_CONE, Event.READY_TO_COMMIT, Event.NO_LANDING_HERE)
_PAD = (Event.ABOVE_PAD, Event.CLIMBED, Event.PAD_IN_SIGHT, Event.VISION_LOST, Event.PAD_LOST, Event.PAD_KNOWN)
_SIGHT = (Event.SIGHT_LOST_HOLD, Event.SIGHT_BACK)
_SEARCH_OVER = (Event.LOST_FOR_GOOD_HOLD, Event.LOST_FOR_GOOD_RETURN)
_AROUND = (Event.OPERATOR_GO_AROUND, Event.TOO_MANY_GO_AROUNDS)
_APPROACHING = (*_CONTACT, *_LANDING)
_UNPLANNED = (Event.NO_PLAN, *_APPROACHING)
"""Of phases that plan nothing."""
_ALL_BUT_START = tuple(event for event in Event if event not in _START)


def _because(*groups: tuple[Ignored, tuple[Event, ...]]) -> dict[Event, Ignored]:
    """An event in two groups is a mistake."""
    events = [event for _, members in groups for event in members]
    assert len(events) == len(set(events)), "an event is ignored for two reasons"
    return {event: reason for reason, members in groups for event in members}


IGNORED: dict[Phase, dict[Event, Ignored]] = {
    Phase.IDLE: _because((Ignored.NOT_OURS, _ALL_BUT_START)),
    Phase.TAKEOFF: _because(
        (Ignored.ALREADY, _START),
        (Ignored.AUTOPILOT_FLIES, (Event.OUTSIDE_FENCE, Event.FLIGHT_TOO_LONG)),
        (Ignored.ANOTHER_EVENT, (Event.DISARMED,)),  # on the ground it is; a refused arming shows as a refusal
        (Ignored.OTHER_PHASE, (Event.OFFBOARD_GRANTED, *_AROUND, *_UNPLANNED, *_PAD, *_SEARCH_OVER, *_SIGHT)),
    ),
    Phase.ENGAGE: _because(
        (Ignored.ALREADY, _START),
        (
            Ignored.OTHER_PHASE,
            (Event.AIRBORNE, Event.FLIGHT_TOO_LONG, *_AROUND, *_UNPLANNED, *_PAD, *_SEARCH_OVER, *_SIGHT),
        ),
    ),
    Phase.SEARCH: _because(
        (Ignored.ALREADY, (*_START, Event.PAD_LOST, Event.VISION_LOST)),
        (
            Ignored.OTHER_PHASE,
            (*_HANDOVER, *_SIGHT, Event.OPERATOR_GO_AROUND, *_UNPLANNED, Event.ABOVE_PAD, Event.CLIMBED),
        ),
    ),
    Phase.APPROACH: _because(
        (Ignored.WAITS, (Event.NO_PLAN,)),
        (Ignored.ALREADY, (*_START, Event.PAD_KNOWN, Event.VISION_LOST)),
        (
            Ignored.OTHER_PHASE,
            (
                *_HANDOVER,
                Event.OPERATOR_GO_AROUND,
                *_APPROACHING,
                Event.ABOVE_PAD,
                Event.CLIMBED,
                *_SEARCH_OVER,
                *_SIGHT,
            ),
        ),
    ),
    Phase.FOLLOW: _because(
        (Ignored.WAITS, (Event.NO_PLAN,)),
        (Ignored.ALREADY, (*_START, Event.OPERATOR_GO_AROUND, Event.PAD_IN_SIGHT, Event.PAD_KNOWN, Event.CLIMBED)),
        (Ignored.OTHER_PHASE, (*_HANDOVER, *_APPROACHING, *_SEARCH_OVER, *_SIGHT)),
    ),
    Phase.DESCEND: _because(
        (Ignored.ALREADY, (*_START, Event.ABOVE_PAD, Event.PAD_IN_SIGHT, Event.PAD_KNOWN)),
        (Ignored.ANOTHER_EVENT, (Event.COMMIT_UNSAFE, Event.PAD_LOST, Event.TOO_MANY_GO_AROUNDS)),
        (Ignored.OTHER_PHASE, (*_HANDOVER, Event.TOUCHDOWN_LOST, Event.CLIMBED, *_SEARCH_OVER, Event.SIGHT_BACK)),
    ),
    Phase.COMMIT: _because(
        (Ignored.ALREADY, (*_START, Event.READY_TO_COMMIT, Event.ABOVE_PAD, Event.PAD_IN_SIGHT, Event.PAD_KNOWN)),
        (
            Ignored.ANOTHER_EVENT,  # COMMIT_UNSAFE: the last half metre is flown blind on purpose, and without a planner
            (Event.OUTSIDE_CONE, Event.NO_PLAN, Event.VISION_LOST, Event.PAD_LOST, Event.TOO_MANY_GO_AROUNDS),
        ),
        (Ignored.OTHER_PHASE, (*_HANDOVER, Event.TOUCHDOWN_LOST, Event.CLIMBED, *_SEARCH_OVER, *_SIGHT)),
    ),
    Phase.TOUCHDOWN: _because(
        (Ignored.ALREADY, (*_START, Event.TOUCHDOWN_SUSPECTED)),
        (Ignored.FINISH, (Event.OPERATOR_HOLD, Event.OPERATOR_RETURN, *_LIMITS, *_LANDING, Event.NO_PLAN, *_PAD)),
        (Ignored.ANOTHER_EVENT, (Event.TOO_MANY_GO_AROUNDS,)),
        (Ignored.OTHER_PHASE, (*_HANDOVER, *_SEARCH_OVER, *_SIGHT)),  # a refused disarm is answered by the evidence
    ),
    Phase.GO_AROUND: _because(
        (Ignored.WAITS, (Event.NO_PLAN,)),
        (Ignored.ALREADY, (*_START, Event.OPERATOR_GO_AROUND)),
        (Ignored.GIVING_UP, (*_APPROACHING, Event.ABOVE_PAD, Event.PAD_IN_SIGHT, Event.VISION_LOST, Event.PAD_KNOWN)),
        (Ignored.OTHER_PHASE, (*_HANDOVER, *_SEARCH_OVER, *_SIGHT)),
    ),
    Phase.ABORT: _because(
        (Ignored.WAITS, (Event.NO_PLAN,)),
        (Ignored.ALREADY, (Event.OPERATOR_ABORT,)),
        (Ignored.GIVING_UP, (*_START, *_AROUND, *_APPROACHING, Event.ABOVE_PAD, Event.PAD_IN_SIGHT)),
        (Ignored.ANOTHER_EVENT, (Event.VISION_LOST, Event.PAD_KNOWN)),
        (Ignored.OTHER_PHASE, (*_HANDOVER, *_SEARCH_OVER, *_SIGHT)),
    ),
    Phase.HOLD: _because(
        (Ignored.ALREADY, (Event.OPERATOR_ABORT, Event.OPERATOR_HOLD)),
        (Ignored.AUTOPILOT_FLIES, (Event.STALLED, Event.START_ON_GROUND, *_LIMITS)),
        (Ignored.OTHER_PHASE, (*_HANDOVER, *_AROUND, *_UNPLANNED, *_PAD, *_SEARCH_OVER, Event.SIGHT_LOST_HOLD)),
    ),
    Phase.RETURN: _because(
        (Ignored.ALREADY, (Event.OPERATOR_RETURN, Event.BATTERY_LOW, Event.FLIGHT_TOO_LONG)),
        (Ignored.AUTOPILOT_FLIES, (Event.STALLED, Event.OUTSIDE_FENCE, *_START)),
        (Ignored.OTHER_PHASE, (*_HANDOVER, *_AROUND, *_UNPLANNED, *_PAD, *_SEARCH_OVER, *_SIGHT)),
    ),
    Phase.DONE: _because(
        (Ignored.NOT_OURS, tuple(Event))
    ),  # one program run lands once; motors start for a new one only
}
"""The other pairs, each with its reason."""

OFFBOARD_PHASES: frozenset[Phase] = frozenset(
    {
        Phase.ENGAGE,
        Phase.SEARCH,
        Phase.APPROACH,
        Phase.FOLLOW,
        Phase.DESCEND,
        Phase.COMMIT,
        Phase.TOUCHDOWN,
        Phase.GO_AROUND,
        Phase.ABORT,
    }
)
"""Phases in which setpoints are sent."""
