"""The results file is the campaign's state: it survives a killed writer and takes one writer at a time."""

from __future__ import annotations

from pathlib import Path

import pytest

from companion.campaign.results_file import ResultsFile, stored_rows

LANDED = {"sample": 0, "outcome": "landed"}


def filled(path: Path) -> None:
    results = ResultsFile(path, "abc")
    results.add(LANDED)
    results.close()


def test_a_half_written_line_is_cut_off_and_the_next_one_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "campaign" / "samples.jsonl"
    filled(path)
    with path.open("a", encoding="utf-8") as file:
        file.write('{"sample": 1, "outc')
    results = ResultsFile(path, "abc")
    assert results.rows == {0: LANDED}
    results.add({"sample": 1, "outcome": "timeout"})
    results.close()
    assert stored_rows(path) == {0: LANDED, 1: {"sample": 1, "outcome": "timeout"}}


def test_results_of_another_campaign_are_refused(tmp_path: Path) -> None:
    filled(tmp_path / "samples.jsonl")
    with pytest.raises(ValueError, match="another campaign file"):
        ResultsFile(tmp_path / "samples.jsonl", "other")


def test_a_campaign_file_may_change_as_long_as_nothing_was_flown(tmp_path: Path) -> None:
    path = tmp_path / "samples.jsonl"
    ResultsFile(path, "abc").close()
    results = ResultsFile(path, "changed")
    results.add(LANDED)
    results.close()
    assert stored_rows(path, "changed") == {0: LANDED}


def test_a_second_writer_is_refused_and_a_reader_is_not(tmp_path: Path) -> None:
    path = tmp_path / "samples.jsonl"
    filled(path)
    first = ResultsFile(path, "abc")
    with pytest.raises(ValueError, match="another campaign process"):
        ResultsFile(path, "abc")
    assert stored_rows(path) == {0: LANDED}
    first.close()


def test_a_reader_who_names_the_campaign_gets_nothing_of_another(tmp_path: Path) -> None:
    path = tmp_path / "samples.jsonl"
    filled(path)
    assert stored_rows(path, "abc") == {0: LANDED}
    assert stored_rows(path, "other") == {}


def test_nothing_flown_is_nothing_stored(tmp_path: Path) -> None:
    assert stored_rows(tmp_path / "samples.jsonl") == {}
