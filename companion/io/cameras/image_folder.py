"""folder://DIR[?pace=1] - images with their times, as recorders leave them.

Either `times.csv` in the folder, its header naming the columns and the clock:

    file,capture_boot_us      the autopilot's boot clock, microseconds
    file,t_unix_ns            nanoseconds since 1970 (as the stamps of a .tlog)
    file,t_ns                 a clock of the recording's own

or file names that are nanoseconds (1700000000123456789.png; above 10^17 they count as Unix time). Other names are read in
their order without times: good for calibration, not for delays.
"""

from __future__ import annotations

import csv
import time
from collections.abc import AsyncIterator, Iterator
from dataclasses import dataclass
from pathlib import Path

from companion.io.cameras.address import refuse_unknown, split
from companion.io.cameras.frame import CameraError, CameraFrame, CaptureClock
from companion.io.cameras.pacing import paced

OPTIONS = ("pace",)
SUFFIXES = {".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm"}
COLUMNS: dict[str, tuple[CaptureClock, int]] = {
    "capture_boot_us": (CaptureClock.AUTOPILOT, 1000),
    "t_unix_ns": (CaptureClock.UNIX, 1),
    "t_ns": (CaptureClock.MEDIA, 1),
}
UNIX_FROM_NS = 10**17
UNTIMED_PERIOD_NS = 33_333_333


@dataclass(frozen=True, slots=True)
class Listed:
    """One image of the folder. `uncertainty_ns` is all of a frame time where the folder says no times."""

    path: Path
    t_ns: int
    clock: CaptureClock
    uncertainty_ns: int = 0


async def image_folder_frames(url: str) -> AsyncIterator[CameraFrame]:
    """CameraError where there is no such folder, no image in it, or its times.csv cannot be used. Files that are no picture
    come as frames without one."""
    place, options = split(url)
    refuse_unknown(url, options, OPTIONS)
    async for frame in paced(_frames(listed(Path(place))), keep_pace=options.get("pace", "0") != "0"):
        yield frame


def listed(folder: Path) -> list[Listed]:
    """The folder's images in the order of their times."""
    if not folder.is_dir():
        raise CameraError(f"folder://{folder}: there is no folder {folder}")
    table = folder / "times.csv"
    images = _from_table(table) if table.exists() else _from_names(folder)
    if not images:
        raise CameraError(f"folder://{folder}: no images ({', '.join(sorted(SUFFIXES))})")
    return sorted(images, key=lambda image: image.t_ns)


def _frames(images: list[Listed]) -> Iterator[CameraFrame]:
    for sequence, image in enumerate(images):
        try:
            content = image.path.read_bytes()
        except OSError as error:
            raise CameraError(f"{image.path}: cannot be read: {error.strerror}") from error
        arrived_ns = time.monotonic_ns()
        yield CameraFrame(content, image.t_ns, image.uncertainty_ns, image.clock, arrived_ns, sequence, image.path.name)


def _from_table(table: Path) -> list[Listed]:
    with table.open(newline="", encoding="utf-8") as file:
        rows = csv.DictReader(file)
        names = rows.fieldnames or []
        column = next((name for name in COLUMNS if name in names), None)
        if "file" not in names or column is None:
            raise CameraError(f"{table}: columns are {list(names)}; needed: file and one of {', '.join(COLUMNS)}")
        clock, scale = COLUMNS[column]
        try:
            return [Listed(table.parent / row["file"], int(row[column]) * scale, clock) for row in rows]
        except (ValueError, TypeError, csv.Error) as error:
            raise CameraError(f"{table}: line {rows.line_num}: {error}") from error


def _from_names(folder: Path) -> list[Listed]:
    paths = sorted(path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES)
    if paths and all(path.stem.isdecimal() and len(path.stem) >= 9 for path in paths):
        return [Listed(path, t_ns := int(path.stem), _clock_of(t_ns)) for path in paths]
    return [
        Listed(path, index * UNTIMED_PERIOD_NS, CaptureClock.MEDIA, UNTIMED_PERIOD_NS)
        for index, path in enumerate(paths)
    ]


def _clock_of(t_ns: int) -> CaptureClock:
    return CaptureClock.UNIX if t_ns >= UNIX_FROM_NS else CaptureClock.MEDIA
