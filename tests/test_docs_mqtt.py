"""docs/mqtt.md says what the table of topics says."""

from __future__ import annotations

import runpy
from pathlib import Path

DOCS = Path(__file__).resolve().parents[1] / "docs"


def test_the_page_on_mqtt_is_what_the_table_gives() -> None:
    page = runpy.run_path(str(DOCS / "make_mqtt_page.py"))["page"]
    written = (DOCS / "mqtt.md").read_text(encoding="utf-8")
    assert written == page(), "run python docs/make_mqtt_page.py"
