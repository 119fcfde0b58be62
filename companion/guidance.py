"""Guidance only: Companion looks and tells, the autopilot's own precision landing flies. Called by the pipeline at each tick.

A report goes out while a camera has seen the pad lately: a place that is only predicted, or that only the pad's own beacon
tells, would let the autopilot descend without anybody looking. Without reports it searches or lands by its own rules.
"""

from __future__ import annotations

from companion import config
from companion.messages import Health, OperatorCommand, PadEstimate, PadReport

NO_START = "guidance only: nothing to start; switch the autopilot to its precision landing"


class Guidance:
    """State: when the next report is due."""

    def __init__(self, guidance: config.Guidance) -> None:
        self._period_ns = round(1e9 / guidance.rate_hz)
        self._age_s = guidance.sight_age_s
        self._due_ns = 0
        self._form = guidance.form
        self.note = ""

    def report(self, t_ns: int, pad: PadEstimate | None) -> PadReport | None:
        """What to tell now, if anything; `note` says in words."""
        if pad is None or pad.vision_age_s is None or pad.vision_age_s > self._age_s:
            self.note = "guidance only: no pad in sight"
            return None
        self.note = f"guidance only: telling where the pad is ({self._form})"
        if t_ns < self._due_ns:
            return None
        self._due_ns = max(self._due_ns + self._period_ns, t_ns)
        return PadReport(t_ns, pad.position_ned_m)

    def answer(self, command: OperatorCommand) -> Health:
        """Whatever a person asks for: there is nothing of ours to start or to stop."""
        return Health(command.t_ns, "mission", 1, NO_START)
