"""Sheets are at true scale in every format, and a printed board is found where it was drawn."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from companion.calibration.board import Board, BoardView, charuco, find, squares
from companion.calibration.sheet import DOTS_PER_MM, FORMATS, Sheet, laid_out, pdf, png, svg, write


def sheet_of(board: Board) -> Sheet:
    return laid_out(squares(board), (board.columns * board.square_m, board.rows * board.square_m), "test")


def dots(sheet: Sheet) -> Any:
    return cv2.imdecode(np.frombuffer(png(sheet), np.uint8), cv2.IMREAD_GRAYSCALE)


@pytest.mark.parametrize("kind", ["charuco", "chessboard"])
def test_the_printed_board_is_found_with_its_corners_a_square_apart_in_millimetres(kind: Any) -> None:
    board = Board(kind=kind)
    printed = dots(sheet_of(board))
    view = find(board, cv2.resize(printed, None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA))
    assert isinstance(view, BoardView)
    assert len(view.pixels) == 7 * 5
    scale = np.linalg.norm(view.pixels[0] - view.pixels[-1]) / np.linalg.norm(
        view.board_points[0] - view.board_points[-1]
    )
    assert scale / DOTS_PER_MM == pytest.approx(250.0, rel=2e-3)


def test_the_drawn_charuco_board_is_opencvs_own_board() -> None:
    board = Board(square_m=0.032)
    ours = dots(laid_out(squares(board), (0.256, 0.192), ""))
    ys, xs = np.where(ours[: -round(20 * DOTS_PER_MM)] == 0)
    mine = cv2.resize(ours[ys.min() : ys.max() + 1, xs.min() : xs.max() + 1], (1024, 768), interpolation=cv2.INTER_AREA)
    theirs = charuco(board).generateImage((1024, 768))
    assert np.mean((mine > 127) != (theirs > 127)) < 0.01


def test_a_pdf_has_the_papers_size_and_the_squares_in_points() -> None:
    text = pdf(sheet_of(Board(kind="chessboard"))).decode("latin-1")
    assert "/MediaBox [0 0 841.8898 595.2756]" in text
    sides = {side for line in re.findall(r"^(.*) re$", text, re.M) if (side := line.split()[2])}
    assert f"{0.03 * 1000 * 72 / 25.4:.4f}" in sides
    start = int(text.rsplit("startxref\n", 1)[1].split()[0])
    assert text[start:].startswith("xref")
    for offset in re.findall(r"^(\d{10}) 00000 n", text, re.M):
        assert re.match(r"\d 0 obj", text[int(offset) :])


def test_an_svg_is_in_millimetres() -> None:
    text = svg(sheet_of(Board(kind="chessboard"))).decode()
    assert 'width="297.0mm" height="210.0mm" viewBox="0 0 297.0 210.0"' in text
    assert text.count('width="30.0000" height="30.0000"') == 24


def test_a_board_larger_than_any_paper_gets_a_sheet_of_its_own(tmp_path: Path) -> None:
    sheet = laid_out(squares(Board(square_m=0.3)), (2.4, 1.8), "")
    assert (sheet.width_mm, sheet.height_mm) == (2420.0, 1830.0)


def test_a_suffix_decides_the_format_and_an_unknown_one_is_refused(tmp_path: Path) -> None:
    sheet = sheet_of(Board())
    for suffix in FORMATS:
        write(sheet, tmp_path / f"board{suffix}")
        assert (tmp_path / f"board{suffix}").stat().st_size > 1000
    with pytest.raises(ValueError, match=r"one of \.pdf"):
        write(sheet, tmp_path / "board.doc")


@pytest.mark.parametrize("options", [{"columns": 2}, {"rows": 99}, {"square_m": 0.0}, {"columns": 30, "rows": 30}])
def test_a_board_that_cannot_be_is_refused(options: Any) -> None:
    with pytest.raises(ValueError):
        Board(**options)
