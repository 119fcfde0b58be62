"""The result of one flight for scripts and for people: the dictionary of `--json` and `run.json`, and one line of text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from companion.campaign.runner import OUTCOMES, FlightResult

WALL_KEYS = ("wall_s", "setup_s", "real_time_factor")
"""The only entries that differ between two runs of the same seed."""


def summary(result: FlightResult, *, scenario: str, seed: int, wall_s: float) -> dict[str, Any]:
    """All figures of one simulated flight. Lengths in m, speeds in m/s, times in s; None where it never happened."""
    verdict = result.verdict
    return {
        "outcome": result.outcome,
        "seed": seed,
        "scenario": scenario,
        "simulated": True,
        "touchdown_error_m": _rounded(verdict.touchdown_error_m),
        "touchdown_error_along_m": _rounded(verdict.touchdown_error_along_m),
        "touchdown_error_across_m": _rounded(verdict.touchdown_error_across_m),
        "touchdown_tilt_deg": _rounded(verdict.touchdown_tilt_deg),
        "touchdown_relative_speed_horizontal_m_s": _rounded(verdict.touchdown_relative_speed_horizontal_m_s),
        "touchdown_relative_speed_vertical_m_s": _rounded(verdict.touchdown_relative_speed_vertical_m_s),
        "time_to_touchdown_s": _between(result.start_s, result.touchdown_s),
        "first_sight_to_touchdown_s": _between(result.first_sight_s, result.touchdown_s),
        "simulated_s": round(result.simulated_s, 3),
        "wall_s": round(wall_s, 3),
        "real_time_factor": round(result.simulated_s / wall_s, 2) if wall_s > 0.0 else None,
        "forced_disarm_in_air": verdict.forced_disarm_in_air,
        "forced_disarms": result.forced_disarms,
        "lowest_in_no_land_zone_m": _rounded(result.lowest_in_no_land_zone_m),
        "go_arounds": result.go_arounds,
        "frames": result.frames,
        "frames_with_pad": result.frames_with_pad,
        "final_phase": str(result.phase),
    }


def summary_line(figures: dict[str, Any]) -> str:
    """One line for people."""
    meaning = OUTCOMES.get(figures["outcome"], "")
    error = figures["touchdown_error_m"]
    if error is None:
        return f"{figures['outcome']}: {meaning} ({figures['simulated_s']:.1f} s simulated, seed {figures['seed']})"
    return (
        f"{figures['outcome']}: {error:.2f} m from the centre, "
        f"{figures['touchdown_relative_speed_horizontal_m_s']:.2f} m/s across and "
        f"{figures['touchdown_relative_speed_vertical_m_s']:.2f} m/s down against the deck, "
        f"{figures['time_to_touchdown_s'] or 0.0:.1f} s after the start "
        f"(simulated, seed {figures['seed']}, {figures['real_time_factor'] or 0.0:.1f} x real time)"
    )


def repeatable(figures: Mapping[str, Any]) -> dict[str, Any]:
    """The figures without those that depend on the machine: equal for two runs of the same seed."""
    return {key: value for key, value in figures.items() if key not in WALL_KEYS}


def _between(begin_s: float | None, end_s: float | None) -> float | None:
    return None if begin_s is None or end_s is None else round(end_s - begin_s, 3)


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 4)
