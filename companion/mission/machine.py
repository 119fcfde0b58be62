"""One step of the mission: facts in; phase, requests to the autopilot and what to fly for out.

The machine never fights: a request is repeated only while it is unanswered, and a mode that Companion did not ask for ends
its part (IDLE) until a person says START again.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from companion.config import Mission, Safety
from companion.messages import (
    AutopilotMode,
    CommandKind,
    Health,
    OperatorAction,
    Phase,
    PhaseChanged,
    VehicleCommand,
)
from companion.mission.facts import Facts
from companion.mission.guards import GUARDS, Context, is_above_pad, is_in_sight
from companion.mission.phases import TABLE, Event
from companion.mission.preflight import MAX_STATE_AGE_S, blocking, warnings

STREAM_BEFORE_OFFBOARD_S = 0.2
"""PX4 takes OFFBOARD after one setpoint; a few show that the stream is alive."""

REQUEST_PERIOD_S = 1.5
"""A request that the session has given up on is made again this often."""

OVERTURNED_RAD, OVERTURNED_S = math.radians(60.0), 0.3
"""Tilted like this for this long at the deck's height, the vehicle has fallen over: no flight recovers, propellers only harm."""

NEW_FLIGHT_PHASES = frozenset({Phase.TAKEOFF, Phase.ENGAGE})

ANSWERS = {
    phase: tuple((event, GUARDS[event], answers[event]) for event in Event if event in answers)
    for phase, answers in TABLE.items()
}
"""The table with the guards beside it, in the order of the events: the first that applies is taken."""


@dataclass(frozen=True, slots=True)
class Step:
    """What one tick of the mission decided."""

    phase: Phase
    changes: tuple[PhaseChanged, ...]
    commands: tuple[VehicleCommand, ...]
    health: tuple[Health, ...] = ()


class Machine:
    """State: the phase, when it began, counters and the last request. `resumes`: the phase goes on with a landing that a Hold
    for want of sight interrupted."""

    def __init__(self, mission: Mission, safety: Safety) -> None:
        self._mission = mission
        self._safety = safety
        self.phase = Phase.IDLE
        self.note = "waiting for start"
        self.go_arounds = 0
        self.resumes = False
        self._since_ns: int | None = None
        self._flight_since_ns: int | None = None
        self._above_pad_for_s = 0.0
        self._in_sight_for_s = 0.0
        self._overturned_for_s = 0.0
        self._last_request: tuple[CommandKind, int] | None = None
        self._start_until_ns: int | None = None
        self._start_was_blocked = False
        self._mode_at_entry: AutopilotMode | None = None
        self._holds_for_sight = False

    def step(self, facts: Facts, *, dt_s: float) -> Step:
        """Advance by one tick; at most one change of phase."""
        facts, health = self._with_waiting_start(facts)
        self._count(facts, dt_s)
        if facts.operator is not None:
            self._holds_for_sight = False
        changes: tuple[PhaseChanged, ...] = ()
        transition = self._transition(facts)
        if transition is not None:
            event, target, reason = transition
            changes = (PhaseChanged(facts.t_ns, self.phase, target, f"{event}: {reason}"),)
            self._enter(target, facts, reason, event)
        request = self._request(facts)
        return Step(self.phase, changes, () if request is None else (request,), health)

    def _with_waiting_start(self, facts: Facts) -> tuple[Facts, tuple[Health, ...]]:
        """A START that cannot be obeyed yet waits a little, says for what, and is refused with reasons after that."""
        if facts.operator not in (None, OperatorAction.START):
            self._start_until_ns = None
            return facts, ()
        answers = TABLE[self.phase]
        if Event.START_IN_AIR not in answers and Event.START_ON_GROUND not in answers:
            self._start_until_ns = None
            return facts, ()
        is_new = facts.operator is OperatorAction.START
        if is_new:
            self._start_until_ns = facts.t_ns + round(self._mission.start_wait_s * 1e9)
        if self._start_until_ns is None:
            return facts, ()
        return self._waiting_start(replace(facts, operator=OperatorAction.START), self._start_until_ns, is_new)

    def _waiting_start(self, facts: Facts, until_ns: int, is_new: bool) -> tuple[Facts, tuple[Health, ...]]:
        reasons = "; ".join(blocking(facts, self._safety))
        if not reasons:
            self._start_until_ns = None
            return facts, self._start_obeyed(facts)
        refused = facts.t_ns >= until_ns
        self.note = f"START {'refused' if refused else 'waits'}: {reasons}"
        self._start_was_blocked = True
        if refused:
            self._start_until_ns = None
            return replace(facts, operator=None), (Health(facts.t_ns, "start", 2, self.note),)
        return facts, (Health(facts.t_ns, "start", 1, self.note),) if is_new else ()

    def _start_obeyed(self, facts: Facts) -> tuple[Health, ...]:
        """What is said of it: warnings, else that an earlier obstacle is gone."""
        was_blocked, self._start_was_blocked = self._start_was_blocked, False
        found = tuple(Health(facts.t_ns, "start", 1, text) for text in warnings(facts))
        return found or ((Health(facts.t_ns, "start", 0, "START obeyed"),) if was_blocked else ())

    def _count(self, facts: Facts, dt_s: float) -> None:
        if self._since_ns is None:
            self._since_ns = facts.t_ns
        self._above_pad_for_s = self._above_pad_for_s + dt_s if is_above_pad(facts, self._mission) else 0.0
        self._in_sight_for_s = self._in_sight_for_s + dt_s if is_in_sight(facts, self._mission) else 0.0
        at_deck = facts.height_above_pad_m is not None and not facts.touchdown.airborne
        overturned = facts.tilt_rad > OVERTURNED_RAD and at_deck
        self._overturned_for_s = self._overturned_for_s + dt_s if overturned else 0.0

    def _context(self, t_ns: int) -> Context:
        return Context(
            phase=self.phase,
            phase_age_s=self.age_s(t_ns),
            flight_age_s=0.0 if self._flight_since_ns is None else (t_ns - self._flight_since_ns) / 1e9,
            above_pad_for_s=self._above_pad_for_s,
            go_arounds=self.go_arounds,
            stable_sight_for_s=self._in_sight_for_s,
            mission=self._mission,
            safety=self._safety,
            mode_at_entry=self._mode_at_entry,
            holds_for_sight=self._holds_for_sight,
        )

    def _transition(self, facts: Facts) -> tuple[Event, Phase, str] | None:
        context = self._context(facts.t_ns)
        for event, guard, target in ANSWERS[self.phase]:
            reason = guard(facts, context)
            if reason is not None:
                return event, target, reason
        return None

    def _enter(self, phase: Phase, facts: Facts, reason: str, event: Event) -> None:
        self.resumes = event is Event.SIGHT_BACK
        self._holds_for_sight = event is Event.SIGHT_LOST_HOLD
        if phase in NEW_FLIGHT_PHASES and self.phase not in NEW_FLIGHT_PHASES and not self.resumes:
            self._flight_since_ns = facts.t_ns
            self.go_arounds = 0
        if phase is Phase.GO_AROUND:
            self.go_arounds += 1
        self.phase = phase
        self.note = reason
        self._since_ns = facts.t_ns
        self._mode_at_entry = None if facts.status is None else facts.status.mode
        self._above_pad_for_s = 0.0
        self._last_request = None

    def age_s(self, t_ns: int) -> float:
        """How long the phase has lasted."""
        return 0.0 if self._since_ns is None else (t_ns - self._since_ns) / 1e9

    def _request(self, facts: Facts) -> VehicleCommand | None:
        wanted = self._wanted_request(facts)
        if wanted is None:
            return None
        if self._last_request is not None:
            kind, asked_ns = self._last_request
            if kind is wanted.kind and (facts.t_ns - asked_ns) / 1e9 < REQUEST_PERIOD_S:
                return None
        self._last_request = (wanted.kind, facts.t_ns)
        return wanted

    def _wanted_request(self, facts: Facts) -> VehicleCommand | None:
        status, t_ns = facts.status, facts.t_ns
        if status is None or not status.connected:
            return None
        if self.phase is Phase.TAKEOFF:
            if not status.armed:
                return VehicleCommand(t_ns, CommandKind.ARM, "take-off")
            if status.mode is not AutopilotMode.TAKEOFF and facts.height_above_start_m < 1.0:
                height_m = self._mission.takeoff_height_m
                return VehicleCommand(t_ns, CommandKind.TAKEOFF, "take-off", height_m=height_m)
        if self.phase is Phase.ENGAGE and self.age_s(t_ns) >= STREAM_BEFORE_OFFBOARD_S:
            return VehicleCommand(t_ns, CommandKind.OFFBOARD, "setpoints are streaming")
        if self.phase is Phase.HOLD and status.mode is not AutopilotMode.HOLD:
            return VehicleCommand(t_ns, CommandKind.HOLD, self.note) if self._may_leave_offboard(facts) else None
        if self.phase is Phase.RETURN and status.mode is not AutopilotMode.RETURN:
            return VehicleCommand(t_ns, CommandKind.RETURN, self.note) if self._may_leave_offboard(facts) else None
        if self.phase is Phase.TOUCHDOWN:
            return self._disarm(facts)
        return None

    def _may_leave_offboard(self, facts: Facts) -> bool:
        """Only a mode that Companion itself set (OFFBOARD, or the take-off it asked for) is exchanged for another."""
        ours = (AutopilotMode.OFFBOARD, AutopilotMode.TAKEOFF, AutopilotMode.HOLD)
        return facts.status is not None and facts.status.mode in ours

    def _disarm(self, facts: Facts) -> VehicleCommand | None:
        """Plain first; forced, with the evidence, where the autopilot refuses or cannot know that it has landed."""
        evidence = facts.touchdown
        if facts.state_age_s is None or facts.state_age_s > MAX_STATE_AGE_S:
            return None  # evidence about a state of long ago is none
        if self._mission.disarm != "never" and self._overturned_for_s >= OVERTURNED_S:
            lying = (f"tilt {math.degrees(facts.tilt_rad):.0f} deg at the deck's height",)
            return VehicleCommand(facts.t_ns, CommandKind.FORCE_DISARM, "overturned on the pad", lying)
        if self._mission.disarm == "never" or evidence.proven_for_s < self._mission.touchdown_time_s:
            return None
        plain_refused = facts.refused is not None and self._last_request is not None
        if self._mission.disarm == "auto" and not plain_refused and self._asked_last() is not CommandKind.FORCE_DISARM:
            return VehicleCommand(facts.t_ns, CommandKind.DISARM, "standing on the pad", evidence.signs)
        return VehicleCommand(facts.t_ns, CommandKind.FORCE_DISARM, "standing on the pad", evidence.signs)

    def _asked_last(self) -> CommandKind | None:
        return None if self._last_request is None else self._last_request[0]
