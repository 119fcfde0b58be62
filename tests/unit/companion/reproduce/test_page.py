"""A reproduction as HTML, as markdown and as figures of their own."""

from __future__ import annotations

from pathlib import Path
from xml.dom import minidom

from companion.reproduce.page import VERSUS, as_html, as_markdown, cells, figure_file, number_text, write_page
from companion.reproduce.row import Reproduction, Row, number_row
from companion.telemetry.svg_plot import Chart, Line

CHART = Chart("Path & pad", "x, m", "y, m", (Line("a", "#000000", [0.0, 1.0], [0.0, 2.0]),))
MADE = Reproduction(
    key="test",
    title="A <paper>",
    rows=(
        number_row("Table A", "length", 17.114, 17.1139, "m", 0.001),
        number_row("Table A", "time", 18.0, 12.0, "s", 1.0, good=-1),
        number_row("Table A", "time | worse", 18.0, 30.0, "s", 1.0, good=-1),
        number_row("Table B", "left open", None, 0.25, "m", 0.0),
        Row("Table B", "verdict", "MPS", "Success", "", "the same word", "differs"),
    ),
    figures=(CHART,),
    errata=("Equation (9) is wrong.",),
    notes=("One flight, seed 1.",),
)


def test_a_row_shows_print_ours_difference_tolerance_and_verdict() -> None:
    assert cells(MADE.rows[0]) == ("length", "17.114 m", "17.114 m", "-0.0001", "0.001", "same")
    assert cells(MADE.rows[1])[3:] == ("-6", "1", "better")
    assert cells(MADE.rows[3]) == ("left open", "-", "0.25 m", "", "", "not printed")
    assert cells(MADE.rows[4])[1:4] == ("MPS", "Success", "")
    assert cells(MADE.rows[1], VERSUS)[-1] == "wins"


def test_numbers_have_five_digits() -> None:
    assert [number_text(x) for x in (20.0, 0.0, 17.11389, 0.000123456)] == ["20", "0", "17.114", "0.00012346"]


def test_the_page_needs_nothing_from_elsewhere_and_escapes_what_it_shows() -> None:
    page = as_html(MADE, ["Made by `x`."])
    assert "A &lt;paper&gt;" in page
    assert "<svg" in page
    assert "Equation (9) is wrong." in page
    for outside in ("http://", "https://", "<script", "src="):
        assert outside not in page


def test_the_markdown_has_every_table_and_refers_to_its_figures() -> None:
    text = as_markdown(MADE, ["Made by `x`."])
    assert text.count("\n| --- |") == 2
    assert "time \\| worse" in text
    assert "![Path & pad](test-01-path-pad.svg)" in text


def test_what_is_written_can_be_read_again(tmp_path: Path) -> None:
    written = write_page(MADE, tmp_path / "new", ["Made by `x`."])
    assert [path.name for path in written] == ["test.html", "test.md", "test-01-path-pad.svg"]
    root = minidom.parseString(figure_file(CHART)).documentElement
    assert root is not None
    assert root.getAttribute("xmlns") == "http://www.w3.org/2000/svg"
