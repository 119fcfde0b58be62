"""The quick console examples in the docs print what the docs say, but for numbers that a machine's speed changes."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "docs"))

from make_console import DOCS, Example, examples, pages, sandbox, shown

QUICK = [(page, i) for page in pages() for i, example in enumerate(examples(page)) if not example.is_slow]


def without_numbers(text: str) -> str:
    return re.sub(r"[ ]+", " ", re.sub(r"\d+(\.\d+)?(e[-+]?\d+)?", "N", text))


@pytest.mark.parametrize(("page", "number"), QUICK, ids=[f"{page.stem}-{i}" for page, i in QUICK])
def test_an_example_prints_what_the_page_says(page: Path, number: int, tmp_path: Path) -> None:
    place = sandbox(tmp_path)
    of_page = [example for example in examples(page) if not example.is_slow]
    example = examples(page)[number]
    for before in of_page[: of_page.index(example)]:
        shown(before, place)  # an example may use what those before it on its page have written
    assert without_numbers(shown(example, place)) == without_numbers(example.text)


def test_the_docs_have_examples_and_every_one_has_a_command() -> None:
    assert sum(len(examples(page)[i].commands) for page, i in QUICK) >= 15
    assert all(example.commands for page in pages() for example in examples(page))
    assert all(example.text for page in pages() for example in examples(page))


def test_an_error_shows_its_status(tmp_path: Path) -> None:
    example = Example(DOCS / "x.md", False, "$ companion check-config -c nothing.toml\n")
    assert shown(example, sandbox(tmp_path)).endswith("(exit status 2)\n")
