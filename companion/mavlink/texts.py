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
INTERNAL_DISABLED = 15

_EVENT_TEXTS = {
    "commander_armed_by": "Armed",
    "commander_disarmed_by": "Disarmed",
    "commander_takeoff_detected": "Takeoff detected",
    "commander_landing_detected": "Landing detected",
    "commander_arm_denied_resolve_failures": "Arming denied: resolve system health failures first",
    "commander_disarm_denied_not_landed": "Disarming denied: not landed",
    "commander_unsupported_auto_mode": "Unsupported auto mode",
    "commander_unsupported_arm_disarm_param": "Unsupported arm or disarm parameter",
    "commander_unsupported_modes": "Mode not available",
    "commander_enter_failsafe": "Failsafe activated",
    "commander_failsafe_enter_generic": "Failsafe activated",
    "commander_failsafe_enter_autopilot_disengaged": "Failsafe activated: autopilot disengaged",
    "navigator_takeoff_default_alt": "Using the default takeoff altitude",
    "mavlink_rcv_sp_target_unsup_coord": "SET_POSITION_TARGET_LOCAL_NED: coordinate frame unsupported",
    "mavlink_rcv_sp_target_invalid": "SET_POSITION_TARGET_LOCAL_NED invalid",
    "rtl_land_at_destination": "Return: land at destination",
    "check_rc_dl_no_dllink": "No connection to the ground control station",
}


def event_id(name: str) -> int:
    """PX4's number for an event name: component 1 and the low 24 bits of the 32-bit FNV-1a hash."""
    value = 0x811C9DC5
    for byte in name.encode():
        value = (value ^ byte) * 0x01000193 & 0xFFFFFFFF
    return 1 << 24 | value & 0xFFFFFF


_TEXT_BY_ID = {event_id(name): text for name, text in _EVENT_TEXTS.items()}


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


def event_text(message: Event, now_ns: int) -> AutopilotText | None:
    """The event as a line; None for those that are marked as not for people."""
    severity = message.log_levels & 0x0F
    if severity >= INTERNAL_DISABLED or severity > 7:
        return None
    text = _TEXT_BY_ID.get(message.id, f"event {message.id:#010x}")
    return AutopilotText(now_ns, severity, text)


def _text(severity: int, raw: bytes, now_ns: int) -> AutopilotText:
    return AutopilotText(now_ns, severity, raw.split(b"\0")[0].decode("utf-8", "replace").rstrip("\t \n"))
