"""The three commands of `companion calibrate`: parsing and printing only."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Literal, NoReturn

import typer
from rich.console import Console

calibrate = typer.Typer(
    help="Calibrate a camera: print a board, measure its lens, measure its delay.", no_args_is_help=True
)

Kind = Annotated[Literal["charuco", "chessboard"], typer.Option(help="ChArUco may stick out of the picture.")]
Columns = Annotated[int, typer.Option(help="Squares across.")]
Rows = Annotated[int, typer.Option(help="Squares down.")]
SquareMm = Annotated[float, typer.Option("--square-mm", help="Side of a square as measured on the print.")]


@calibrate.command()
def board(
    out: Annotated[Path, typer.Option(help="PDF, SVG or PNG by its suffix.")] = Path("board.pdf"),
    kind: Kind = "charuco",
    columns: Columns = 8,
    rows: Rows = 6,
    square_mm: SquareMm = 30.0,
) -> None:
    """Write the board to print, at true scale."""
    from companion.calibration.board import Board
    from companion.calibration.command import write_board

    try:
        typer.echo(write_board(Board(kind, columns, rows, square_mm / 1000.0), out))
    except (ValueError, OSError) as error:
        _fail(str(error))


@calibrate.command()
def lens(
    source: Annotated[str, typer.Argument(help="Camera URL, or folder://DIR with pictures of the board.")],
    model: Annotated[Literal["pinhole", "fisheye"], typer.Option(help="fisheye above 100 degrees or so.")] = "pinhole",
    out: Annotated[Path, typer.Option(help="ROS camera_info YAML.")] = Path("camera.yaml"),
    camera: Annotated[str, typer.Option(help="The camera's name in the configuration.")] = "down",
    kind: Kind = "charuco",
    columns: Columns = 8,
    rows: Rows = 6,
    square_mm: SquareMm = 30.0,
    seconds: Annotated[float, typer.Option(help="How long a live camera is watched at most.")] = 120.0,
) -> None:
    """Measure a lens. Exit status 0: pass or warn, and the file is written; 1: fail."""
    from companion.calibration.board import Board
    from companion.calibration.command import LensRequest, calibrate_lens
    from companion.calibration.verdict import FAIL

    try:
        request = LensRequest(
            source=source,
            board=Board(kind, columns, rows, square_mm / 1000.0),
            model="kannala_brandt" if model == "fisheye" else "pinhole",
            out=out,
            camera=camera,
            seconds=seconds,
        )
        grade = calibrate_lens(request, Console())
    except (ValueError, OSError) as error:
        _fail(str(error))
    raise typer.Exit(1 if grade == FAIL else 0)


@calibrate.command()
def delay(
    config: Annotated[list[Path] | None, typer.Option("-c", "--config", help="Configuration file (TOML).")] = None,
    camera: Annotated[str, typer.Option(help="Which camera of the configuration.")] = "down",
    frames: Annotated[str | None, typer.Option(help="folder://DIR with times; absent: the live camera.")] = None,
    log: Annotated[Path | None, typer.Option(help="Telemetry log (.tlog) of the same time.")] = None,
    seconds: Annotated[float, typer.Option(help="How long to listen, live.")] = 20.0,
    gyro_cutoff_hz: Annotated[
        float, typer.Option(min=0.0, help="The vehicle's IMU_GYRO_CUTOFF, whose delay is made good; 0: no filter.")
    ] = 40.0,
) -> None:
    """Measure how late frames are stamped, against the gyro. Turn the vehicle to and fro, irregularly, before a far scene."""
    from companion.calibration.command import delay_lines, live_delay, recorded_delay
    from companion.config import load

    try:
        loaded = load(config or [])
        if camera not in loaded.cameras:
            _fail(f"--camera {camera!r}: the configuration has {', '.join(sorted(loaded.cameras))}")
        if (frames is None) != (log is None):
            _fail("--frames and --log belong together: the frames and the telemetry log of one recording")
        if frames is not None and log is not None:
            found = recorded_delay(loaded, camera, frames, log, gyro_cutoff_hz)
        else:
            found = live_delay(loaded, camera, seconds, gyro_cutoff_hz)
    except (ValueError, OSError) as error:
        _fail(str(error))
    for line in delay_lines(found, camera):
        typer.echo(line)
    raise typer.Exit(1 if found.estimate.why_not else 0)


def _fail(text: str) -> NoReturn:
    typer.echo(f"companion: {text}", file=sys.stderr)
    raise typer.Exit(2)
