"""PX4 parameters that would break this mission, against the configuration and the pad's speed."""

from __future__ import annotations

import math
from collections.abc import Callable

from companion.doctor.evidence import Evidence, Finding, Level, judged
from companion.mavlink.parameters import Value

GRAVITY_M_S2 = 9.80665
OBL_ACTIONS = {
    0: "Position",
    1: "Altitude",
    2: "Stabilized",
    3: "Return",
    4: "Land",
    5: "Hold",
    6: "Terminate",
    7: "Disarm",
}
"""COM_OBL_RC_ACT."""


def check_parameters(evidence: Evidence) -> list[Finding]:
    """One finding for each parameter that matters and that the vehicle has."""
    findings = []
    for name, rule in RULES.items():
        value = evidence.parameters.get(name)
        if value is not None:
            findings.append(rule(value, evidence))
    unknown = sorted(set(RULES) - set(evidence.parameters))
    if unknown:
        text = f"not answered: {', '.join(unknown)}"
        findings.append(Finding("parameters", Level.WARN, text, "another version of PX4? Check these by hand"))
    return findings


def _judged(name: str, value: Value, why: str, remedy: str, *, fails: bool = False, warns: bool = False) -> Finding:
    return judged("parameters", f"{name} = {value:g}: {why}", remedy, fails=fails, warns=warns)


def _speed(value: Value, evidence: Evidence) -> Finding:
    pad, margin = evidence.pad_speed_m_s, 2.0
    why = f"the pad moves at {pad:g} m/s"
    return _judged(
        "MPC_XY_VEL_MAX", value, why, f"at least {pad + margin:g}", fails=value < pad + 0.5, warns=value < pad + margin
    )


def _tilt(value: Value, evidence: Evidence) -> Finding:
    needed_deg = math.degrees(math.atan(evidence.config.control.max_acceleration_m_s2 / GRAVITY_M_S2))
    why = f"{needed_deg:.0f} deg for the configured acceleration, more against wind"
    return _judged(
        "MPC_TILTMAX_AIR", value, why, f"at least {needed_deg + 5:.0f}", fails=value < 20.0, warns=value < needed_deg
    )


def _down(value: Value, evidence: Evidence) -> Finding:
    needed = max(evidence.config.mission.descent_speed_m_s, evidence.config.mission.press_speed_m_s)
    return _judged(
        "MPC_Z_VEL_MAX_DN", value, f"descends at {needed:g} m/s", f"at least {needed:g}", warns=value < needed
    )


def _up(value: Value, evidence: Evidence) -> Finding:
    return _judged(
        "MPC_Z_VEL_MAX_UP", value, "a go-around climbs", "at least 1.5", fails=value < 0.5, warns=value < 1.5
    )


def _loss(value: Value, evidence: Evidence) -> Finding:
    why = "silence after which the autopilot's own failsafe acts"
    return _judged(
        "COM_OF_LOSS_T", value, why, "0.5 to 1 s", fails=value < 0.2 or value > 5.0, warns=not 0.4 <= value <= 1.5
    )


def _loss_action(value: Value, evidence: Evidence) -> Finding:
    action = OBL_ACTIONS.get(int(value), "unknown")
    why = f"{action} when setpoints stop"
    remedy = "5 (Hold) or 3 (Return): the others need a pilot at once or come down beside the pad"
    return _judged("COM_OBL_RC_ACT", value, why, remedy, fails=int(value) in (6, 7), warns=int(value) not in (3, 5))


def _disarm(value: Value, evidence: Evidence) -> Finding:
    why = "seconds from landed to disarmed by itself"
    return _judged("COM_DISARM_LAND", value, why, "1 to 3 s, or -1", warns=0.0 < value < 0.5 or value > 10.0)


def _landed_speed(value: Value, evidence: Evidence) -> Finding:
    is_faster = evidence.pad_speed_m_s > value
    how = evidence.config.mission.disarm
    why = (
        "on a faster deck PX4 does not notice that it has landed"
        if is_faster
        else "PX4 notices the landing on this deck"
    )
    if is_faster and how != "never":
        why += "; Companion stops the motors on its own evidence"
    remedy = '[mission] disarm = "auto", or a larger value'
    return _judged("LNDMC_XY_VEL_MAX", value, why, remedy, fails=is_faster and how == "never")


def _landed_climb(value: Value, evidence: Evidence) -> Finding:
    sinks = evidence.config.mission.final_descent_speed_m_s
    why = f"the final descent is at {sinks:g} m/s"
    return _judged(
        "LNDMC_Z_VEL_MAX", value, why, f"below {sinks:g}: a slow descent must not look landed", warns=value >= sinks
    )


RULES: dict[str, Callable[[Value, Evidence], Finding]] = {
    "MPC_XY_VEL_MAX": _speed,
    "MPC_TILTMAX_AIR": _tilt,
    "MPC_Z_VEL_MAX_DN": _down,
    "MPC_Z_VEL_MAX_UP": _up,
    "COM_OF_LOSS_T": _loss,
    "COM_OBL_RC_ACT": _loss_action,
    "COM_DISARM_LAND": _disarm,
    "LNDMC_XY_VEL_MAX": _landed_speed,
    "LNDMC_Z_VEL_MAX": _landed_climb,
}
