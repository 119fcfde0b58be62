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
    line = Line("", "#000", [0.0, 1.0, 2.0, 3.0, 4.0], [0.0, 1.0, None, 3.0, 4.0])
    path = ET.fromstring(svg(Chart("", "", "", (line,)))).find("path")
    assert path is not None
    assert path.attrib["d"].count("M") == 2


def test_an_empty_chart_is_a_chart_and_says_so() -> None:
    root = ET.fromstring(svg(Chart("delays", "t", "m", ())))
    assert "nothing of this in the log" in "".join(root.itertext())


def test_a_line_is_cut_where_it_leaves_the_range_and_does_not_run_along_the_edge() -> None:
    line = Line("", "#000", [0.0, 1.0, 2.0, 3.0, 4.0], [0.0, 4.0, 4.0, 4.0, 0.0])
    chart = Chart("", "", "", (line,), x_range=(0.0, 4.0), y_range=(0.0, 2.0), width=468.0, height=260.0)
    path = ET.fromstring(svg(chart)).find("path")
    assert path is not None
    # the axes are 400 x 200 px from (56, 226) to (456, 26): the line is over 2 from 0.5 on, one pixel is spare
    assert path.attrib["d"] == "M56.0 226.0L106.2 25.0M405.8 25.0L456.0 226.0"


def test_a_line_that_crosses_the_whole_range_between_two_points_is_seen() -> None:
    chart = Chart("", "", "", (Line("", "#000", [0.0, 1.0], [-9.0, 9.0]),), y_range=(0.0, 2.0))
    path = ET.fromstring(svg(chart)).find("path")
    assert path is not None
    assert path.attrib["d"].count("L") == 1
