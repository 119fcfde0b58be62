"""When the pad's place is told to an autopilot that lands by itself."""

from __future__ import annotations

from companion.config import Guidance as Settings
from companion.config import load
from companion.guidance import Guidance
from companion.messages import Health, MissionView, OperatorAction, OperatorCommand, PadEstimate, Tick
from companion.pipeline import Pipeline

PERIOD_NS = 20_000_000


def estimate(t_ns: int, vision_age_s: float | None) -> PadEstimate:
    rows = ((0.0,) * 6,) * 6
    return PadEstimate(t_ns, (1.0, 2.0, -0.5), (0.0,) * 3, (0.0,) * 3, 0.0, 0.0, rows, vision_age_s, 0.1, "test")


def reports(guidance: Guidance, seconds: float, vision_age_s: float | None) -> int:
    ticks = range(0, round(seconds * 1e9), PERIOD_NS)
    return sum(guidance.report(t_ns, estimate(t_ns, vision_age_s)) is not None for t_ns in ticks)


def test_reports_come_at_the_rate_that_was_asked_for() -> None:
    assert reports(Guidance(Settings(form="px4", rate_hz=20.0)), 10.0, 0.05) in (200, 201)
    assert reports(Guidance(Settings(form="px4", rate_hz=50.0)), 10.0, 0.05) in (499, 500)


def test_a_pad_that_no_camera_sees_is_not_told() -> None:
    guidance = Guidance(Settings(form="px4"))
    assert reports(guidance, 1.0, 0.5) == reports(guidance, 1.0, None) == 0
    assert guidance.report(0, None) is None
    assert guidance.note == "guidance only: no pad in sight"


def test_the_pipeline_flies_nothing_and_says_so_to_who_wants_to_start() -> None:
    pipeline = Pipeline(load([], {"guidance.form": "px4"}))
    (answer,) = pipeline.handle(OperatorCommand(0, OperatorAction.START, "test"))
    assert isinstance(answer, Health)
    assert "precision landing" in answer.text
    (view,) = pipeline.handle(Tick(PERIOD_NS))
    assert isinstance(view, MissionView)
    assert view.note == "guidance only: no pad in sight"
