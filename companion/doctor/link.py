"""Is the autopilot heard, and does it send what is needed often enough?"""

from __future__ import annotations

from companion.doctor.evidence import Evidence, Finding, Level, judged

ENOUGH, LEAST = 0.8, 0.4
"""Shares of the wanted rate."""
SAME_KEY = "the same key in the autopilot, in the beacon and in [link] signing_key_file"


def check_link(evidence: Evidence) -> list[Finding]:
    link = evidence.config.link
    if evidence.link_error:
        return [Finding("link", Level.FAIL, evidence.link_error, "another program on this port? [link] url right?")]
    if not evidence.was_heard and evidence.frames_refused:
        text = f"all {evidence.frames_refused} frames refused: not signed with the key in {link.signing_key_file}"
        return [Finding("link", Level.FAIL, text, SAME_KEY)]
    if not evidence.was_heard:
        text = f"nothing heard from system {link.target_system} on {link.url} in {evidence.duration_s:.0f} s"
        remedy = "is the autopilot on, the cable in, the baud rate right, [link] target_system its MAV_SYS_ID?"
        return [Finding("link", Level.FAIL, text, remedy)]
    return [*_rates(evidence), *_damage(evidence)]


def _rates(evidence: Evidence) -> list[Finding]:
    link = evidence.config.link
    state = _rate(
        "vehicle state", evidence.rate_hz("VehicleState"), link.state_rate_hz, "a faster link (921600 baud), UDP"
    )
    ranges = evidence.rate_hz("RangeMeasurement")
    text = f"range sensor {ranges:.0f} Hz" if ranges else "no range sensor"
    remedy = "touchdown is surer with one that looks down (DISTANCE_SENSOR)"
    beacon = evidence.rate_hz("PadBeacon")
    heard = f"pad beacon {beacon:.1f} Hz" if beacon else "no pad beacon"
    search = "without one the pad must be found by searching; [link] beacon_system names its system id"
    return [
        state,
        judged("link", text, remedy, fails=False, warns=not ranges),
        judged("link", heard, search, fails=False, warns=not beacon),
    ]


def _rate(name: str, rate_hz: float, wanted_hz: float, remedy: str) -> Finding:
    text = f"{name} {rate_hz:.0f} Hz of {wanted_hz:.0f} Hz"
    return judged("link", text, remedy, fails=rate_hz < LEAST * wanted_hz, warns=rate_hz < ENOUGH * wanted_hz)


def _damage(evidence: Evidence) -> list[Finding]:
    findings = []
    if evidence.bytes_skipped:
        text = f"{evidence.bytes_skipped} bytes that are no MAVLink"
        findings.append(Finding("link", Level.WARN, text, "noise on the line, wrong baud rate, or another protocol"))
    if evidence.frames_refused:
        text = f"{evidence.frames_refused} frames with a wrong or no signature"
        findings.append(Finding("link", Level.WARN, text, SAME_KEY))
    return findings
