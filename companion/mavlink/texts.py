"""Status texts and events of the autopilot as lines for people.

PX4 sends STATUSTEXT only on links that hear a ground station's heartbeat; a companion gets EVENT instead, whose texts
live in metadata on the vehicle. Their ids are hashes of names, so the names that matter to a landing are listed here and
hashed at import; others are shown by number. Long texts come in chunks of 50 bytes and end with a tab.
"""

from __future__ import annotations

from companion.mavlink.dialect import Event, Statustext
from companion.messages import AutopilotText

LONGEST_TEXT_CHUNKS = 8
PENDING_TEXTS = 8
LEAST_SEVERITY = 7
"""MAVLink's DEBUG; above are the log levels of PX4's protocol and of disabled events."""
REPEAT_NS = 60_000_000_000
REMEMBERED_EVENTS = 64

_HAPPENINGS = {
    "commander_armed_by": "Armed",
    "commander_disarmed_by": "Disarmed",
    "commander_takeoff_detected": "Takeoff detected",
    "commander_landing_detected": "Landing detected",
    "commander_landing_current_pos": "Landing at current position",
    "commander_landing_prec_land": "Landing using precision landing",
    "commander_arm_denied_resolve_failures": "Arming denied: resolve system health failures first",
    "commander_disarm_denied_not_landed": "Disarming denied: not landed",
    "commander_unsupported_auto_mode": "Unsupported auto mode",
    "commander_unsupported_arm_disarm_param": "Unsupported arm or disarm parameter",
    "commander_failsafe_enter": "Failsafe activated",
    "commander_failsafe_enter_generic": "Failsafe activated",
    "commander_failsafe_enter_hold": "Failsafe activated: hold first",
    "commander_failsafe_enter_autopilot_disengaged": "Failsafe activated: autopilot disengaged",
    "commander_gcs_lost": "Connection to ground control station lost",
    "commander_rc_override": "Pilot took over using sticks",
    "commander_rc_lost": "Manual control lost",
    "navigator_takeoff_default_alt": "Using the default takeoff altitude",
    "navigator_takeoff_already_higher": "Already higher than takeoff altitude",
    "mavlink_rcv_sp_target_unsup_coord": "SET_POSITION_TARGET_LOCAL_NED: coordinate frame unsupported",
    "mavlink_rcv_sp_target_invalid": "SET_POSITION_TARGET_LOCAL_NED invalid",
    "rtl_land_at_destination": "Return: land at destination",
    "vrtl_return_at": "Return: on the way",
    "logger_open_file_time": "Logging",
    "check_battery_low": "Low battery",
    "check_battery_critical": "Critical battery",
    "check_battery_emergency": "Emergency battery",
    "check_system_flight_term_active": "Flight termination active",
}
_FINDINGS = {
    "check_estimator_gnss_fusion_stopped": "GNSS data fusion stopped",
    "check_modes_cannot_takeoff": "Mode not suitable for arming",
    "check_modes_global_pos": "No valid global position estimate",
    "check_modes_local_pos": "No valid position estimate",
    "check_modes_manual_control": "No manual control input",
    "check_modes_mission": "No valid mission available",
    "check_modes_offboard_signal": "No offboard signal",
    "check_rc_dl_no_dllink": "No connection to the ground control station",
}
"""Findings of the arming checks: PX4 repeats all of them whenever one changes."""
_NOT_FOR_PEOPLE = ("commander_arming_check_summary", "commander_health_summary")


def event_id(name: str) -> int:
    """PX4's number for an event name: component 1 and the low 24 bits of the 32-bit FNV-1a hash."""
    value = 0x811C9DC5
    for byte in name.encode():
        value = (value ^ byte) * 0x01000193 & 0xFFFFFFFF
    return 1 << 24 | value & 0xFFFFFF


_TEXTS = {event_id(name): text for name, text in (_HAPPENINGS | _FINDINGS).items()}
_ALWAYS_TOLD = frozenset(map(event_id, _HAPPENINGS))
_NEVER_TOLD = frozenset(map(event_id, _NOT_FOR_PEOPLE))


class TextAssembler:
    """Chunks of STATUSTEXT in, whole texts out. Incomplete ones are dropped when newer ones need the place."""

    def __init__(self) -> None:
        self._chunks: dict[int, dict[int, bytes]] = {}

    def statustext(self, message: Statustext, now_ns: int) -> AutopilotText | None:
        """The text when this message completes it."""
        if message.id == 0:
            return _text(message.severity, message.text, now_ns)
        chunks = self._chunks.setdefault(message.id, {})
        if message.chunk_seq < LONGEST_TEXT_CHUNKS:
            chunks[message.chunk_seq] = message.text
        last = max(chunks, default=-1)
        complete = last >= 0 and len(chunks) == last + 1 and b"\0" in chunks[last]
        if not complete:
            self._forget_oldest()
            return None
        del self._chunks[message.id]
        return _text(message.severity, b"".join(chunks[i] for i in range(last + 1)), now_ns)

    def _forget_oldest(self) -> None:
        while len(self._chunks) > PENDING_TEXTS:
            del self._chunks[next(iter(self._chunks))]


class EventReader:
    """Events in, lines out. What happened is always told; a finding, or an unknown event, once in a while."""

    def __init__(self) -> None:
        self._told_ns: dict[int, int] = {}

    def event(self, message: Event, now_ns: int) -> AutopilotText | None:
        severity = message.log_levels & 0x0F
        if severity > LEAST_SEVERITY or message.id in _NEVER_TOLD or self._told_lately(message.id, now_ns):
            return None
        return AutopilotText(now_ns, severity, _TEXTS.get(message.id, f"event {message.id:#010x}"))

    def _told_lately(self, number: int, now_ns: int) -> bool:
        if number in _ALWAYS_TOLD:
            return False
        before_ns = self._told_ns.get(number)
        if before_ns is not None and now_ns - before_ns < REPEAT_NS:
            return True
        self._told_ns[number] = now_ns
        while len(self._told_ns) > REMEMBERED_EVENTS:
            del self._told_ns[next(iter(self._told_ns))]
        return False


def _text(severity: int, raw: bytes, now_ns: int) -> AutopilotText:
    return AutopilotText(now_ns, severity, raw.split(b"\0")[0].decode("utf-8", "replace").rstrip("\t \n"))
