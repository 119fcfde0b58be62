"""Events and texts of the commander and navigator as PX4 sends them: EVENT (410) always, STATUSTEXT for the same thing.

An event's id is 24 bits of the FNV-1a hash of its name with component 1 on top, its arguments are packed one after another. Texts end
with a TAB when an event carries the same content. Names, levels and argument layouts are the recorded ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from struct import pack

EMERGENCY, CRITICAL, ERROR, WARNING, INFO, DEBUG = 0, 2, 3, 4, 6, 8

# Who armed or disarmed, as in the arguments of commander_armed_by and commander_disarmed_by.
BY_EXTERNAL_COMMAND = 4
BY_LANDING = 6
BY_PREFLIGHT_TIMEOUT = 7
BY_FAILSAFE = 14
BY_KILL = 8

DISARM_TEXTS = {
    BY_EXTERNAL_COMMAND: "Disarmed by external command",
    BY_LANDING: "Disarmed by landing",
    BY_PREFLIGHT_TIMEOUT: "Disarmed by auto preflight disarming",
    BY_FAILSAFE: "Disarmed by failsafe",
    BY_KILL: "Disarmed by kill switch",
}


def event_id(name: str) -> int:
    """PX4's id of an event name."""
    hashed = 0x811C9DC5
    for byte in name.encode("ascii"):
        hashed = (hashed ^ byte) * 0x01000193 & 0xFFFFFFFF
    return hashed & 0xFFFFFF | 1 << 24


@dataclass(frozen=True, slots=True)
class Notice:
    """Something PX4 tells: an event (always sent) and, when `text` is not empty, a status text (ground stations only)."""

    event_name: str
    level: int
    arguments: bytes = b""
    text: str = ""
    text_level: int | None = None
    internal_level: int | None = None

    @property
    def log_levels(self) -> int:
        """EVENT.log_levels: internal level in the upper, external in the lower four bits."""
        internal = self.level if self.internal_level is None else self.internal_level
        return internal << 4 | self.level


def armed() -> Notice:
    return Notice("commander_armed_by", INFO, pack("<B", BY_EXTERNAL_COMMAND), "Armed by external command\t")


def disarmed(reason: int) -> Notice:
    return Notice("commander_disarmed_by", INFO, pack("<B", reason), DISARM_TEXTS[reason] + "\t")


def arm_denied() -> Notice:
    text = "Arming denied: Resolve system health failures first\t"
    return Notice("commander_arm_denied_resolve_failures", CRITICAL, b"", text, CRITICAL, INFO)


def disarm_denied() -> Notice:
    text = "Disarming denied: not landed\t"
    return Notice("commander_disarm_denied_not_landed", CRITICAL, b"", text, CRITICAL, INFO)


def unsupported_arm_parameter(value: float) -> Notice:
    text = f"Unsupported ARM_DISARM param: {value:.3f}\t"
    return Notice("commander_unsupported_arm_disarm_param", ERROR, pack("<f", value), text, CRITICAL)


def unsupported_auto_mode() -> Notice:
    return Notice("commander_unsupported_auto_mode", ERROR, b"", "Unsupported auto mode\t", CRITICAL)


def failsafe(custom_mode: int, action: int) -> Notice:
    arguments = pack("<IB", custom_mode, action)
    return Notice("commander_failsafe_enter_generic", CRITICAL, arguments, "Failsafe activated\t", CRITICAL, WARNING)


def failsafe_disengaged(custom_mode: int, action: int) -> Notice:
    arguments = pack("<IB", custom_mode, action)
    name = "commander_failsafe_enter_autopilot_disengaged"
    return Notice(name, CRITICAL, arguments, "Failsafe activated\t", CRITICAL, WARNING)


def failsafe_for_cause(custom_mode: int, action: int, cause: int) -> Notice:
    arguments = pack("<IBB", custom_mode, action, cause)
    return Notice("commander_failsafe_enter", CRITICAL, arguments, "Failsafe activated\t", CRITICAL, WARNING)


def failsafe_hold(custom_mode: int, action: int, delay_s: int, cause: int) -> Notice:
    arguments = pack("<IBHB", custom_mode, action, delay_s, cause)
    text = f"Failsafe activated, triggering in {delay_s} seconds\t"
    return Notice("commander_failsafe_enter_hold", CRITICAL, arguments, text, CRITICAL, WARNING)


def takeoff_detected() -> Notice:
    return Notice("commander_takeoff_detected", INFO, b"", "Takeoff detected\t")


def landing_detected() -> Notice:
    return Notice("commander_landing_detected", INFO, b"", "Landing detected\t")


def landing_at_current_position() -> Notice:
    return Notice("commander_landing_current_pos", INFO, b"", "Landing at current position\t")


def precision_landing() -> Notice:
    return Notice("commander_landing_prec_land", INFO, b"", "Precision landing\t")


def default_takeoff_altitude(altitude_m: float) -> Notice:
    text = f"Using default takeoff altitude: {altitude_m:.1f} m\t"
    return Notice("navigator_takeoff_default_alt", INFO, pack("<f", altitude_m), text)


def already_higher() -> Notice:
    return Notice("navigator_takeoff_already_higher", ERROR, b"", "Already higher than takeoff altitude\t", CRITICAL)


def return_at(altitude_amsl_m: float, above_destination_m: float) -> Notice:
    altitude, above = round(altitude_amsl_m), round(above_destination_m)
    text = f"RTL: start return at {altitude} m ({above} m above destination)\t"
    return Notice("vrtl_return_at", INFO, pack("<iI", altitude, max(above, 0))[:5], text)


def land_at_destination() -> Notice:
    return Notice("rtl_land_at_destination", INFO, b"", "RTL: land at destination\t")


def ground_station_lost() -> Notice:
    return Notice("commander_gcs_lost", WARNING, b"", "", None, INFO)


def unsupported_frame(frame: int) -> Notice:
    text = f"SET_POSITION_TARGET_LOCAL_NED coordinate frame {frame} unsupported\t"
    return Notice("mavlink_rcv_sp_target_unsup_coord", ERROR, pack("<B", frame), text, CRITICAL)


def invalid_setpoint() -> Notice:
    return Notice("mavlink_rcv_sp_target_invalid", ERROR, b"", "SET_POSITION_TARGET_LOCAL_NED invalid\t", CRITICAL)


def flight_termination_active() -> Notice:
    text = "Preflight Fail: Flight termination active"
    return Notice("check_system_flight_term_active", CRITICAL, pack("<IB", 0xFFFFFFFF, 20), text, CRITICAL)


def no_offboard_signal() -> Notice:
    return Notice("check_modes_offboard_signal", ERROR, pack("<IB", 0x4000, 20))


def no_mission() -> Notice:
    return Notice("check_modes_mission", INFO, pack("<IB", 0x8, 20))


def no_manual_control() -> Notice:
    return Notice("check_modes_manual_control", WARNING, pack("<IB", 0xFFFFFFFF, 7))


def no_ground_station() -> Notice:
    return Notice("check_rc_dl_no_dllink", INFO, pack("<IB", 0xFFFFFFFF, 12))


def no_local_position() -> Notice:
    return Notice("check_modes_local_pos", ERROR, pack("<IB", 0x7E007C, 17))


def no_global_position() -> Notice:
    return Notice("check_modes_global_pos", ERROR, pack("<IB", 0x38, 24))


def cannot_arm_in_mode() -> Notice:
    return Notice("check_modes_cannot_takeoff", INFO, pack("<IB", 0x3C3020, 20))


def pilot_took_over() -> Notice:
    return Notice("commander_rc_override", INFO, b"", "Pilot took over using sticks\t")


def manual_control_lost() -> Notice:
    return Notice("commander_rc_lost", CRITICAL, b"", "Manual control lost\t", CRITICAL, INFO)


def low_battery(level_name: str) -> Notice:
    texts = {
        "low": "Low battery level\t",
        "critical": "Critical battery level\t",
        "emergency": "Emergency battery level\t",
    }
    level = WARNING if level_name == "low" else CRITICAL
    return Notice(f"check_battery_{level_name}", level, b"", texts[level_name], level)
