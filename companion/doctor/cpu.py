"""Does this computer keep up: does it wake up for each tick, and is a frame done before the next?"""

from __future__ import annotations

from companion.doctor.evidence import Evidence, Finding, judged, percentile

GOOD_LATE_S, POOR_LATE_S = 0.005, 0.020
SLOW_DETECT_S = 0.1


def check_cpu(evidence: Evidence) -> list[Finding]:
    findings = []
    period_s = 1.0 / evidence.config.control.rate_hz
    remedy = "stop other programs, set the CPU governor to performance, a faster computer"
    if evidence.tick_late_s:
        late_s = percentile(evidence.tick_late_s, 0.99)
        text = f"ticks of {1e3 * period_s:.0f} ms are late by {1e3 * late_s:.1f} ms (p99)"
        findings.append(judged("cpu", text, remedy, fails=late_s > POOR_LATE_S, warns=late_s > GOOD_LATE_S))
    if evidence.detect_s:
        usual_s = percentile(evidence.detect_s, 0.5)
        text = f"a frame takes {1e3 * usual_s:.1f} ms to search"
        findings.append(judged("cpu", text, remedy, fails=usual_s > SLOW_DETECT_S, warns=usual_s > 1.0 / 30.0))
    return findings
