"""Does the autopilot know where home is? Return needs it. And would it arm?"""

from __future__ import annotations

from companion.doctor.evidence import Evidence, Finding, judged


def check_home(evidence: Evidence) -> list[Finding]:
    status = evidence.status
    has_home = status is not None and status.home_position_ned_m is not None
    text = "known" if has_home else "not known: Return has no place to go to"
    is_refusing = status is not None and status.ready_to_arm is False and not status.armed
    arming = "the autopilot says why in its messages: companion run shows them, QGroundControl too"
    return [
        judged("home", f"home {text}", "wait for GNSS and a global position", fails=False, warns=not has_home),
        judged("home", "would not arm" if is_refusing else "ready to arm", arming, fails=is_refusing, warns=False),
    ]
