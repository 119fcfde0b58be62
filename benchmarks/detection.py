"""The eyes, measured: detection rate, error and time against range, tilt, blur, light, occlusion and image size.

    python benchmarks/detection.py [--frames N] [--only NAME ...] [--write docs/vision.md]

Pictures come from the simulator's camera (noise, textured ground, motion blur), for the bias of the range also drawn four times as
large and averaged; the same frames go to every detector in the same run. Times are CPU time of one thread, the best of REPEATS runs of each frame; compare ratios, not machines. The AprilTag
library is measured where `pupil-apriltags` is installed (it is not a dependency). `--write` puts each table behind its
mark, `<!-- table NAME -->`, in the given file.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import msgspec
import numpy as np

from companion import config
from companion.geometry import Transform, matrix_from_quaternion, quaternion_from_euler, quaternion_from_matrix, rotate
from companion.messages import CameraImage, PadBearing, PadObservation
from companion.mount import mounted
from companion.vision import DETECTORS, DetectionHint, Detector, cross, pad_layout, pose
from companion.vision.lens import from_config
from companion.vision.search import shrunk
from companion.vision.stereo import less_uncertain, pnp_range, stereo_range
from sitl_stub.camera.camera import Camera
from sitl_stub.camera.light import Light, Patch, Shadow
from sitl_stub.camera.noise import add_noise
from sitl_stub.camera.projection import Intrinsics
from sitl_stub.camera.scene import CameraView, Scene
from sitl_stub.camera.spec import CameraSpec, Effects, stereo_pair
from sitl_stub.pad_layout import Marker, PadLayout

RANGES_M = (0.3, 0.5, 0.8, 1.2, 2.0, 3.0, 5.0, 8.0, 12.0, 16.0, 20.0, 25.0, 30.0)
SIZES = {
    "752 x 480": (752, 480, 420.0),
    "848 x 480": (848, 480, 422.0),
    "1280 x 720": (1280, 720, 700.0),
    "1920 x 1080": (1920, 1080, 1050.0),
}
REPEATS = 3
"""Of a frame, the shortest time counts: what else runs on the machine only lengthens it."""
NOISE = Effects(noise_sigma=3.0, shot_noise_sigma=3.0, softness_px=0.6)


# --------------------------------------------------------------------------------------------------------------- scenes


@dataclass(frozen=True)
class Setup:
    """A pad and a camera on both sides of the wire, each with its own reader of the same numbers."""

    sim_pad: PadLayout
    pad: config.Pad
    width_px: int = 752
    height_px: int = 480
    f_px: float = 420.0
    mount_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    colour: bool = False
    ground: str = "field"

    @property
    def camera(self) -> config.Camera:
        return config.Camera(
            width_px=self.width_px,
            height_px=self.height_px,
            fx_px=self.f_px,
            fy_px=self.f_px,
            cx_px=(self.width_px - 1) / 2.0,
            cy_px=(self.height_px - 1) / 2.0,
            mount_deg=self.mount_deg,
            position_frd_m=(0.0, 0.0, 0.0),
        )

    @property
    def spec(self) -> CameraSpec:
        lens = Intrinsics(self.f_px, self.f_px, (self.width_px - 1) / 2.0, (self.height_px - 1) / 2.0)
        return CameraSpec(
            width_px=self.width_px,
            height_px=self.height_px,
            intrinsics=lens,
            mount_deg=self.mount_deg,
            position_frd_m=(0.0, 0.0, 0.0),
            colour=self.colour,
            effects=NOISE,
        )


NESTED = Setup(PadLayout(), config.Pad())
APRILTAG = Setup(
    PadLayout(family="DICT_APRILTAG_36h11", markers=(Marker(5, 1.2),)),
    config.Pad(family="DICT_APRILTAG_36h11", markers=(config.Marker(id=5, size_m=1.2),)),
)
SMALL = Setup(PadLayout(markers=(Marker(45, 0.4),)), config.Pad(markers=(config.Marker(id=45, size_m=0.4),)))
CROSS = Setup(
    PadLayout(family="CIRCLE_CROSS", markers=(Marker(0, 1.2),)),
    config.Pad(family="CIRCLE_CROSS", markers=(config.Marker(id=0, size_m=1.2),)),
)
RED = Setup(
    PadLayout(family="RED_DISC", markers=(Marker(0, 1.2),)),
    config.Pad(family="RED_DISC", markers=(config.Marker(id=0, size_m=1.2),)),
    colour=True,
)
BOAT_MARKER = {"size_m": 0.4, "position_m": (0.75, 0.0), "facing": "back", "height_m": 0.35}
BOAT = Setup(
    PadLayout(length_m=1.2, width_m=0.7, deck_center_m=(0.15, 0.0), board_size_m=(0.7, 0.7), markers=(Marker(7, **BOAT_MARKER),)),  # type: ignore[arg-type]
    config.Pad(
        length_m=1.2, width_m=0.7, deck_center_m=(0.15, 0.0), board_size_m=(0.7, 0.7), markers=(config.Marker(id=7, **BOAT_MARKER),),  # type: ignore[arg-type]
    ),
    width_px=848,
    f_px=422.27,
    mount_deg=(0.0, 90.0, 0.0),
    ground="water",
)  # fmt: skip


@dataclass(frozen=True)
class Shot:
    """One frame with its truth, and what a tracker would have known before it."""

    frame: CameraImage
    X_CP: Transform
    prior: DetectionHint
    gravity: DetectionHint


class AreaCamera:
    """The same picture with every pixel averaged over its area: drawn four times as large, then reduced, softened and given noise.
    The simulator's own picture has one sample a pixel of a texture of about a texel a pixel, which moves small edges."""

    TIMES = 4

    def __init__(self, spec: CameraSpec, scene: Scene) -> None:
        lens, k = spec.intrinsics, self.TIMES
        self._spec = spec
        large = Intrinsics(lens.fx_px * k, lens.fy_px * k, (lens.cx_px + 0.5) * k - 0.5, (lens.cy_px + 0.5) * k - 0.5)
        clean = replace(spec.effects, noise_sigma=0.0, shot_noise_sigma=0.0, softness_px=0.0)
        size = {"width_px": spec.width_px * k, "height_px": spec.height_px * k}
        self._camera = Camera(replace(spec, intrinsics=large, effects=clean, **size), scene)  # type: ignore[arg-type]

    def render(self, view: CameraView, rng: np.random.Generator) -> Any:
        effects, size = self._spec.effects, (self._spec.width_px, self._spec.height_px)
        reduced = cv2.resize(self._camera.render(view, rng), size, interpolation=cv2.INTER_AREA)
        image = np.asarray(cv2.GaussianBlur(reduced, (0, 0), effects.softness_px), np.uint8)
        add_noise(image, effects.noise_sigma, effects.shot_noise_sigma, rng)
        return image


def shots(
    setup: Setup, range_m: float, count: int, *, seed: int = 1, camera: type[Any] = Camera, **conditions: Any
) -> Iterator[Shot]:
    """`count` frames from `range_m` above the landing point, offset and turned at random."""
    eye = camera(setup.spec, Scene(pad=setup.sim_pad, ground=setup.ground, ground_down_m=0.0))
    for k in range(count):
        rng = np.random.default_rng((seed, round(1000 * range_m), k))
        one = shot(setup, eye, rng, range_m, **conditions)
        yield replace(one, frame=replace(one.frame, sequence=k))


def shot(
    setup: Setup,
    camera: Camera | AreaCamera,
    rng: np.random.Generator,
    range_m: float,
    *,
    tilt_deg: float = 0.0,
    light: Light | None = None,
    covers: tuple[Patch, ...] = (),
    speed_m_s: float = 0.0,
) -> Shot:
    """A camera `range_m` from the landing point, which is seen within the middle third of the image."""
    offset = rng.uniform(-0.12, 0.12, 2) if range_m > 0.6 else rng.uniform(-0.03, 0.03, 2)
    pad_down_m = -setup.sim_pad.deck_height_m
    roll, pitch = rng.normal(0.0, 0.04, 2)
    view_tilt, direction = math.radians(tilt_deg), rng.uniform(-math.pi, math.pi)
    side = range_m * math.sin(view_tilt)
    p = (
        side * math.cos(direction) + offset[0] * range_m,
        side * math.sin(direction) + offset[1] * range_m,
        pad_down_m - range_m * math.cos(view_tilt),
    )
    q = (
        _looking_at_pad(p, pad_down_m, roll, pitch, rng.uniform(-math.pi, math.pi))
        if tilt_deg
        else quaternion_from_euler(roll, pitch, rng.uniform(-math.pi, math.pi))
    )
    yaw = rng.uniform(-math.pi, math.pi)
    q_WP = quaternion_from_euler(0.0, 0.0, yaw)
    view = CameraView(
        t_us=0, vehicle_position_ned_m=p, vehicle_q_ned_frd=q, deck_position_ned_m=(0.0, 0.0, pad_down_m), deck_q_ned_pad=q_WP,
        vehicle_velocity_ned_m_s=(speed_m_s * math.cos(direction), speed_m_s * math.sin(direction), 0.0),
        light=light or Light(), covers=covers,
    )  # fmt: skip
    return _with_priors(
        setup, camera.render(view, rng), Transform(q, p), Transform(q_WP, (0.0, 0.0, pad_down_m)), rng, range_m
    )


def _looking_at_pad(p: tuple[float, float, float], pad_down_m: float, roll: float, pitch: float, spin: float) -> Any:
    """Attitude of a vehicle whose down axis points at the pad (the mount looks down)."""
    down = np.array([-p[0], -p[1], pad_down_m - p[2]])
    down /= np.linalg.norm(down)
    ahead = np.cross(down, np.cross([math.cos(spin), math.sin(spin), 0.0], down))
    ahead /= np.linalg.norm(ahead)
    R = np.column_stack((ahead, np.cross(down, ahead), down))
    a, b, c = ((float(r[0]), float(r[1]), float(r[2])) for r in R)
    return quaternion_from_matrix((a, b, c))


def _with_priors(
    setup: Setup, image: Any, X_WB: Transform, X_WP: Transform, rng: np.random.Generator, range_m: float
) -> Shot:
    X_CW = (X_WB @ mounted(setup.camera)).inverse()
    X_CP = X_CW @ X_WP
    down = rotate(X_CW.q, (0.0, 0.0, 1.0))
    sigma_m = 0.02 + 0.003 * range_m
    error = rng.normal(0.0, sigma_m, 3)
    turn = quaternion_from_euler(*rng.normal(0.0, 0.015, 2), rng.normal(0.0, 0.03))
    predicted = Transform((Transform(turn) @ X_CP).q, tuple(float(v + e) for v, e in zip(X_CP.p, error, strict=True)))  # type: ignore[arg-type]
    return Shot(
        CameraImage(0, "bench", image, 0), X_CP, DetectionHint(predicted, sigma_m, down), DetectionHint(None, 1e3, down)
    )


# ------------------------------------------------------------------------------------------------------------ detectors


class Result(NamedTuple):
    """Errors are None where a detector has none: of the position, m; of the rotation, degrees; of the range, relative and signed."""

    found: bool
    error_m: float | None = None
    angle_deg: float | None = None
    range_error: float | None = None


Run = Callable[[Shot], Result]


@dataclass
class Tally:
    """What a detector did over many shots."""

    frames: int = 0
    found: int = 0
    times_ms: list[float] | Any = None
    errors_m: list[float] | Any = None
    angles_deg: list[float] | Any = None
    range_errors: list[float] | Any = None
    """Signed, relative."""

    def __post_init__(self) -> None:
        self.times_ms, self.errors_m, self.angles_deg, self.range_errors = [], [], [], []

    @property
    def rate(self) -> float:
        return 100.0 * self.found / max(1, self.frames)

    @property
    def mean_ms(self) -> float:
        return float(np.mean(self.times_ms))

    @property
    def p99_ms(self) -> float:
        return float(np.percentile(self.times_ms, 99))

    @property
    def error_m(self) -> float:
        return float(np.median(self.errors_m)) if self.errors_m else math.nan

    @property
    def angle_deg(self) -> float:
        return float(np.median(self.angles_deg)) if self.angles_deg else math.nan

    def add(self, run: Run, one: Shot) -> None:
        best, result = math.inf, Result(False)
        for _ in range(REPEATS):
            start = time.thread_time()
            result = run(one)
            best = min(best, time.thread_time() - start)
        self.frames += 1
        self.found += result.found
        self.times_ms.append(1e3 * best)
        if result.error_m is not None:
            self.errors_m.append(result.error_m)
        if result.angle_deg is not None:
            self.angles_deg.append(result.angle_deg)
        if result.range_error is not None:
            self.range_errors.append(result.range_error)


def ours(setup: Setup, detector: str, *, tracked: bool) -> Run:
    eye: Detector = DETECTORS[detector](config.Vision(), setup.pad, from_config(setup.camera))

    def run(one: Shot) -> Result:
        seen = eye.detect(one.frame, one.prior if tracked else one.gravity)
        if isinstance(seen, PadBearing):
            truth = np.array(one.X_CP.p) / np.linalg.norm(one.X_CP.p)
            angle = math.acos(min(1.0, float(truth @ seen.bearing_camera)))
            return Result(True, None, math.degrees(angle))
        if not isinstance(seen, PadObservation):
            return Result(False)
        error = float(np.linalg.norm(np.array(seen.pad_position_camera_m) - one.X_CP.p))
        if seen.q_camera_pad is None:
            return Result(error < 1.0 + 0.1 * float(np.linalg.norm(one.X_CP.p)), error)
        R, truth = (np.array(matrix_from_quaternion(q)) for q in (seen.q_camera_pad, one.X_CP.q))
        angle = math.degrees(pose.rotation_angle(R.T @ truth))
        return Result(True, error, angle, _range_error_of(seen.pad_position_camera_m, one))

    return run


def opencv_default(setup: Setup, *, subpix: bool = False) -> Run:
    """OpenCV's ArucoDetector as it comes, with IPPE on the largest marker of the pad that it found."""
    parameters = cv2.aruco.DetectorParameters()
    if subpix:
        parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    detector = cv2.aruco.ArucoDetector(pad_layout.dictionary(setup.pad.family), parameters)
    layout, lens = pad_layout.from_config(setup.pad), from_config(setup.camera)

    def run(one: Shot) -> Result:
        corners, ids, _ = detector.detectMarkers(_grey(one.frame.image))
        names = [] if ids is None else [int(i) for i in ids.reshape(-1)]
        known = [k for k, i in enumerate(names) if i in layout.corners_P]
        if not known:
            return Result(False)
        largest = max(known, key=lambda k: layout.size_m[names[k]])
        points = layout.corners_P[names[largest]]
        return _solved(points, corners[largest].reshape(4, 2).astype(float), lens, one)

    return run


@cache
def _library() -> Any:
    """One for all tables: it crashes where it is freed. None where it is not installed."""
    try:
        from pupil_apriltags import Detector as Library
    except ImportError:
        return None
    return Library(families="tag36h11", nthreads=1, quad_decimate=2.0)


def apriltag_library(setup: Setup) -> Run | None:
    library = _library()
    if library is None:
        return None
    layout, lens = pad_layout.from_config(setup.pad), from_config(setup.camera)

    def run(one: Shot) -> Result:
        for tag in library.detect(_grey(one.frame.image)):
            if tag.tag_id in layout.corners_P:
                # Its corners run the other way round from the bottom left, half a pixel off OpenCV's centres.
                corners = np.array(tag.corners)[::-1] - 0.5
                return _solved(layout.corners_P[tag.tag_id], corners, lens, one)
        return Result(False)

    return run


def _grey(image: Any) -> Any:
    return image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)


def _solved(points_P: Any, pixels: Any, lens: Any, one: Shot) -> Result:
    solved = pose.planar_pose(points_P, pixels, lens, hint=one.gravity, sigma_px=0.5)
    if solved is None:
        return Result(True)
    R, truth = (np.array(matrix_from_quaternion(q)) for q in (solved.q, one.X_CP.q))
    error = float(np.linalg.norm(np.array(solved.position_m) - one.X_CP.p))
    angle = math.degrees(pose.rotation_angle(R.T @ truth))
    return Result(True, error, angle, _range_error_of(solved.position_m, one))


def _range_error_of(position_m: Any, one: Shot) -> float:
    return float(np.linalg.norm(position_m) / np.linalg.norm(one.X_CP.p) - 1.0)


# --------------------------------------------------------------------------------------------------------------- tables


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = ["| " + " | ".join(head) + " |", "|" + " --- |" * len(head)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows])


def measured(runs: dict[str, Run], frames: Iterator[Shot]) -> dict[str, Tally]:
    tallies = {name: Tally() for name in runs}
    for one in frames:
        for name, run in runs.items():
            tallies[name].add(run, one)
    return tallies


def cell(tally: Tally) -> str:
    return f"{tally.rate:.0f} %, {_length(tally.error_m)}, {tally.mean_ms:.1f} ms"


def _length(metres: float) -> str:
    return "-" if math.isnan(metres) else f"{100.0 * metres:.1f} cm"


def _angle(degrees: float, digits: int) -> str:
    return "-" if math.isnan(degrees) else f"{degrees:.{digits}f} deg"


def by_range(frames: int) -> str:
    """Nested pad and AprilTag pad, 752 x 480: rate, median error, mean time."""
    text = []
    for title, setup in (("Nested ArUco pad (1.2 m and 0.24 m)", NESTED), ("AprilTag pad (36h11, 1.2 m)", APRILTAG)):
        runs = {
            "acquire": ours(setup, "aruco", tracked=False),
            "track": ours(setup, "aruco", tracked=True),
            "OpenCV default": opencv_default(setup),
            "OpenCV subpix": opencv_default(setup, subpix=True),
        }
        library = apriltag_library(setup) if setup is APRILTAG else None
        if library is not None:
            runs["pupil-apriltags"] = library
        results = {
            range_m: measured(runs, shots(setup, range_m, frames))
            for range_m in RANGES_M
            if setup is NESTED or range_m >= 1.2
        }
        rows = [[f"{range_m:g} m", *(cell(tally) for tally in found.values())] for range_m, found in results.items()]
        mean = {name: float(np.mean([found[name].mean_ms for found in results.values()])) for name in runs}
        rows.append(["mean time", *(f"{ms:.2f} ms, 1/{mean['OpenCV default'] / ms:.1f}" for ms in mean.values())])
        text.append(f"### {title}, 752 x 480, {frames} frames a row\n\n" + table(["range", *runs], rows))
    return "\n\n".join(text)


def bias(frames: int) -> str:
    """Mean and scatter of the range's relative error on pictures averaged by area, and ours on the simulator's own pictures."""
    text = []
    for title, setup in (("nested ArUco pad", NESTED), ("AprilTag pad", APRILTAG)):
        area = {"track": ours(setup, "aruco", tracked=True), "OpenCV default": opencv_default(setup)}
        area["OpenCV subpix"] = opencv_default(setup, subpix=True)
        library = apriltag_library(setup) if setup is APRILTAG else None
        if library is not None:
            area["pupil-apriltags"] = library
        rows = []
        for range_m in (3.0, 5.0, 8.0, 12.0, 14.0, 16.0, 20.0, 25.0, 30.0):
            averaged = measured(area, shots(setup, range_m, 2 * frames, camera=AreaCamera)).values()
            as_drawn = measured({"": area["track"]}, shots(setup, range_m, 2 * frames))[""]
            side = f"{setup.f_px * setup.pad.markers[0].size_m / range_m:.0f} px"
            rows.append([f"{range_m:g} m", side, *(_range_error(tally) for tally in (*averaged, as_drawn))])
        head = ["range", "side", *area, "track, the simulator's own pictures"]
        text.append(
            f"### Range error, mean ± standard deviation of a frame, {title}, {2 * frames} frames a row averaged by area\n\n"
            + table(head, rows)
        )
    return "\n\n".join(text)


def _range_error(tally: Tally) -> str:
    if not tally.range_errors:
        return "-"
    return f"{100.0 * np.mean(tally.range_errors):+.2f} ± {100.0 * np.std(tally.range_errors):.2f} %"


def by_range_and_size(frames: int) -> str:
    """Rate and median error of each detector on its own pad, tracked, at every range and image size."""
    text = []
    for title, setup, detector in (
        ("`aruco`, nested pad", NESTED, "aruco"),
        ("`aruco`, AprilTag pad", APRILTAG, "aruco"),
        ("`cross`", CROSS, "cross"),
        ("`colour`", RED, "colour"),
    ):
        setups = [replace(setup, width_px=w, height_px=h, f_px=f) for w, h, f in SIZES.values()]
        runs = [(sized, ours(sized, detector, tracked=True)) for sized in setups]
        rows = []
        for range_m in RANGES_M:
            tallies = [measured({"": run}, shots(sized, range_m, frames))[""] for sized, run in runs]
            rows.append([f"{range_m:g} m", *(_rate_and_error(tally) for tally in tallies)])
        text.append(
            f"### {title}: rate and error by image size, {frames} frames a row\n\n" + table(["range", *SIZES], rows)
        )
    return "\n\n".join(text)


def _rate_and_error(tally: Tally) -> str:
    if tally.errors_m or not tally.angles_deg:
        return f"{tally.rate:.0f} %, {_length(tally.error_m)}"
    return f"{tally.rate:.0f} %, {_angle(tally.angle_deg, 2)}"


def by_size(frames: int) -> str:
    """Time against image size, each detector over its own pad, at 1.5 to 20 m."""
    pads: tuple[tuple[str, Setup, str], ...] = (
        ("nested ArUco pad", NESTED, "aruco"),
        ("AprilTag pad", APRILTAG, "aruco"),
        ("circle and cross", CROSS, "cross"),
        ("red disc", RED, "colour"),
    )
    return "\n\n".join(_by_size(title, setup, detector, frames) for title, setup, detector in pads)


def _by_size(title: str, pad: Setup, detector: str, frames: int) -> str:
    rows = []
    for name, (width, height, f_px) in SIZES.items():
        setup = replace(pad, width_px=width, height_px=height, f_px=f_px)
        runs = {"acquire": ours(setup, detector, tracked=False), "track": ours(setup, detector, tracked=True)}
        if detector == "aruco":
            runs["OpenCV default"] = opencv_default(setup)
        library = apriltag_library(setup) if pad is APRILTAG else None
        if library is not None:
            runs["pupil-apriltags"] = library
        tallies = {key: Tally() for key in runs}
        for range_m in (1.5, 4.0, 10.0, 20.0):
            for one in shots(setup, range_m, max(4, frames // 4)):
                for key, run in runs.items():
                    tallies[key].add(run, one)
        rows.append([name, *(_time(tally, tallies.get("OpenCV default")) for tally in tallies.values())])
    heading = f"### Time by image size, {title}, 1.5 to 20 m (mean / p99"
    heading += ", ratio to OpenCV's default, rate)" if detector == "aruco" else ", rate)"
    return heading + "\n\n" + table(["image", *runs], rows)


def _time(tally: Tally, opencv: Tally | None) -> str:
    ratio = f", 1/{opencv.mean_ms / tally.mean_ms:.1f}" if opencv is not None else ""
    return f"{tally.mean_ms:.2f} / {tally.p99_ms:.2f} ms{ratio}, {tally.rate:.0f} %"


CONDITIONS: dict[str, dict[str, Any]] = {
    "as is": {},
    "tilt 20 deg": {"tilt_deg": 20.0},
    "tilt 40 deg": {"tilt_deg": 40.0},
    "tilt 60 deg": {"tilt_deg": 60.0},
    "4 m/s sideways (3 ms exposure)": {"speed_m_s": 4.0},
    "12 m/s sideways": {"speed_m_s": 12.0},
    "overexposed x 1.6": {"light": Light(brightness=1.6)},
    "dusk x 0.25": {"light": Light(brightness=0.25, noise_gain=1.5)},
    "night x 0.09": {"light": Light(brightness=0.09, noise_gain=2.5)},
    "shadow across the pad": {"light": Light(shadow=Shadow(0.4, 0.1))},
    "leaf on an edge": {"covers": (Patch((0.55, 0.2), (0.12, 0.12), 0.5),)},
    "tarpaulin over a corner": {"covers": (Patch((0.6, 0.6), (0.5, 0.5), 0.0),)},
}


def by_condition(frames: int) -> str:
    """Every detector on its own pad at 6 m, one thing wrong at a time."""
    runs = {
        "aruco acquire": (NESTED, ours(NESTED, "aruco", tracked=False)),
        "aruco track": (NESTED, ours(NESTED, "aruco", tracked=True)),
        "OpenCV default": (NESTED, opencv_default(NESTED)),
        "cross": (CROSS, ours(CROSS, "cross", tracked=True)),
        "colour": (RED, ours(RED, "colour", tracked=True)),
    }
    rows = []
    for title, condition in CONDITIONS.items():
        cells = []
        for setup, run in runs.values():
            tally = measured({"": run}, shots(setup, 6.0, frames, **condition))[""]
            bearing = setup is RED
            angle = _angle(tally.angle_deg, 2 if bearing else 1)
            error = angle if bearing else f"{_length(tally.error_m)}, {angle}"
            cells.append(f"{tally.rate:.0f} %, {error}")
        rows.append([title, *cells])
    return f"### One thing wrong, 6 m, 752 x 480, {frames} frames each\n\n" + table(["condition", *runs], rows)


def small_marker(frames: int) -> str:
    """The 0.4 m marker alone at 752 x 480, f = 420 px."""
    runs = {
        "acquire": ours(SMALL, "aruco", tracked=False),
        "track": ours(SMALL, "aruco", tracked=True),
        "OpenCV default": opencv_default(SMALL),
    }
    rows = []
    for range_m in (4.0, 8.0, 10.0, 12.0, 14.0):
        found = measured(runs, shots(SMALL, range_m, 4 * frames))
        rows.append([f"{range_m:g} m", f"{420 * 0.4 / range_m:.0f} px", *(f"{t.rate:.1f} %" for t in found.values())])
    return f"### Marker of 0.4 m, {4 * frames} frames a row\n\n" + table(["range", "side", *runs], rows)


def flips(frames: int) -> str:
    """10,000 ambiguous views: 12 to 40 px, up to 40 degrees, 0.25 px of noise, gravity known to 1.5 degrees."""
    corners = pad_layout.marker_corners(config.Marker(id=1, size_m=0.5))
    lens = from_config(config.Camera())
    counts = {"gravity": [0, 0], "gravity and track": [0, 0]}
    ambiguous = 0
    views = 10_000
    for k in range(views):
        rng = np.random.default_rng((9, k))
        R, p, pixels, down = _ambiguous_view(rng, corners, lens)
        lately = Transform(_quaternion(cv2.Rodrigues(rng.normal(0.0, 0.05, 3))[0] @ R), tuple(p.tolist()))
        blind = pose.planar_pose(corners, pixels, lens, hint=None, sigma_px=0.3)
        ambiguous += blind is not None and blind.q_alternative is not None
        for name, hint in (
            ("gravity", DetectionHint(None, 0.5, down)),
            ("gravity and track", DetectionHint(lately, 0.5, down)),
        ):
            found = pose.planar_pose(corners, pixels, lens, hint=hint, sigma_px=0.3)
            if found is not None and blind is not None and _is_flipped(found, (blind.q, blind.q_alternative), R):
                counts[name][found.q_alternative is not None] += 1
    rows = [[name, str(certain), str(admitted)] for name, (certain, admitted) in counts.items()]
    head = ["known beforehand", "flips accepted", "flips reported as ambiguous"]
    return f"### Planar ambiguity: {views} views, {ambiguous} of them ambiguous by their corners alone\n\n" + table(
        head, rows
    )


def flips_in_pictures(frames: int) -> str:
    """The same through the whole detector: 0.4 m marker of 12 to 40 px in pictures, up to 40 degrees, with its hint."""
    views = 11_000  # more than 10,000 of them ambiguous
    head = ["seed", "with a pose", "ambiguous by their corners alone", "flips accepted", "flips reported as ambiguous"]
    rows = [[str(seed), *(str(count) for count in _flips_of(seed, views))] for seed in (10, 11)]
    return f"### Planar ambiguity in pictures: {views} views a row, gravity and track known\n\n" + table(head, rows)


def _flips_of(seed: int, views: int) -> tuple[int, int, int, int]:
    eye = DETECTORS["aruco"](config.Vision(), SMALL.pad, from_config(SMALL.camera))
    camera = Camera(SMALL.spec, Scene(pad=SMALL.sim_pad, ground=SMALL.ground, ground_down_m=0.0))
    seen = ambiguous = accepted = admitted = 0
    for k in range(views):
        rng = np.random.default_rng((seed, k))
        one = shot(SMALL, camera, rng, float(rng.uniform(4.2, 14.0)), tilt_deg=float(rng.uniform(1.0, 40.0)))
        blind, found = eye.detect(one.frame, None), eye.detect(one.frame, one.prior)
        if not (isinstance(blind, PadObservation) and isinstance(found, PadObservation)):
            continue
        assert found.q_camera_pad is not None
        assert found.rotation_covariance_rad2 is not None
        seen += 1
        ambiguous += blind.q_camera_pad_alternative is not None
        both = (blind.q_camera_pad, blind.q_camera_pad_alternative)
        certain = pose.PlanarPose(
            found.pad_position_camera_m,
            found.q_camera_pad,
            found.position_covariance_m2,
            found.rotation_covariance_rad2,
            found.q_camera_pad_alternative,
            found.reprojection_error_px,
        )
        if _is_flipped(certain, both, np.array(matrix_from_quaternion(one.X_CP.q))):
            accepted += certain.q_alternative is None
            admitted += certain.q_alternative is not None
    return seen, ambiguous, accepted, admitted


def _is_flipped(found: pose.PlanarPose, both: Sequence[Any], R: Any) -> bool:
    """The other explanation is nearer to the truth, and the one taken is off by more than three sigma."""

    def error(q: Any) -> float:
        return pose.rotation_angle(np.array(matrix_from_quaternion(q)).T @ R)

    sigma = math.sqrt(sum(found.rotation_covariance_rad2[i][i] for i in range(3)))
    return error(found.q) > max(min(error(q) for q in both if q is not None) + 1e-3, 3.0 * sigma)


def _ambiguous_view(rng: np.random.Generator, corners: Any, lens: Any) -> tuple[Any, Any, Any, Any]:
    phi = rng.uniform(-math.pi, math.pi)
    R_CW = cv2.Rodrigues(rng.uniform(0.0, math.radians(40.0)) * np.array([math.cos(phi), math.sin(phi), 0.0]))[0]
    slope = cv2.Rodrigues(np.append(rng.normal(0.0, math.radians(2.0), 2), 0.0))[0]
    level = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    R = R_CW @ slope @ level @ cv2.Rodrigues(np.array([0.0, 0.0, rng.uniform(-math.pi, math.pi)]))[0]
    p = lens.ray(rng.uniform((60.0, 60.0), (690.0, 420.0))[None])[0] * 420.0 * 0.5 / rng.uniform(12.0, 40.0)
    pixels = lens.project(corners @ R.T + p) + rng.normal(0.0, 0.25, (4, 2))
    down = R_CW @ cv2.Rodrigues(np.append(rng.normal(0.0, math.radians(1.5), 2), 0.0))[0] @ (0.0, 0.0, 1.0)
    return R, p, pixels, tuple(float(v) for v in down)


def _quaternion(R: Any) -> Any:
    a, b, c = ((float(r[0]), float(r[1]), float(r[2])) for r in R)
    return quaternion_from_matrix((a, b, c))


def hand_over(frames: int) -> str:
    """A descent over the nested pad from 4 m to 0.35 m, tracked: the largest step of the error between frames."""
    camera, eye = (
        Camera(NESTED.spec, Scene(pad=NESTED.sim_pad, ground="field")),
        DETECTORS["aruco"](config.Vision(), NESTED.pad, from_config(NESTED.camera)),
    )
    errors, angles, seen = [], [], []
    for range_m in np.geomspace(4.0, 0.35, 120):
        rng = np.random.default_rng((3, 0))  # the same offset and attitude in every frame: only the height changes
        one = shot(NESTED, camera, rng, float(range_m))
        got = eye.detect(one.frame, one.prior)
        if isinstance(got, PadObservation) and got.q_camera_pad is not None:
            errors.append(np.array(got.pad_position_camera_m) - one.X_CP.p)
            R, truth = (np.array(matrix_from_quaternion(q)) for q in (got.q_camera_pad, one.X_CP.q))
            angles.append(cv2.Rodrigues(R @ truth.T)[0][:, 0])
            seen.append(got.marker_ids)
    step = np.linalg.norm(np.diff(errors, axis=0), axis=1)
    turn = np.degrees(np.linalg.norm(np.diff(angles, axis=0), axis=1))
    changes = [k for k in range(1, len(seen)) if set(seen[k]) != set(seen[k - 1])]
    head = ["", "position", "rotation"]
    rows = [
        [
            "largest step where the markers in view change",
            f"{100 * max(step[k - 1] for k in changes):.2f} cm",
            f"{max(turn[k - 1] for k in changes):.2f} deg",
        ],
        ["largest step anywhere", f"{100 * step.max():.2f} cm", f"{turn.max():.2f} deg"],
    ]
    return (
        f"### Hand-over between scales: {len(seen)} of 120 frames from 4 m to 0.35 m, {len(changes)} changes\n\n"
        + table(head, rows)
    )


STAGES = {
    "find the ring": "threshold .87 ± .51, circle .06 ± .03",
    "refine its outline": "cross 1.81 ± 1.01",
    "one pose (48 points)": "PnP 4.95 ± 2.31",
    "whole detector": "total 12.04 ± 5.75",
}
"""Ours, and the paper's stages that do the nearest thing. Its quadrangle (4.35 ± 1.89) is ours' last resort and does not run here."""


def stages(frames: int) -> str:
    """Falanga's Table I beside ours: the same tag, 752 x 480."""
    run = ours(CROSS, "cross", tracked=False)
    times: dict[str, list[float]] = {name: [] for name in STAGES}
    for range_m in (2.0, 4.0, 8.0):
        for one in shots(CROSS, range_m, frames):
            _time_stages(one, run, times)
    rows = [[name, f"{np.mean(v):.2f} ± {np.std(v):.2f}", STAGES[name]] for name, v in times.items()]
    return (
        f"### Circle and cross, ms, {3 * frames} frames (quadrangle: only where ring and cross fail; the paper's 4.35 ± 1.89)\n\n"
        + table(["stage", "here", "the paper's nearest, on an onboard ARM computer"], rows)
    )


def _time_stages(one: Shot, run: Run, times: dict[str, list[float]]) -> None:
    image = one.frame.image
    found, shrink = [], 8
    while not found and shrink > 1:
        shrink //= 2
        found = _timed(times["find the ring"], cross.rings, shrunk(image, shrink))
    if found:
        centre, axes = (found[0][0] + 0.5) * shrink - 0.5, found[0][1] * shrink
        outline = _timed(times["refine its outline"], cross.refined_outline, image, centre, axes)
        angle = np.linspace(0.0, 2.0 * math.pi, len(outline), endpoint=False)
        points = 0.6 * np.column_stack((np.cos(angle), np.sin(angle), np.zeros(len(angle))))
        lens = from_config(CROSS.camera)
        _timed(times["one pose (48 points)"], pose.planar_pose, points, outline, lens, hint=one.gravity, sigma_px=0.3)
    _timed(times["whole detector"], run, one)


def _timed(times: list[float], call: Callable[..., Any], *arguments: Any, **keys: Any) -> Any:
    start = time.thread_time()
    result = call(*arguments, **keys)
    times.append(1e3 * (time.thread_time() - start))
    return result


STEREO_BASELINE_M = 0.05
FOCAL_ERROR = 0.005
"""Relative error of the calibrated focal length: what limits PnP once the corners have no bias."""
MISALIGNMENT_PX = 0.1
"""Disparity by which the pair is out of line."""


def stereo_table(frames: int) -> str:
    """Guo's experiment: the boat's marker from 50 to 850 cm, PnP and stereo."""
    left_spec, right_spec = stereo_pair(BOAT.spec, STEREO_BASELINE_M)
    scene = Scene(pad=BOAT.sim_pad, ground=BOAT.ground)
    cameras = Camera(left_spec, scene), Camera(right_spec, scene)
    lens = from_config(replace_lens(BOAT.camera, 1.0 + FOCAL_ERROR))
    eye = DETECTORS["vertical"](config.Vision(), BOAT.pad, lens)
    rows, pairs = [], []
    for range_cm in range(50, 851, 100):
        pnp_errors, stereo_errors, chosen = [], [], []
        for k in range(max(5, frames // 2)):
            rng = np.random.default_rng((5, range_cm, k))
            marker_x, height = 0.75, -BOAT.sim_pad.deck_height_m - 0.35
            p = (marker_x - range_cm / 100.0, float(rng.uniform(-0.05, 0.05)), height + float(rng.uniform(-0.05, 0.05)))
            view = CameraView(0, p, (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, -BOAT.sim_pad.deck_height_m))
            seen = [eye.detect(CameraImage(0, "front", camera.render(view, rng), 0), None) for camera in cameras]
            if not all(isinstance(one, PadObservation) for one in seen):
                continue
            left = seen[0]
            corners = [np.array(one.corners_px) for one in seen]  # type: ignore[union-attr]
            to_marker = np.array(left.pad_position_camera_m) + [0.0, 0.0, 0.75]  # type: ignore[union-attr]
            pnp = pnp_range(tuple(to_marker.tolist()), left.position_covariance_m2, relative_error=FOCAL_ERROR)  # type: ignore[union-attr, arg-type]
            stereo = stereo_range(
                corners[0], corners[1] - [MISALIGNMENT_PX, 0.0], lens,
                baseline_m=STEREO_BASELINE_M, sigma_px=0.05, misalignment_px=MISALIGNMENT_PX,
            )  # fmt: skip
            truth = range_cm / 100.0
            pnp_errors.append(pnp.range_m - truth)
            stereo_errors.append((stereo.range_m if stereo else math.inf) - truth)
            chosen.append(less_uncertain(pnp, stereo).method)
            pairs.append((truth, pnp_errors[-1], stereo_errors[-1]))
        if chosen:
            rows.append(
                [
                    f"{range_cm} cm",
                    f"{100 * np.mean(np.abs(pnp_errors)):.2f} cm",
                    f"{100 * np.mean(np.abs(stereo_errors)):.2f} cm",
                    f"{max(set(chosen), key=chosen.count)}",
                ]
            )
        else:
            rows.append([f"{range_cm} cm", "not seen", "not seen", "-"])
    text = f"### PnP and stereo on the upright marker, baseline {100 * STEREO_BASELINE_M:.0f} cm, focal length {100 * FOCAL_ERROR:.1f} % off, pair {MISALIGNMENT_PX} px out of line\n\n"
    return text + table(["range", "PnP mean absolute error", "stereo", "taken"], rows) + "\n\n" + _summary(pairs)


def replace_lens(camera: config.Camera, factor: float) -> config.Camera:
    return msgspec.structs.replace(camera, fx_px=camera.fx_px * factor, fy_px=camera.fy_px * factor)


def _summary(pairs: list[tuple[float, float, float]]) -> str:
    printed = {
        "all": ("35.23 / 51.04 / 5.38 %", "18.35 / 21.58 / 4.00 %"),
        "under 5 m": ("4.56 / 8.01 / 1.27 %", "9.33 / 10.78 / 3.83 %"),
    }
    rows = []
    for name, limit in (("all", 1e9), ("under 5 m", 5.0)):
        data = np.array([pair for pair in pairs if pair[0] < limit])
        cells = []
        for column in (2, 1):
            e = np.abs(data[:, column])
            cells.append(
                f"{100 * e.mean():.2f} / {100 * math.sqrt(np.mean(e**2)):.2f} / {100 * np.mean(e / data[:, 0]):.2f} %"
            )
        rows.append([name, cells[0], printed[name][0], cells[1], printed[name][1]])
    return table(["MAE cm / RMSE cm / MRE", "stereo here", "stereo, paper", "PnP here", "PnP, paper"], rows)


TABLES: dict[str, Callable[[int], str]] = {
    "range": by_range,
    "bias": bias,
    "size": by_size,
    "everywhere": by_range_and_size,
    "condition": by_condition,
    "small": small_marker,
    "flips": flips,
    "pictures": flips_in_pictures,
    "handover": hand_over,
    "stages": stages,
    "stereo": stereo_table,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=20, help="frames a row")
    parser.add_argument("--only", nargs="+", choices=TABLES, default=list(TABLES))
    parser.add_argument("--write", type=Path, help="put the tables into this file")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    for name in arguments.only:
        text = TABLES[name](arguments.frames)
        print(text, flush=True, end="\n\n")
        if arguments.write:
            page = arguments.write.read_text(encoding="utf-8")
            arguments.write.write_text(with_table(page, name, text), encoding="utf-8")


def with_table(page: str, name: str, text: str) -> str:
    """The page with the text between the table's mark and the next mark."""
    mark = f"<!-- table {name} -->"
    before, _, after = page.partition(mark)
    return f"{before}{mark}\n\n{text}\n\n{after[after.index('<!-- ') :]}"


if __name__ == "__main__":
    main()
