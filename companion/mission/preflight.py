"""What must hold before START is obeyed. Each check gives its reason in plain words, or None.

`blocking` refuse the START (it waits `mission.start_wait_s` for them to clear); `warnings` are told and flown with.
The clocks have converged where the vehicle's state is about as old as the link is quick: the session gives no state before.
"""

from __future__ import annotations

from collections.abc import Callable

from companion.config import Safety
from companion.messages import LandedState
from companion.mission.facts import Facts

MAX_STATE_AGE_S = 0.25
"""Older vehicle states are not flown on: unknown means stop sending."""

MAX_MODE_AGE_S = 0.6
"""An older mode report says nothing about who flies now."""

MAX_FRAME_AGE_S = 1.0
FUTURE_S = 0.05
"""A state from further in the future than this shows clocks that do not agree."""

Check = Callable[[Facts, Safety], str | None]


def _link(facts: Facts, safety: Safety) -> str | None:
    connected = facts.status is not None and facts.status.connected
    return None if connected else "no link to the autopilot"


def _mode(facts: Facts, safety: Safety) -> str | None:
    fresh = facts.mode_age_s is not None and facts.mode_age_s <= MAX_MODE_AGE_S
    return None if fresh else "the autopilot's mode is not known"


def _clock(facts: Facts, safety: Safety) -> str | None:
    agreed = facts.state_age_s is None or facts.state_age_s >= -FUTURE_S
    return None if agreed else "the clocks of autopilot and companion do not agree yet"


def _state(facts: Facts, safety: Safety) -> str | None:
    if facts.state_age_s is None:
        return "no position estimate from the autopilot"
    if facts.state_age_s > MAX_STATE_AGE_S:
        return f"the autopilot's position estimate is {facts.state_age_s:.1f} s old"
    return None


def _camera(facts: Facts, safety: Safety) -> str | None:
    if facts.frame_age_s is None:
        return "no camera frames"
    if facts.frame_age_s > MAX_FRAME_AGE_S:
        return f"no camera frame for {facts.frame_age_s:.1f} s"
    return None


def _battery(facts: Facts, safety: Safety) -> str | None:
    battery = None if facts.status is None else facts.status.battery_fraction
    if battery is None or battery >= safety.min_battery:
        return None
    return f"battery {battery:.0%}, reserve {safety.min_battery:.0%}"


def _failsafe(facts: Facts, safety: Safety) -> str | None:
    if facts.status is None or not facts.status.failsafe:
        return None
    return f"the autopilot is in a failsafe (mode {facts.status.mode}): choose Hold first"


def _ready_to_arm(facts: Facts, safety: Safety) -> str | None:
    if facts.status is None or is_flying(facts):
        return None
    return None if facts.status.ready_to_arm else "the autopilot is not ready to arm"


def _fence(facts: Facts, safety: Safety) -> str | None:
    away = facts.distance_from_home_m
    if away is not None and away > safety.geofence_radius_m:
        return f"{away:.0f} m from home, fence {safety.geofence_radius_m:.0f} m"
    return None if facts.no_fly_zone is None else f"inside the no-fly zone {facts.no_fly_zone}"


def _zones(facts: Facts, safety: Safety) -> str | None:
    names = ", ".join(facts.unplaced_zones)
    return f"home is not known, and with it the place of {names}" if names else None


def is_flying(facts: Facts) -> bool:
    """Armed and not known to stand."""
    status = facts.status
    return status is not None and status.armed and status.landed_state is not LandedState.ON_GROUND


CHECKS: dict[str, Check] = {
    "link": _link,
    "mode": _mode,
    "clock": _clock,
    "position": _state,
    "camera": _camera,
    "battery": _battery,
    "failsafe": _failsafe,
    "ready to arm": _ready_to_arm,
    "fence": _fence,
    "zones": _zones,
}


def blocking(facts: Facts, safety: Safety) -> tuple[str, ...]:
    """All reasons against a START now."""
    return tuple(reason for check in CHECKS.values() if (reason := check(facts, safety)) is not None)


def warnings(facts: Facts) -> tuple[str, ...]:
    """What a person should know, and may accept."""
    status = facts.status
    if status is None:
        return ()
    found = []
    if status.battery_fraction is None:
        found.append("the battery's charge is not known")
    if status.home_position_ned_m is None:
        found.append("home is not known")
    return tuple(found)
