"""Is the pad that is seen the one that is configured? Not seen is no fault here: the vehicle may stand elsewhere."""

from __future__ import annotations

from companion.doctor.evidence import Evidence, Finding, Level, judged

ODD_PX = 1.5


def check_pad(evidence: Evidence) -> list[Finding]:
    configured = {marker.id for marker in evidence.config.pad.markers}
    findings = []
    if evidence.marker_ids_seen:
        findings.append(_seen(evidence, configured))
    else:
        text = f"not in view (configured: {evidence.config.pad.family} {_listed(configured)})"
        findings.append(Finding("pad", Level.WARN, text, "put the camera over the pad and ask again"))
    if evidence.foreign_ids_seen:
        text = f"markers in view that are not on the configured pad: {_listed(evidence.foreign_ids_seen)}"
        findings.append(Finding("pad", Level.WARN, text, "[pad] family and markers; or take the other markers away"))
    return findings


def _seen(evidence: Evidence, configured: set[int]) -> Finding:
    worst = max(evidence.reprojection_errors_px, default=0.0)
    unseen = configured - evidence.marker_ids_seen
    text = f"markers {_listed(evidence.marker_ids_seen)} seen, fit {worst:.2f} px" + (
        f"; not {_listed(unseen)}" if unseen else ""
    )
    return judged(
        "pad", text, "sizes and positions in [pad], calibration of the camera", fails=False, warns=worst > ODD_PX
    )


def _listed(numbers: set[int]) -> str:
    return ", ".join(str(number) for number in sorted(numbers))
