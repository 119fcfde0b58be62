"""Is there enough in the battery to start?"""

from __future__ import annotations

from companion.doctor.evidence import Evidence, Finding, Level, judged

RESERVE = 0.2
"""Above the configured least: a flight must not begin at its end."""


def check_battery(evidence: Evidence) -> list[Finding]:
    least = evidence.config.safety.min_battery
    fraction = None if evidence.status is None else evidence.status.battery_fraction
    if fraction is None:
        remedy = "calibrate the power module (BAT1_*); without it the limit of [safety] min_battery cannot act"
        return [Finding("battery", Level.WARN, "the autopilot does not know its charge", remedy)]
    text = f"{100 * fraction:.0f} %, the flight ends at {100 * least:.0f} %"
    return [judged("battery", text, "charge it", fails=fraction <= least, warns=fraction < least + RESERVE)]
