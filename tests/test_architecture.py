"""The rules of docs/ARCHITECTURE.md that a machine can hold."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
CORE = (
    "messages",
    "geometry",
    "vision",
    "estimation",
    "planning",
    "control",
    "mission",
    "mavlink",
    "pipeline",
    "situation",
    "onboard",
)
STAGES = ("vision", "estimation", "planning", "control", "mission", "mavlink")
FORBIDDEN = {"asyncio", "socket", "time", "datetime", "random", "os", "threading", "subprocess", "select", "sitl_stub"}
MEETING_PLACES = {
    "companion/campaign",
    "companion/reproduce",
    "companion/demo.py",
    "companion/demo_udp.py",
    "companion/cli.py",
}


def sources(package: str) -> list[Path]:
    return sorted((ROOT / package).rglob("*.py"))


def imported(path: Path) -> Iterator[tuple[str, int]]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            yield node.module, node.lineno
            yield from ((f"{node.module}.{alias.name}", node.lineno) for alias in node.names)


def core_files() -> list[Path]:
    return [
        path
        for path in sources("companion")
        if path.relative_to(ROOT / "companion").parts[0].removesuffix(".py") in CORE
    ]


@pytest.mark.parametrize("path", core_files(), ids=lambda path: str(path.relative_to(ROOT)))
def test_the_core_reads_no_clock_socket_environment_or_global_random_state(path: Path) -> None:
    found = [f"{name} (line {line})" for name, line in imported(path) if name.split(".")[0] in FORBIDDEN]
    assert not found, f"{path.relative_to(ROOT)} imports {found}"


def stage_files() -> list[Path]:
    return [path for path in core_files() if path.relative_to(ROOT / "companion").parts[0] in STAGES]


def files_away_from_the_meeting_places() -> list[Path]:
    return [
        path
        for path in sources("companion")
        if not any(path.relative_to(ROOT).as_posix().startswith(place) for place in MEETING_PLACES)
    ]


@pytest.mark.parametrize("path", stage_files(), ids=lambda path: str(path.relative_to(ROOT)))
def test_a_stage_never_imports_another_stage(path: Path) -> None:
    stage = path.relative_to(ROOT / "companion").parts[0]
    others = {f"companion.{name}" for name in STAGES if name != stage}
    found = [name for name, _ in imported(path) if ".".join(name.split(".")[:2]) in others]
    assert not found, f"{path.relative_to(ROOT)} imports {found}"


def modules() -> dict[str, set[str]]:
    """Every module of the app and the modules of the app that it names in an import, inside functions and for types alone too."""
    files = {path.relative_to(ROOT).with_suffix("").as_posix().replace("/", "."): path for path in sources("companion")}
    files = {name.removesuffix(".__init__"): path for name, path in files.items()}
    return {name: {there for there, _ in imported(path) if there in files} for name, path in files.items()}


def test_no_two_files_import_each_other() -> None:
    """A folder's __init__ may name its files: it is what the folder shows."""
    graph = modules()
    pairs = [(a, b) for a in graph for b in graph[a] if a < b and a in graph[b] and not b.startswith(f"{a}.")]
    assert not pairs


@pytest.mark.parametrize("path", sources("sitl_stub"), ids=lambda path: str(path.relative_to(ROOT)))
def test_the_simulator_imports_nothing_of_the_app(path: Path) -> None:
    assert not [name for name, _ in imported(path) if name.split(".")[0] == "companion"]


@pytest.mark.parametrize("path", files_away_from_the_meeting_places(), ids=lambda path: str(path.relative_to(ROOT)))
def test_the_app_meets_the_simulator_only_in_campaigns_and_the_demo(path: Path) -> None:
    assert not [name for name, _ in imported(path) if name.split(".")[0] == "sitl_stub"]


def test_pymavlink_is_known_to_the_codec_only() -> None:
    allowed = {"companion/mavlink", "companion/io", "sitl_stub"}
    users = {
        path.relative_to(ROOT).as_posix()
        for package in ("companion", "sitl_stub")
        for path in sources(package)
        if any(name.split(".")[0] == "pymavlink" for name, _ in imported(path))
    }
    assert all(any(user.startswith(place) for place in allowed) or user.endswith("run_folder.py") for user in users), (
        users
    )


@pytest.mark.parametrize("name", ["utils", "helpers", "common", "manager", "misc"])
def test_no_file_is_named_after_nothing(name: str) -> None:
    found = [path for package in ("companion", "sitl_stub") for path in sources(package) if path.stem == name]
    assert not found
