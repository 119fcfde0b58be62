"""Pictures of the page and of a report for the docs, from a simulated flight.

python docs/make_screenshots.py        writes docs/images/dashboard.png and docs/images/report.png (needs Chromium)
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

from headless_browser import Page, find_browser
from simulated_flight import SimulatedFlight

IMAGES = Path(__file__).parent / "images"
PHASE = "document.getElementById('ladder').dataset.phase"


def main() -> None:
    browser = find_browser()
    if browser is None:
        sys.exit("no Chromium is installed (.ci/system-packages installs it)")
    with tempfile.TemporaryDirectory() as folder:
        shoot_dashboard(browser, Path(folder))
        shoot_report(browser, Path(folder))


def shoot_dashboard(browser: str, folder: Path) -> None:
    """Above the moving pad, with its marker in sight. It follows for long, so that a slow machine has time for the picture."""
    flying = SimulatedFlight(folder, settings={"mission.follow_time_s": "8"})
    with flying as flight, Page(browser, folder / "page", width_px=1440, height_px=900) as page:
        page.open(flight.page)
        page.until("document.getElementById('link').textContent.includes('armed')", timeout_s=60.0)
        page.click("button[data-action=start]")
        page.until("document.querySelector('button.asking') !== null", timeout_s=5.0)
        page.click("button[data-action=start]")
        page.until(f"{PHASE} === 'follow'", timeout_s=120.0)
        page.until("document.getElementById('caption').textContent.includes('px')", timeout_s=20.0)
        page.screenshot(IMAGES / "dashboard.png")
    print(IMAGES / "dashboard.png")


def shoot_report(browser: str, folder: Path) -> None:
    """The upper part of the report of a landing in lockstep."""
    command = [sys.executable, "-m", "companion", "demo", "line", "--json", "--runs", str(folder / "runs")]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    run = Path(json.loads(ended.stdout)["run"])
    with Page(browser, folder / "report", width_px=1280, height_px=1400) as page:
        page.open((run / "report.html").resolve().as_uri())
        page.screenshot(IMAGES / "report.png")
    print(IMAGES / "report.png")


if __name__ == "__main__":
    main()
