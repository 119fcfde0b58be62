"""What to look at first in a flight: each rule looks at one thing and says in a sentence what is unusual about it.

Limits are those of the tests and of docs/doctor.md; a rule that has nothing to say gives None. Worst first.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from companion.messages import Phase
from companion.telemetry.flight_record import FlightRecord

NIS_95 = {1: 3.84, 2: 5.99, 3: 7.81}
"""Chi-square, 95 %, by degrees of freedom."""
SLOW_FRAME_S, BLIND_S = 0.15, 1.0
TOUCHDOWN_LIMITS = (
    ("touchdown_error_m", 0.5, "m from the centre"),
    ("touchdown_relative_speed_vertical_m_s", 1.5, "m/s down against the deck"),
    ("touchdown_relative_speed_horizontal_m_s", 1.0, "m/s across the deck"),
)
CLOSE = (Phase.DESCEND, Phase.COMMIT)


@dataclass(frozen=True, slots=True)
class Look:
    """`weight` orders: 3 the flight failed by it, 2 it may have, 1 worth a look."""

    weight: int
    text: str


def look_first(record: FlightRecord, figures: Mapping[str, Any]) -> list[Look]:
    """All that stands out, worst first; empty for a flight without anything unusual."""
    found = [look for rule in RULES for look in [rule(record, figures)] if look is not None]
    return sorted(found, key=lambda look: -look.weight)


def _in_air(record: FlightRecord, figures: Mapping[str, Any]) -> Look | None:
    if not figures.get("forced_disarm_in_air"):
        return None
    return Look(3, "The motors were stopped while the vehicle did not stand. Look at the evidence among the requests.")


def _ending(record: FlightRecord, figures: Mapping[str, Any]) -> Look | None:
    outcome = figures.get("outcome")
    if outcome in (None, "landed", "guided", "replayed"):
        return None
    reason = f" The last phase was {record.phases[-1][1]}: {record.phases[-1][2]}." if record.phases else ""
    return Look(3, f"It did not land: {outcome}.{reason}")


def _failed_health(record: FlightRecord, figures: Mapping[str, Any]) -> Look | None:
    failed = [(t_s, health) for t_s, health in record.health if health.level >= 2]
    if not failed:
        return None
    t_s, health = failed[0]
    more = f" and {len(failed) - 1} more" if len(failed) > 1 else ""
    return Look(2, f"{health.subject} failed at {t_s:.1f} s: {health.text}{more}.")


def _go_arounds(record: FlightRecord, figures: Mapping[str, Any]) -> Look | None:
    reasons = [reason for _, phase, reason in record.phases if phase is Phase.GO_AROUND]
    return Look(2, f"{len(reasons)} go-arounds; the first because of {reasons[0]}.") if reasons else None


def _blind(record: FlightRecord, figures: Mapping[str, Any]) -> Look | None:
    """The longest time without sight of the pad while descending."""
    worst, where = 0.0, ""
    for begin_s, end_s, phase in phase_spans(record):
        if phase in CLOSE:
            sights = [begin_s, *(t_s for t_s in record.seen_s if begin_s <= t_s <= end_s), end_s]
            gap_s = max(later - earlier for earlier, later in pairwise(sights))
            if gap_s > worst:
                worst, where = gap_s, str(phase)
    return Look(2, f"The pad was out of sight for {worst:.1f} s in {where}.") if worst > BLIND_S else None


def _setpoint_gaps(record: FlightRecord, figures: Mapping[str, Any]) -> Look | None:
    gaps_s = record.setpoint_pauses_s
    if not gaps_s:
        return None
    return Look(2, f"{len(gaps_s)} pauses of the setpoints, the longest {1e3 * max(gaps_s):.0f} ms (20 ms is usual).")


def _touchdown(record: FlightRecord, figures: Mapping[str, Any]) -> Look | None:
    over = [
        f"{value:.2f} {unit}" for key, most, unit in TOUCHDOWN_LIMITS if (value := figures.get(key)) and value > most
    ]
    return Look(2, f"Touchdown at {', '.join(over)}.") if over else None


def _innovations(record: FlightRecord, figures: Mapping[str, Any]) -> Look | None:
    """A filter that knows itself has one in twenty above its 95 % bound."""
    shares = {
        source: sum(value > NIS_95[components] for value in series.values) / len(series.values)
        for (source, components), series in record.nis.items()
        if len(series.values) >= 20 and components in NIS_95
    }
    loud = {source: share for source, share in shares.items() if share > 0.15}
    if not loud:
        return None
    said = ", ".join(f"{source} {100 * share:.0f} %" for source, share in loud.items())
    return Look(1, f"Innovations above their 95 % bound: {said} (5 % are to be expected).")


def _rejections(record: FlightRecord, figures: Mapping[str, Any]) -> Look | None:
    judged = sum(len(series.values) for series in record.nis.values())
    share = len(record.rejected_s) / judged if judged else 0.0
    return Look(1, f"{100 * share:.0f} % of the measurements were rejected.") if share > 0.05 else None


def _late_frames(record: FlightRecord, figures: Mapping[str, Any]) -> Look | None:
    delays = record.delays_s.get("frames")
    if delays is None:
        return None
    late_s = sorted(delays.values)[int(0.95 * (len(delays.values) - 1))]
    return Look(1, f"Frames come {1e3 * late_s:.0f} ms late (p95).") if late_s > SLOW_FRAME_S else None


def _tracking(record: FlightRecord, figures: Mapping[str, Any]) -> Look | None:
    """How far flown velocities are from the asked ones, horizontally. In a replay the vehicle obeyed somebody else."""
    if figures.get("outcome") == "replayed":
        return None
    errors = velocity_errors(record)
    if len(errors) < 50:
        return None
    rms = math.sqrt(math.fsum(error * error for error in errors) / len(errors))
    return Look(1, f"Flown and asked velocity differ by {rms:.1f} m/s (rms, horizontally).") if rms > 1.0 else None


def _warnings(record: FlightRecord, figures: Mapping[str, Any]) -> Look | None:
    warned = [health for _, health in record.health if health.level == 1]
    if not warned:
        return None
    return Look(1, f"{len(warned)} warnings; the first: {warned[0].subject}: {warned[0].text}.")


Rule = Callable[[FlightRecord, Mapping[str, Any]], Look | None]
RULES: Sequence[Rule] = (
    _in_air,
    _ending,
    _failed_health,
    _go_arounds,
    _blind,
    _setpoint_gaps,
    _touchdown,
    _innovations,
    _rejections,
    _late_frames,
    _tracking,
    _warnings,
)


def phase_spans(record: FlightRecord) -> list[tuple[float, float, Phase]]:
    """(begin, end, phase), s."""
    ends = [*(start for start, _, _ in record.phases[1:]), record.end_s]
    return [(start, end, phase) for (start, phase, _), end in zip(record.phases, ends, strict=False)]


def velocity_errors(record: FlightRecord) -> list[float]:
    """Horizontal length of flown minus asked velocity at each setpoint, m/s."""
    errors, index, flown = [], 0, record.vehicle_velocity
    for t_s, asked in zip(record.setpoint.t_s, record.setpoint.values, strict=True):
        while index + 1 < len(flown.t_s) and flown.t_s[index + 1] <= t_s:
            index += 1
        if flown.t_s:
            errors.append(math.hypot(flown.values[index][0] - asked[0], flown.values[index][1] - asked[1]))
    return errors
