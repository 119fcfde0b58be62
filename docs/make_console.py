"""Run the console examples of these pages and paste what they print, so that no page shows what no longer happens.

    python docs/make_console.py [PAGE ...]         all pages; takes a minute

A block of code after a line `<!-- console -->` is run line by line: lines that begin with `$ ` are commands, what follows is
their output. `<!-- console: slow -->` marks what takes more than seconds: written by this script, not repeated by the test. Commands run
in an empty folder beside links to `configs` and `tests`; a status other than 0 is shown as `(exit status N)`.
tests/test_docs_console.py repeats the quick ones and compares all but the numbers.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

DOCS = Path(__file__).resolve().parent
LINKED = ("configs", "tests")
TIMEOUT_S = 300.0
BLOCK = re.compile(r"<!-- console(?P<slow>: slow)? -->\n```\n(?P<text>.*?)```\n", re.DOTALL)


@dataclass(frozen=True, slots=True)
class Example:
    """One block of a page: its commands in order, and its text as it stands there."""

    page: Path
    is_slow: bool
    text: str

    @property
    def commands(self) -> list[str]:
        return [line[2:] for line in self.text.splitlines() if line.startswith("$ ")]


def examples(page: Path) -> list[Example]:
    found = BLOCK.finditer(page.read_text(encoding="utf-8"))
    return [Example(page, match["slow"] is not None, match["text"]) for match in found]


def shown(example: Example, folder: Path) -> str:
    """The block as it should stand: each command and what it prints now."""
    return "".join(f"$ {command}\n{printed(command, folder)}" for command in example.commands)


def printed(command: str, folder: Path) -> str:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path, "COLUMNS": "150", "TERM": "dumb", "NO_COLOR": "1"}
    ended = subprocess.run(
        ["bash", "-o", "pipefail", "-c", command],
        cwd=folder,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=TIMEOUT_S,
        check=False,
    )
    lines = [line.rstrip() for line in ended.stdout.splitlines()]
    if ended.returncode != 0:
        lines.append(f"(exit status {ended.returncode})")
    return "".join(f"{line}\n" for line in lines)


def sandbox(folder: Path) -> Path:
    for name in LINKED:
        (folder / name).symlink_to(DOCS.parent / name)
    return folder


def pages() -> list[Path]:
    return sorted(page for page in DOCS.rglob("*.md") if examples(page))


def rewrite(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as folder:
        place = sandbox(Path(folder))
        for example in examples(page):
            text = text.replace(f"```\n{example.text}```\n", f"```\n{shown(example, place)}```\n", 1)
    page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    for page in [Path(name).resolve() for name in sys.argv[1:]] or pages():
        rewrite(page)
        print(page)
