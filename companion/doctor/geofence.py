"""Does the autopilot's fence leave room for the mission, and is there one at all?"""

from __future__ import annotations

from companion.doctor.evidence import Evidence, Finding, Level, judged

NAMES = ("GF_ACTION", "GF_MAX_HOR_DIST", "GF_MAX_VER_DIST")


def check_geofence(evidence: Evidence) -> list[Finding]:
    own = evidence.config.safety
    action, across_m, up_m = (evidence.parameters.get(name, 0) for name in NAMES)
    if action == 0 or (across_m <= 0 and up_m <= 0):
        text = f"the autopilot has none; Companion's own: {own.geofence_radius_m:g} m, {own.ceiling_m:g} m high"
        return [
            Finding(
                "geofence", Level.WARN, text, "GF_ACTION, GF_MAX_HOR_DIST and GF_MAX_VER_DIST act without Companion too"
            )
        ]
    mission = evidence.config.mission
    needed_m = max(mission.takeoff_height_m, mission.search_height_m, mission.approach_height_m) + 3.0
    tight = (0 < up_m < needed_m) or (0 < across_m < mission.search_radius_m)
    text = f"{across_m:g} m around home, {up_m:g} m high (0: no limit)"
    remedy = f"at least {mission.search_radius_m:g} m and {needed_m:g} m for this mission"
    return [judged("geofence", text, remedy, fails=tight, warns=False)]
