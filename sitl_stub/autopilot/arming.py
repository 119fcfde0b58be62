"""Which modes can be armed in or flown now, and the health report PX4 sends about it.

`Health` is what the checks look at; the commander refreshes it ten times a second, as PX4 does, so a lost or regained signal is
noticed up to 0.1 s late.
"""

from __future__ import annotations

from typing import NamedTuple

from sitl_stub.autopilot import events
from sitl_stub.autopilot.events import Notice
from sitl_stub.autopilot.modes import MODES, NavState

_SUMMARY_NOT_READY = bytes.fromhex("000000120180000000803a0180803a0180")
_SUMMARY_READY = bytes.fromhex("000000100080000000b03a7f80b03a7f80")
_SUMMARY_OFFBOARD = bytes.fromhex("000000000080000000b07a7f80b07a7f80")
_HEALTH_NOT_READY = bytes.fromhex("00020c0238")
_HEALTH_READY = bytes.fromhex("000a1c0238")


class Health(NamedTuple):
    """Signals and estimates the checks depend on."""

    is_ready: bool = False
    has_position: bool = False
    has_offboard: bool = False
    has_sticks: bool = False
    has_ground_station: bool = False
    is_terminated: bool = False


def can_fly(nav_state: NavState, health: Health) -> bool:
    """The mode has what it needs."""
    mode = MODES[nav_state]
    return not (
        (mode.needs_sticks and not health.has_sticks)
        or (mode.needs_offboard and not health.has_offboard)
        or (mode.needs_position and not health.has_position)
        or mode.needs_mission
    )


def can_arm(nav_state: NavState, health: Health) -> bool:
    """Arming in the mode is possible now."""
    if health.is_terminated or not health.is_ready:
        return False
    return MODES[nav_state].can_arm and can_fly(nav_state, health)


def prevents_arming(nav_state: NavState, health: Health) -> bool:
    """The mode itself (not the vehicle's health) stands against arming; such a mode is not come back to after disarming."""
    return not (MODES[nav_state].can_arm and can_fly(nav_state, health))


def report(nav_state: NavState, health: Health) -> list[Notice]:
    """PX4's health report: summary, one event for each failing check, summary."""
    notices = [Notice("commander_arming_check_summary", events.DEBUG, _summary(health))]
    if not MODES[nav_state].can_arm:
        notices.append(events.cannot_arm_in_mode())
    if health.is_terminated:
        notices.append(events.flight_termination_active())
    if not health.has_position:
        notices += [events.no_local_position(), events.no_global_position()]
    notices.append(events.no_mission())
    if not health.has_offboard:
        notices.append(events.no_offboard_signal())
    if not health.has_sticks:
        notices.append(events.no_manual_control())
    if not health.has_ground_station:
        notices.append(events.no_ground_station())
    tail = _HEALTH_READY if health.is_ready else _HEALTH_NOT_READY
    notices.append(Notice("commander_health_summary", events.DEBUG, tail))
    return notices


def _summary(health: Health) -> bytes:
    if not health.is_ready:
        return _SUMMARY_NOT_READY
    return _SUMMARY_OFFBOARD if health.has_offboard else _SUMMARY_READY
