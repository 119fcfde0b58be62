"""Tables 3 to 5 of `guo`: range of the upright marker from 50 to 850 cm, by stereo and by PnP.

The simulator's two cameras, 50 mm apart (the paper prints no baseline), look at the boat's marker. Twice: with a perfect
calibration, and with the two calibration errors that the paper's own Table 3 shows, a marker taken too large and a pair
out of line; it is these that make stereo better near and PnP better far. Ranges in m. Called by guo.py.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import msgspec
import numpy as np
import numpy.typing as npt

from companion import config
from companion.messages import CameraImage, PadObservation
from companion.reproduce.row import Row, number_row
from companion.telemetry.svg_plot import Chart, Line
from companion.vision import DETECTORS
from companion.vision.lens import from_config
from companion.vision.stereo import stereo_range
from sitl_stub.camera.camera import Camera
from sitl_stub.camera.projection import Intrinsics
from sitl_stub.camera.scene import CameraView, Scene
from sitl_stub.camera.spec import CameraSpec, stereo_pair
from sitl_stub.scenario import Pad as ScenarioPad
from sitl_stub.scenario import Scenario, load_pad

Array = npt.NDArray[np.float64]

BASELINE_M = 0.05
TABLE_3: tuple[tuple[float, float, float], ...] = tuple(
    zip(
        range(50, 851, 50),
        (50, 100, 149, 201, 249, 300, 341, 387, 432, 465, 507, 547, 589, 625, 665, 701, 743),
        (53, 103, 155, 208, 257, 312, 361, 415, 470, 522, 573, 623, 674, 725, 784, 837, 890),
        strict=True,
    )
)
"""Truth, stereo, PnP as printed, cm."""
MARKER_AHEAD_M, MARKER_ABOVE_M = 0.75, 0.35
"""Of the landing point and over the deck (configs/pads/guo.toml)."""


@dataclass(frozen=True, slots=True)
class Calibration:
    """What is wrong with it: `marker_scale` is the size believed over the true one, `out_of_line_px` adds to the disparity."""

    name: str
    marker_scale: float = 1.0
    out_of_line_px: float = 0.0


@dataclass(frozen=True, slots=True)
class Ranges:
    """Truth and measured, m, (N,) each."""

    truth_m: Array
    stereo_m: Array
    pnp_m: Array


@dataclass(frozen=True, slots=True)
class Errors:
    """Mean absolute (m), root mean square (m) and mean relative error."""

    mae_m: float
    rmse_m: float
    mre: float


def printed_ranges() -> Ranges:
    """Table 3."""
    table = np.array(TABLE_3) / 100.0
    return Ranges(table[:, 0], table[:, 1], table[:, 2])


def errors(truth_m: Array, measured_m: Array) -> Errors:
    away = np.abs(measured_m - truth_m)
    return Errors(float(away.mean()), math.sqrt(float((away**2).mean())), float((away / truth_m).mean()))


def calibration_of_the_paper(focal_px: float) -> Calibration:
    """The two errors that Table 3 shows, as medians over its lines: a factor of the PnP ranges, an offset of the disparities."""
    printed = printed_ranges()
    scale = float(np.median(printed.pnp_m / printed.truth_m))
    offset = focal_px * BASELINE_M * (1.0 / printed.stereo_m - 1.0 / printed.truth_m)
    return Calibration("calibrated as Table 3 shows", scale, float(np.median(offset)))


def crossover_m(ranges: Ranges) -> float | None:
    """The nearest distance from which on PnP is better than stereo, at every distance; None where there is none."""
    truths = np.unique(ranges.truth_m)
    worse = [
        errors(ranges.truth_m[at], ranges.stereo_m[at]).mae_m > errors(ranges.truth_m[at], ranges.pnp_m[at]).mae_m
        for at in (ranges.truth_m == truth for truth in truths)
    ]
    last_better = max((i for i, is_worse in enumerate(worse) if not is_worse), default=-1)
    return float(truths[last_better + 1]) if last_better + 1 < len(truths) else None


class RangingBench:
    """The rig: marker, pair of cameras, detector."""

    def __init__(self, preset: config.Config) -> None:
        frame = preset.cameras[preset.vision.camera]
        self._lens = msgspec.structs.replace(frame, width_px=frame.width_px // 2)
        self._pad = preset.pad
        self._vision = preset.vision
        self.focal_px = self._lens.fx_px
        sim_pad = load_pad(Scenario(pad=ScenarioPad(file="guo")))
        self._deck_height_m = sim_pad.deck_height_m
        scene = Scene(pad=sim_pad, ground="water")
        self._cameras = [Camera(spec, scene) for spec in stereo_pair(self._spec(), BASELINE_M)]

    def _spec(self) -> CameraSpec:
        lens = self._lens
        intrinsics = Intrinsics(lens.fx_px, lens.fy_px, lens.cx_px, lens.cy_px, lens.distortion)
        return CameraSpec(
            "front", lens.model, lens.width_px, lens.height_px, intrinsics, (0.0, 0.0, 0.0), (0.0, 90.0, 0.0)
        )

    def measured(self, calibration: Calibration, frames: int) -> Ranges:
        """`frames` pairs at each of the paper's distances; where one of the two does not see the marker, the pair is left out."""
        found = [pair for truth, _, _ in TABLE_3 for pair in self._pairs(truth / 100.0, calibration, frames)]
        table = np.array(found)
        return Ranges(table[:, 0], table[:, 1], table[:, 2])

    def _pairs(self, truth_m: float, calibration: Calibration, frames: int) -> Iterator[tuple[float, float, float]]:
        marker = self._pad.markers[0]
        believed = msgspec.structs.replace(marker, size_m=marker.size_m * calibration.marker_scale)
        lens = from_config(self._lens)
        eye = DETECTORS["vertical"](self._vision, msgspec.structs.replace(self._pad, markers=(believed,)), lens)
        for k in range(frames):
            rng = np.random.default_rng((6, round(100.0 * truth_m), k))
            seen = [eye.detect(CameraImage(0, "front", image, 0), None) for image in self._images(truth_m, rng)]
            left, right = seen
            if not (isinstance(left, PadObservation) and isinstance(right, PadObservation)):
                continue
            stereo = stereo_range(
                np.array(left.corners_px), np.array(right.corners_px) - [calibration.out_of_line_px, 0.0], lens,
                baseline_m=BASELINE_M, sigma_px=0.05, misalignment_px=abs(calibration.out_of_line_px),
            )  # fmt: skip
            if stereo is not None:
                yield truth_m, stereo.range_m, left.pad_position_camera_m[2] + MARKER_AHEAD_M

    def _images(self, truth_m: float, rng: np.random.Generator) -> Iterator[npt.NDArray[np.uint8]]:
        """Left and right: the vehicle behind the marker, its nose at it, a hand's breadth off the line."""
        up, aside = (float(rng.uniform(-0.05, 0.05)) for _ in range(2))
        top = -self._deck_height_m
        position = (MARKER_AHEAD_M - truth_m, aside, top - MARKER_ABOVE_M + up)
        view = CameraView(0, position, (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, top))
        for camera in self._cameras:
            yield camera.render(view, rng)


def stereo_rows(preset: config.Config, quick: bool) -> tuple[list[Row], list[Chart]]:
    """Rows of Tables 4 and 5, the erratum recomputed from Table 3, and Fig. 8."""
    bench = RangingBench(preset)
    frames = 2 if quick else 10
    paper = calibration_of_the_paper(bench.focal_px)
    as_paper = bench.measured(paper, frames)
    perfect = bench.measured(Calibration("perfect calibration"), frames)
    rows = [*_table_rows(paper.name, as_paper, judged=True), *_crossover_rows(as_paper)]
    rows += _table_rows("perfect calibration", perfect, judged=False)
    rows += _erratum_rows()
    return rows, [_chart("Range error, calibrated as Table 3 shows", as_paper), _chart("Range error, perfect", perfect)]


PRINTED: dict[tuple[str, str], tuple[float, float, float]] = {
    ("Table 4, 50 to 850 cm", "stereo"): (35.23, 51.04, 5.38),
    ("Table 4, 50 to 850 cm", "PnP"): (18.35, 21.58, 4.00),
    ("Table 5, under 5 m", "stereo"): (4.56, 8.01, 1.27),
    ("Table 5, under 5 m", "PnP"): (9.33, 10.78, 3.83),
}
"""MAE cm, RMSE cm, MRE %."""


def _table_rows(calibration: str, found: Ranges, *, judged: bool) -> list[Row]:
    rows = []
    for (table, method), printed in PRINTED.items():
        near = found.truth_m < (5.0 if "5 m" in table else math.inf)
        e = errors(found.truth_m[near], (found.stereo_m if method == "stereo" else found.pnp_m)[near])
        ours = (100.0 * e.mae_m, 100.0 * e.rmse_m, 100.0 * e.mre)
        for name, unit, print_, value in zip(("MAE", "RMSE", "MRE"), ("cm", "cm", "%"), printed, ours, strict=True):
            label = f"{method} {name}, {calibration}"
            rows.append(
                number_row(table, label, print_ if judged else None, round(value, 2), unit, 0.3 * print_, good=-1)
            )
    return rows


def _crossover_rows(found: Ranges) -> list[Row]:
    cross = crossover_m(found)
    ours: float | str = "none" if cross is None else cross
    fits = cross is not None and 4.0 <= cross <= 6.0
    return [
        Row(
            "Fig. 8",
            "PnP better from",
            crossover_m(printed_ranges()),
            ours,
            "m",
            "4 to 6",
            "same" if fits else "differs",
        )
    ]


def _erratum_rows() -> list[Row]:
    """The printed stereo MAE against the one that follows from the printed Table 3."""
    printed, rows = printed_ranges(), []
    for table, limit, mae in (("Table 4", math.inf, 35.23), ("Table 5", 5.0, 4.56)):
        near = printed.truth_m < limit
        ours = 100.0 * errors(printed.truth_m[near], printed.stereo_m[near]).mae_m
        rows.append(number_row(table, "stereo MAE recomputed from Table 3", mae, round(ours, 2), "cm", 0.3))
    return rows


def _chart(title: str, found: Ranges) -> Chart:
    truths = np.unique(found.truth_m)
    lines = []
    for name, measured, colour in (("stereo", found.stereo_m, "#c33"), ("PnP", found.pnp_m, "#36c")):
        mean = [100.0 * errors(found.truth_m[at], measured[at]).mae_m for at in (found.truth_m == t for t in truths)]
        lines.append(Line(name, colour, truths.tolist(), mean))
    printed = printed_ranges()
    for name, measured, colour in (("stereo, paper", printed.stereo_m, "#e99"), ("PnP, paper", printed.pnp_m, "#9be")):
        away = (100.0 * np.abs(measured - printed.truth_m)).tolist()
        lines.append(Line(name, colour, printed.truth_m.tolist(), away, dashed=True))
    return Chart(title, "distance m", "mean absolute error cm", tuple(lines), width=760.0)
