"""Is there room for the run folder? Camera frames are the bulk of it: 2 to 3 MB a second."""

from __future__ import annotations

from companion.doctor.evidence import Evidence, Finding, Level, judged

MEGABYTE = 1_000_000
FLIGHT, PLENTY = 500 * MEGABYTE, 5000 * MEGABYTE


def check_disk(evidence: Evidence) -> list[Finding]:
    free = evidence.disk_free_bytes
    if free is None:
        return [Finding("disk", Level.WARN, "free space unknown", "can the folder of --runs be written?")]
    text = f"{free / 1e9:.1f} GB free for run folders"
    return [
        judged(
            "disk", text, "remove old run folders, or --runs on a larger disk", fails=free < FLIGHT, warns=free < PLENTY
        )
    ]
