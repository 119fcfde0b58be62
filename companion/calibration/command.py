"""`companion calibrate board | lens | delay`: cameras, folders, files and the terminal around the maths beside this file."""

from __future__ import annotations

import asyncio
import math
import tempfile
import time
from collections.abc import AsyncGenerator
from contextlib import aclosing
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.live import Live

from companion.calibration.board import Board, squares
from companion.calibration.collect import Collection
from companion.calibration.gyro_log import gyro_record
from companion.calibration.sheet import laid_out, write
from companion.calibration.solve import Calibration, Model, calibrate
from companion.calibration.verdict import FAIL, Finding, judge, overall
from companion.config import Config
from companion.geometry import matrix_from_quaternion
from companion.io import camera_info
from companion.io.cameras import CameraFrame, CaptureClock, frames
from companion.io.links import open_link
from companion.io.tlog import TlogWriter
from companion.io.tlog_columns import TlogColumns
from companion.mount import mounted
from companion.vision.delay import DelayEstimate, ImageTurns, measure_delay
from companion.vision.lens import from_config

RECORDED = ("folder", "file")
ENOUGH_VIEWS = 40
REDRAW_S = 0.2
STYLES = {"pass": "green", "warn": "yellow", "fail": "bold red"}


@dataclass(frozen=True, slots=True)
class LensRequest:
    """What `calibrate lens` was asked."""

    source: str
    board: Board
    model: Model
    out: Path
    camera: str
    seconds: float


def write_board(board: Board, out: Path) -> str:
    """The sheet; a line that says what it is. ValueError where the suffix is unknown."""
    kind = f"{board.columns} x {board.rows} squares of {1000 * board.square_m:g} mm"
    name = f"{board.kind}, {kind}; print at 100 %"
    sheet = laid_out(squares(board), (board.columns * board.square_m, board.rows * board.square_m), name)
    write(sheet, out)
    return f"{out}: {board.kind}, {kind}, on {sheet.width_mm:g} x {sheet.height_mm:g} mm; measure the 100 mm line"


def calibrate_lens(request: LensRequest, console: Console) -> str:
    """Collect, solve, judge, write; the overall grade. ValueError or CameraError where it does not come to that."""
    collection = asyncio.run(_collect(request, console))
    if collection.coverage is None or collection.size is None:
        raise ValueError(f"{request.source}: no picture could be read")
    result = calibrate(collection.views, collection.size, request.model, request.camera)
    findings = judge(result, collection.coverage)
    _print_verdict(console, result, findings)
    grade = overall(findings)
    if grade == FAIL:
        console.print("not written: this lens would mislead a landing", style=STYLES[FAIL])
        return grade
    camera_info.write(request.out, result.info)
    console.print(
        f'written: {request.out}; in the configuration: [cameras.{request.camera}] calibration_file = "{request.out}"'
    )
    return grade


async def _collect(request: LensRequest, console: Console) -> Collection:
    is_live = request.source.partition(":")[0] not in RECORDED
    collection = Collection(request.board, is_live=is_live, is_round=request.model == "kannala_brandt")
    until = time.monotonic() + request.seconds if is_live else float("inf")
    with Live(console=console, auto_refresh=False, transient=not is_live) as live:
        drawn = 0.0
        async with aclosing(_stream(request.source, until)) as stream:
            async for frame in stream:
                # In a thread, so that the newest frame is there when this one is done with.
                await asyncio.to_thread(collection.add, frame.image(), frame.name)
                if time.monotonic() - drawn >= REDRAW_S:
                    drawn = time.monotonic()
                    live.update(progress(collection), refresh=True)
                if time.monotonic() > until or (is_live and _has_enough(collection)):
                    break
        live.update(progress(collection), refresh=True)
    return collection


async def _stream(url: str, until_s: float) -> AsyncGenerator[CameraFrame, None]:
    """Frames until that monotonic time, also where the camera goes silent before. An async generator that can be closed."""
    source = aiter(frames(url))
    while True:
        try:
            async with asyncio.timeout(max(0.0, until_s - time.monotonic()) if math.isfinite(until_s) else None):
                frame = await anext(source)
        except (StopAsyncIteration, TimeoutError):
            return
        yield frame


def _has_enough(collection: Collection) -> bool:
    return (
        len(collection.views) >= ENOUGH_VIEWS and collection.coverage is not None and not collection.coverage.missing()
    )


def progress(collection: Collection) -> str:
    """What the person with the board sees."""
    grid = collection.coverage.grid() if collection.coverage is not None else ""
    share = collection.coverage.fraction if collection.coverage is not None else 0.0
    return f"{grid}\n{len(collection.views)} views of {collection.pictures} pictures, {share:.0%} covered - {collection.said}"


def _print_verdict(console: Console, result: Calibration, findings: list[Finding]) -> None:
    lens = result.info
    console.print(
        f"{lens.model} {lens.width_px} x {lens.height_px}: f {lens.fx_px:.2f} {lens.fy_px:.2f} px, centre"
        f" {lens.cx_px:.2f} {lens.cy_px:.2f} px, distortion {' '.join(f'{k:.5f}' for k in lens.distortion)}"
    )
    for finding in findings:
        advice = f" - {finding.advice}" if finding.grade != "pass" and finding.advice else ""
        console.print(f"{finding.grade:5} {finding.name}: {finding.value}{advice}", style=STYLES[finding.grade])


# --------------------------------------------------------------------------------------------------------------- delay


@dataclass(frozen=True, slots=True)
class Measured:
    """A delay and whose stamps it is about."""

    estimate: DelayEstimate
    clock: CaptureClock


def recorded_delay(config: Config, camera: str, source: str, log: Path, gyro_cutoff_hz: float) -> Measured:
    """From frames and a telemetry log of the same time. ValueError or CameraError where they do not fit together."""
    collected, clock = asyncio.run(_turns(config, camera, source, float("inf")))
    return _compared(collected, clock, TlogColumns.read(log), config, gyro_cutoff_hz)


def live_delay(config: Config, camera: str, seconds: float, gyro_cutoff_hz: float) -> Measured:
    """From the configured camera and link, while somebody turns the vehicle to and fro."""
    return asyncio.run(_live_delay(config, camera, seconds, gyro_cutoff_hz))


async def _live_delay(config: Config, camera: str, seconds: float, gyro_cutoff_hz: float) -> Measured:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "heard.tlog"
        writer = TlogWriter(path)  # stamped on the monotonic clock, as live frames are
        async with open_link(config.link.url, lambda data: writer.write(time.monotonic_ns() // 1000, data)):
            collected, clock = await _turns(config, camera, config.cameras[camera].source, seconds)
        writer.close()
        return _compared(collected, clock, TlogColumns.read(path), config, gyro_cutoff_hz)


async def _turns(config: Config, camera: str, source: str, seconds: float) -> tuple[ImageTurns, CaptureClock]:
    R_BC = np.array(matrix_from_quaternion(mounted(config.cameras[camera]).q))
    collected = ImageTurns(from_config(config.cameras[camera]), R_BC)
    clock: CaptureClock | None = None
    until = time.monotonic() + seconds
    async with aclosing(_stream(source, until)) as stream:
        async for frame in stream:
            clock = frame.clock
            image = frame.image()
            if image is not None:
                await asyncio.to_thread(collected.add, frame.capture_ns / 1e9, image)
            if time.monotonic() > until:
                break
    if clock is None:
        raise ValueError(f"{source}: no frames")
    return collected, clock


def _compared(
    collected: ImageTurns, clock: CaptureClock, log: TlogColumns, config: Config, gyro_cutoff_hz: float
) -> Measured:
    gyro = gyro_record(log, clock, config.link.target_system, cutoff_hz=gyro_cutoff_hz)
    return Measured(measure_delay(collected.turns(), gyro.t_s, gyro.rates_rad_s), clock)


def delay_lines(measured: Measured, camera: str) -> list[str]:
    """What is printed."""
    found = measured.estimate
    figures = (
        f"delay {1000 * found.delay_s:.1f} ms +- {1000 * found.sigma_s:.1f} ms, correlation {found.correlation:.2f},"
        f" {found.turns} turns, {found.rate_rad_s:.2f} rad/s"
    )
    if found.why_not:
        return [figures if found.correlation else "no delay", f"not usable: {found.why_not}"]
    if measured.clock is CaptureClock.AUTOPILOT:
        return [
            figures,
            "this is the error of the capture times that the source sends; delay_s does not apply to those",
        ]
    if found.delay_s < 0.0:
        return [figures, "frames are stamped before they were taken: the clocks or the camera's own stamps are wrong"]
    return [figures, f"in the configuration: [cameras.{camera}] delay_s = {found.delay_s:.4f}"]
