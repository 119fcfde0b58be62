"""A real browser, a real click: the vehicle holds. The simulator and Companion fly as two processes in real time."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "docs"))

from headless_browser import Page, find_browser
from simulated_flight import SimulatedFlight

pytestmark = [pytest.mark.sockets, pytest.mark.timeout(240)]
PHASE = "document.getElementById('ladder').dataset.phase"
LINK = "document.getElementById('link').textContent"


@pytest.fixture(scope="module")
def browser() -> str:
    path = find_browser()
    if path is None:
        pytest.skip("no Chromium is installed (.ci/system-packages installs it)")
    return path


def test_a_click_on_abort_in_the_middle_of_the_approach_holds_the_vehicle(browser: str, tmp_path: Path) -> None:
    flying = SimulatedFlight(tmp_path, settings={"mission.follow_time_s": "600"})
    with flying as flight, Page(browser, tmp_path / "profile") as page:
        page.open(flight.page)
        page.until(f"{LINK}.includes('armed')", timeout_s=60.0)
        assert "token" not in page.value("location.href")
        page.click("button[data-action=start]")
        assert page.value(PHASE) == "idle", "one click does not start motors"
        page.until("document.querySelector('button.asking') !== null", timeout_s=5.0)
        page.click("button[data-action=start]")
        page.until(f"['approach', 'follow'].includes({PHASE})", timeout_s=60.0)
        page.until(f"{LINK}.startsWith('offboard')", timeout_s=10.0)
        assert page.value("document.getElementById('camera').getContext('2d').getImageData(300, 200, 1, 1).data[3]")
        page.click("button[data-action=abort]")
        page.until(f"{PHASE} === 'hold'", timeout_s=10.0)
        assert page.until(f"{LINK}.startsWith('hold, armed') && {LINK}", timeout_s=10.0) == "hold, armed, in air"
        assert "abort" in page.value("document.getElementById('events').textContent")
