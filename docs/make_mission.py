"""Writes the generated part of docs/mission.md from the mission's table: `python docs/make_mission.py`.

The text around the two marker lines is written by hand and kept. A test fails when file and table part.
"""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path

from companion.messages import Phase
from companion.mission.phases import IGNORED, TABLE, Event

PAGE = Path(__file__).with_name("mission.md")
BEGIN = "<!-- made by docs/make_mission.py: begin -->"
END = "<!-- made by docs/make_mission.py: end -->"


def diagram() -> str:
    """Mermaid: one arrow a pair of phases, with its events."""
    arrows: dict[tuple[Phase, Phase], list[Event]] = defaultdict(list)
    for phase, answers in TABLE.items():
        for event, target in answers.items():
            if target is not Phase.IDLE:
                arrows[phase, target].append(event)
    lines = ["```mermaid", "stateDiagram-v2", "    [*] --> idle"]
    for (phase, target), events in arrows.items():
        names = ", ".join(event.replace(":", "") for event in events)
        lines.append(f"    {phase} --> {target}: {names}")
    return "\n".join([*lines, "    done --> [*]", "```"])


def table() -> str:
    """One row a phase and event: where it leads, or why it changes nothing."""
    lines = ["| in | on | goes to | or is ignored because |", "| --- | --- | --- | --- |"]
    for phase in Phase:
        for event in Event:
            target, reason = TABLE[phase].get(event), IGNORED[phase].get(event)
            lines.append(f"| {phase} | {event} | {target or ''} | {reason or ''} |")
    return "\n".join(lines)


def generated() -> str:
    return f"{diagram()}\n\nArrows to `idle` are left out: the table has them.\n\n{table()}\n"


def page(text: str) -> str:
    """The page with its generated part made anew."""
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n\n{generated()}\n{END}{after}"


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
