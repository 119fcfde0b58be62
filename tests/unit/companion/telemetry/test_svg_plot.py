"""Charts: round ticks, points where they belong."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import pytest

from companion.telemetry.svg_plot import Band, Chart, Line, round_ticks, svg


@pytest.mark.parametrize(
    ("low", "high", "ticks"), [(0.0, 10.0, [0, 2, 4, 6, 8, 10]), (-1.0, 1.0, [-1.0, -0.5, 0.0, 0.5, 1.0]), (3.0, 3.5, [3.0, 3.1, 3.2, 3.3, 3.4, 3.5])]
)  # fmt: skip
def test_ticks_are_round_and_inside(low: float, high: float, ticks: list[float]) -> None:
    assert round_ticks(low, high) == pytest.approx(ticks)


def test_a_chart_is_well_formed_and_names_its_parts() -> None:
    line = Line("true <&>", "#000", [0.0, 1.0, 2.0], [0.0, None, 4.0])
    text = svg(Chart("Path", "t, s", "m", (line,), (Band(0.0, 2.0, "descend", "#fff"),)))
    root = ET.fromstring(text)
    words = "".join(root.itertext())
    assert "Path" in words
    assert "true <&>" in words
    assert "descend" in words


def test_a_gap_in_the_data_breaks_the_line() -> None:
    line = Line("", "#000", [0.0, 1.0, 2.0, 3.0], [0.0, 1.0, None, 3.0])
    path = ET.fromstring(svg(Chart("", "", "", (line,)))).find("path")
    assert path is not None
    assert path.attrib["d"].count("M") == 2


def test_an_empty_chart_is_still_a_chart() -> None:
    ET.fromstring(svg(Chart("nothing yet", "t", "m", ())))
