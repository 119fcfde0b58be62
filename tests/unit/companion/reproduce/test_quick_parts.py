"""The quick part of every paper: it runs, it can be written as a page, and what it says about itself holds."""

from __future__ import annotations

import functools
from importlib.util import find_spec
from pathlib import Path
from xml.dom import minidom

import pytest

from companion.reproduce.page import write_page
from companion.reproduce.papers import PAPERS, NotReproduced, reproducer
from companion.reproduce.row import Reproduction, Row

PRESENT = [key for key in PAPERS if find_spec(f"companion.reproduce.{key}") is not None]


@functools.cache
def made(key: str) -> Reproduction:
    return PAPERS[key](True)


def rows(key: str, table: str) -> list[Row]:
    return [row for row in made(key).rows if row.table.startswith(table)]


@pytest.mark.timeout(240)
@pytest.mark.parametrize("key", PRESENT)
def test_the_quick_part_gives_rows_figures_notes_and_a_page(key: str, tmp_path: Path) -> None:
    reproduction = made(key)
    assert reproduction.key == key
    assert reproduction.rows
    assert reproduction.notes
    assert any(row.verdict in ("same", "better") for row in reproduction.rows)
    written = write_page(reproduction, tmp_path, ["for the test"])
    assert {path.name for path in written} >= {f"{key}.html", f"{key}.md"}
    for path in written:
        if path.suffix == ".svg":
            minidom.parse(str(path))


def test_a_paper_without_a_module_says_so() -> None:
    with pytest.raises(NotReproduced, match="newton"):
        reproducer("newton")(True)


def test_the_tables_of_shivam_come_out_to_the_printed_digits_but_for_the_misprint() -> None:
    tables = rows("shivam", "Table I")
    assert len(tables) == 3 + 10 + 12 + 12
    assert [row.name for row in tables if row.verdict != "same"] == ["P0 (10, 15), P1"]


def test_lengths_curvatures_and_ends_of_shivam_hold() -> None:
    held = rows("shivam", "Arc length") + rows("shivam", "Peak curvature") + rows("shivam", "What must hold")
    assert len(held) == 14 + 15 + 4
    assert {row.verdict for row in held} == {"same"}


def test_every_case_of_shivam_reaches_the_pad_by_the_heading_loop() -> None:
    left = [row for row in rows("shivam", "Tracked") if row.printed is not None]
    assert len(left) == 28
    assert {row.verdict for row in left} == {"same"}


def test_the_simulated_quadrotor_lands_from_the_curve() -> None:
    outcome = next(row for row in rows("shivam", "Flown") if row.name == "pad still: outcome")
    assert outcome.ours == "landed"


def test_the_case_that_both_tables_of_dalang_share_lands_while_the_pad_moves() -> None:
    (row,) = rows("dalang", "Table I")
    assert row.verdict == "same"
    assert str(row.ours).startswith("Success")


def test_the_lag_of_dalang_is_more_than_it_may_land_within() -> None:
    by_name = {row.name: row.ours for row in rows("dalang", "The lag")}
    assert by_name["(1 + kd) / kp"] == pytest.approx(1.5875)
    assert by_name["trails a pad at 0.1 m/s by"] == pytest.approx(0.15875)
    flown = by_name["flown: behind the centre at touchdown"]
    assert isinstance(flown, float)
    assert flown == pytest.approx(0.15875, abs=0.05)
