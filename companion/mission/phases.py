"""The mission as a table: phase x event -> next phase.

Events are listed in the order in which they are asked: the first that holds and that the phase answers wins. What a phase
does not list, it ignores on purpose. docs/mission.md draws this table.
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
    VISION_LOST = "pad out of sight"
    PAD_LOST = "pad lost"
    PAD_KNOWN = "pad known"


_ALWAYS: dict[Event, Phase] = {
    Event.DISARMED: Phase.IDLE,
    Event.PILOT_TOOK_OVER: Phase.IDLE,
    Event.AUTOPILOT_FAILSAFE: Phase.IDLE,
    Event.LINK_LOST: Phase.IDLE,
    Event.OPERATOR_HOLD: Phase.HOLD,
    Event.OPERATOR_RETURN: Phase.RETURN,
    Event.OUTSIDE_FENCE: Phase.HOLD,
    Event.BATTERY_LOW: Phase.RETURN,
    Event.FLIGHT_TOO_LONG: Phase.RETURN,
}
"""Every phase in which Companion flies the vehicle answers these."""

TABLE: dict[Phase, dict[Event, Phase]] = {
    Phase.IDLE: {
        Event.START_IN_AIR: Phase.ENGAGE,
        Event.START_ON_GROUND: Phase.TAKEOFF,
    },
    Phase.TAKEOFF: {
        Event.LINK_LOST: Phase.IDLE,
        Event.OPERATOR_ABORT: Phase.HOLD,
        Event.OPERATOR_HOLD: Phase.HOLD,
        Event.OPERATOR_RETURN: Phase.RETURN,
        Event.REQUEST_REFUSED: Phase.IDLE,
        Event.AIRBORNE: Phase.ENGAGE,
    },
    Phase.ENGAGE: {
        Event.DISARMED: Phase.IDLE,
        Event.LINK_LOST: Phase.IDLE,
        Event.OPERATOR_ABORT: Phase.HOLD,
        Event.OPERATOR_HOLD: Phase.HOLD,
        Event.OPERATOR_RETURN: Phase.RETURN,
        Event.REQUEST_REFUSED: Phase.IDLE,
        Event.OFFBOARD_GRANTED: Phase.SEARCH,
    },
    Phase.SEARCH: {
        **_ALWAYS,
        Event.OPERATOR_ABORT: Phase.HOLD,
        Event.PAD_IN_SIGHT: Phase.FOLLOW,
        Event.PAD_KNOWN: Phase.APPROACH,
    },
    Phase.APPROACH: {
        **_ALWAYS,
        Event.OPERATOR_ABORT: Phase.HOLD,
        Event.PAD_IN_SIGHT: Phase.FOLLOW,
        Event.PAD_LOST: Phase.SEARCH,
    },
    Phase.FOLLOW: {
        **_ALWAYS,
        Event.OPERATOR_ABORT: Phase.HOLD,
        Event.TOO_MANY_GO_AROUNDS: Phase.HOLD,
        Event.ABOVE_PAD: Phase.DESCEND,
        Event.VISION_LOST: Phase.APPROACH,
    },
    Phase.DESCEND: {
        **_ALWAYS,
        Event.OPERATOR_ABORT: Phase.ABORT,
        Event.OPERATOR_GO_AROUND: Phase.GO_AROUND,
        Event.TOUCHDOWN_SUSPECTED: Phase.TOUCHDOWN,
        Event.OUTSIDE_CONE: Phase.GO_AROUND,
        Event.NO_PLAN: Phase.GO_AROUND,
        Event.READY_TO_COMMIT: Phase.COMMIT,
        Event.VISION_LOST: Phase.GO_AROUND,
    },
    Phase.COMMIT: {
        **_ALWAYS,
        Event.OPERATOR_ABORT: Phase.ABORT,
        Event.OPERATOR_GO_AROUND: Phase.GO_AROUND,
        Event.TOUCHDOWN_SUSPECTED: Phase.TOUCHDOWN,
        Event.COMMIT_UNSAFE: Phase.GO_AROUND,
    },
    Phase.TOUCHDOWN: {
        Event.DISARMED: Phase.DONE,
        Event.PILOT_TOOK_OVER: Phase.IDLE,
        Event.AUTOPILOT_FAILSAFE: Phase.IDLE,
        Event.LINK_LOST: Phase.IDLE,
        Event.OPERATOR_ABORT: Phase.ABORT,
        Event.OPERATOR_GO_AROUND: Phase.GO_AROUND,
        Event.TOUCHDOWN_LOST: Phase.GO_AROUND,
    },
    Phase.GO_AROUND: {
        **_ALWAYS,
        Event.OPERATOR_ABORT: Phase.ABORT,
        Event.TOO_MANY_GO_AROUNDS: Phase.HOLD,
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
        Event.LINK_LOST: Phase.IDLE,
        Event.OPERATOR_RETURN: Phase.RETURN,
        Event.START_IN_AIR: Phase.ENGAGE,
    },
    Phase.RETURN: {
        Event.DISARMED: Phase.IDLE,
        Event.LINK_LOST: Phase.IDLE,
        Event.OPERATOR_HOLD: Phase.HOLD,
        Event.OPERATOR_ABORT: Phase.HOLD,
    },
    Phase.DONE: {},
}

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
