"""`companion doctor`: is all there that a landing needs? It listens, asks for parameters and flies nothing.

collect.py gathers Evidence from the link, the camera and this computer; each check is one file with one function from Evidence to
findings and one line in CHECKS; command.py prints. Checks are pure: they are tested with made-up evidence too.
"""

from __future__ import annotations

from collections.abc import Callable

from companion.doctor.battery import check_battery
from companion.doctor.camera import check_camera
from companion.doctor.clock import check_clock
from companion.doctor.cpu import check_cpu
from companion.doctor.disk import check_disk
from companion.doctor.evidence import Evidence, Finding, Level
from companion.doctor.geofence import check_geofence
from companion.doctor.home import check_home
from companion.doctor.link import check_link
from companion.doctor.pad import check_pad
from companion.doctor.parameters import check_parameters

CHECKS: dict[str, Callable[[Evidence], list[Finding]]] = {
    "link": check_link,
    "clock": check_clock,
    "camera": check_camera,
    "pad": check_pad,
    "parameters": check_parameters,
    "battery": check_battery,
    "home": check_home,
    "geofence": check_geofence,
    "disk": check_disk,
    "cpu": check_cpu,
}

__all__ = ["CHECKS", "Evidence", "Finding", "Level", "diagnose"]


def diagnose(evidence: Evidence) -> list[Finding]:
    """Every check in order. Without a vehicle, what depends on it is not asked."""
    findings = check_link(evidence)
    for name, check in CHECKS.items():
        if name != "link" and (evidence.was_heard or name not in NEEDS_VEHICLE):
            findings += check(evidence)
    return findings


NEEDS_VEHICLE = {"clock", "parameters", "battery", "home", "geofence"}
