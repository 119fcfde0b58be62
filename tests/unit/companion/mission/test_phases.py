"""The table as a whole: complete, as drawn, and safe from wherever it can be."""

from __future__ import annotations

import copy
import importlib.util
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule
from mission_samples import FACTS, PAD, STANDING, STATUS

from companion.config import Mission, Safety
from companion.messages import AutopilotMode, CommandKind, OperatorAction, Phase
from companion.mission.machine import Machine
from companion.mission.phases import IGNORED, OFFBOARD_PHASES, TABLE, Event

DT_S = 0.02
DOCS = Path(__file__).parents[4] / "docs"
FLOWN_BY_US = sorted(OFFBOARD_PHASES | {Phase.TAKEOFF})


@pytest.mark.parametrize("phase", list(Phase))
def test_every_pair_is_a_transition_or_ignored_for_a_reason_and_never_both(phase: Phase) -> None:
    assert set(TABLE[phase]) | set(IGNORED[phase]) == set(Event)
    assert not set(TABLE[phase]) & set(IGNORED[phase])


def test_every_phase_can_be_reached() -> None:
    reached, waiting = set(), [Phase.IDLE]
    while waiting:
        phase = waiting.pop()
        reached.add(phase)
        waiting += [target for target in TABLE[phase].values() if target not in reached]
    assert reached == set(Phase)


def test_nothing_but_touchdown_leads_to_done_and_nothing_leads_out() -> None:
    before = {phase for phase, answers in TABLE.items() if Phase.DONE in answers.values()}
    assert before == {Phase.TOUCHDOWN}
    assert TABLE[Phase.DONE] == {}


@pytest.mark.parametrize("phase", [*FLOWN_BY_US, Phase.HOLD, Phase.RETURN])
def test_the_pilot_ends_our_part_in_every_phase(phase: Phase) -> None:
    assert TABLE[phase][Event.PILOT_TOOK_OVER] is Phase.IDLE
    assert TABLE[phase][Event.AUTOPILOT_FAILSAFE] is Phase.IDLE
    assert TABLE[phase][Event.LINK_LOST] is Phase.IDLE


@pytest.mark.parametrize("phase", FLOWN_BY_US)
def test_a_stall_ends_our_part_in_every_phase_we_fly(phase: Phase) -> None:
    assert TABLE[phase][Event.STALLED] is Phase.IDLE


@pytest.mark.parametrize("phase", [p for p in Phase if p not in (Phase.IDLE, Phase.DONE, Phase.HOLD, Phase.ABORT)])
def test_abort_is_answered_wherever_companion_has_asked_for_something(phase: Phase) -> None:
    target = TABLE[phase][Event.OPERATOR_ABORT]
    assert target is Phase.HOLD or (target is Phase.ABORT and Phase.HOLD in TABLE[Phase.ABORT].values())


def test_only_a_person_leads_out_of_idle() -> None:
    assert set(TABLE[Phase.IDLE]) == {Event.START_IN_AIR, Event.START_ON_GROUND}


def test_the_page_is_drawn_from_this_table() -> None:
    spec = importlib.util.spec_from_file_location("make_mission", DOCS / "make_mission.py")
    assert spec is not None
    assert spec.loader is not None
    make_mission = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(make_mission)
    text = (DOCS / "mission.md").read_text(encoding="utf-8")
    assert text == make_mission.page(text), "run docs/make_mission.py"


metres = st.floats(-8.0, 8.0)


class AnyFlight(RuleBasedStateMachine):
    """Facts change at random, the obedient and the disobedient autopilot included; what must hold holds after every tick."""

    def __init__(self) -> None:
        super().__init__()
        self.machine = Machine(Mission(), Safety())
        self.facts = FACTS
        self.before = Phase.IDLE
        self.wrong: list[str] = []

    def tick(self, machine: Machine | None = None) -> Phase:
        mine = machine or self.machine
        before = mine.phase
        self.facts = replace(self.facts, t_ns=self.facts.t_ns + round(DT_S * 1e9))
        step = mine.step(self.facts, dt_s=DT_S)
        self.facts = replace(self.facts, operator=None)
        for command in step.commands:
            disarms = command.kind in (CommandKind.DISARM, CommandKind.FORCE_DISARM)
            if disarms and not (step.phase is Phase.TOUCHDOWN and self.facts.touchdown.proven_for_s >= 0.4):
                self.wrong.append(f"{command.kind} in {step.phase}")
            if command.kind is CommandKind.LAND:
                self.wrong.append("asked the autopilot to land")
        if step.phase is Phase.DONE and before not in (Phase.DONE, Phase.TOUCHDOWN):
            self.wrong.append(f"done after {before}")
        return step.phase

    @rule(action=st.sampled_from(OperatorAction))
    def a_person_asks(self, action: OperatorAction) -> None:
        self.facts = replace(self.facts, operator=action)
        self.tick()

    @rule(mode=st.sampled_from(AutopilotMode), armed=st.booleans(), failsafe=st.booleans())
    def the_autopilot_does_something(self, mode: AutopilotMode, armed: bool, failsafe: bool) -> None:
        self.facts = replace(self.facts, status=replace(STATUS, mode=mode, armed=armed, failsafe=failsafe))
        self.tick()

    @rule()
    def the_autopilot_obeys(self) -> None:
        mode = AutopilotMode.OFFBOARD if self.machine.phase in OFFBOARD_PHASES else AutopilotMode.HOLD
        self.facts = replace(self.facts, status=replace(STATUS, mode=mode))
        self.tick()

    @rule(north=metres, height=st.floats(0.1, 8.0), speed=st.floats(0.0, 2.0), seen=st.floats(0.0, 12.0))
    def the_pad_is_somewhere(self, north: float, height: float, speed: float, seen: float) -> None:
        pad = replace(PAD, vision_age_s=seen, beacon_age_s=seen)
        self.facts = replace(
            self.facts,
            pad=pad,
            sight_age_s=seen,
            relative_position_m=(north, 0.0, -height),
            relative_velocity_m_s=(speed, 0.0, 0.0),
        )
        self.tick()

    @rule(height=st.sampled_from([0.3, 0.6, 5.0]))
    def the_pad_is_below_and_stays_there(self, height: float) -> None:
        still = {"relative_position_m": (0.05, 0.0, -height), "relative_velocity_m_s": (0.0, 0.0, 0.0)}
        self.facts = replace(self.facts, pad=PAD, sight_age_s=0.02, **still)  # type: ignore[arg-type]
        for _ in range(60):
            self.tick()

    @rule(stands=st.booleans())
    def it_looks_like_a_touchdown(self, stands: bool) -> None:
        self.facts = replace(self.facts, touchdown=STANDING if stands else FACTS.touchdown)
        self.tick()

    @rule(refused=st.sampled_from([None, "disarm: temporarily rejected"]), age=st.sampled_from([0.02, 0.5, 2.0]))
    def answers_and_states_come_or_do_not(self, refused: str | None, age: float) -> None:
        self.facts = replace(self.facts, refused=refused, state_age_s=age)
        self.tick()

    @invariant()
    def nothing_forbidden_has_happened(self) -> None:
        assert not self.wrong

    @invariant()
    def an_abort_now_would_end_in_hold(self) -> None:
        """Against an autopilot that goes on as it was told, with the pad as it is now and a climb that succeeds."""
        asked, facts = copy.deepcopy(self.machine), self.facts
        if asked.phase in (Phase.IDLE, Phase.DONE):
            return
        ours = AutopilotMode.OFFBOARD if asked.phase in OFFBOARD_PHASES else STATUS.mode
        self.facts = replace(
            facts,
            status=replace(STATUS, mode=ours),
            state_age_s=0.02,
            operator=OperatorAction.ABORT,
            relative_position_m=(0.0, 0.0, -6.0),
        )
        if asked.phase is Phase.RETURN:
            self.facts = replace(self.facts, status=replace(STATUS, mode=AutopilotMode.RETURN))
        phases = [self.tick(asked), self.tick(asked)]
        self.facts = facts
        assert phases[-1] in (Phase.HOLD, Phase.DONE), phases


TestAnyFlight = AnyFlight.TestCase
TestAnyFlight.settings = settings(max_examples=60, stateful_step_count=30, deadline=None, derandomize=True)
