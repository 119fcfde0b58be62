"""`kim`: landing by a red target in a fisheye (Kim et al., IROS 2014). Colour filter, geolocation, filter, L1, ramp.

The paper shows plots only, so most rows have nothing printed; what its text states is compared. Lengths in m, angles in
degrees where a row says so. Called through papers.py.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from companion.config import Config
from companion.geometry import horizontal_norm, rotate
from companion.messages import CameraImage, PadBearing, Phase
from companion.mount import mounted
from companion.reproduce.flight_rows import error_row, landed_row, phase_bands
from companion.reproduce.row import Reproduction, Row, number_row, said_row
from companion.reproduce.watched_flight import Instant, WatchedFlight, preset, watched
from companion.telemetry.svg_plot import Chart, Line
from companion.vision import DETECTORS
from companion.vision.colour import MAX_GREEN, RED_GAIN, RED_OFFSET
from companion.vision.lens import from_config
from sitl_stub.camera.camera import Camera
from sitl_stub.camera.projection import Intrinsics
from sitl_stub.camera.scene import CameraView, Scene
from sitl_stub.camera.spec import CameraSpec
from sitl_stub.scenario import Pad as ScenarioPad
from sitl_stub.scenario import Scenario, load_pad

Array = npt.NDArray[np.float64]

HEIGHTS_M = (0.5, 1.0, 2.0, 3.0, 5.0, 8.0)
ATTITUDE_ERROR_DEG = 1.0
"""The paper's attitude is about 1 degree off during the whole flight."""
SPEED_FOUND_M_S, HELD_S = 0.25, 2.0
WIND_M_S, GUST_SIGMA_M_S = 7.0, 2.0
SETTLED_S = 6.0
SPEED_M_S, LONGEST_DELAY_S = 0.8, 5.0
STAYS = {"mission.follow_time_s": 100.0}
LOW = {"mission.follow_height_m": 1.5, "mission.approach_height_m": 3.0}
"""A shorter ramp, for the quick part."""
FOLLOWING = (Phase.FOLLOW, Phase.DESCEND, Phase.COMMIT)
NOTES = (
    "The paper prints neither its K and C, nor the lens's coefficients, nor its gains: what is taken instead stands here.",
    f"Colour filter: red where R >= {RED_GAIN:g} (G + B) + {RED_OFFSET:g} and not G > {MAX_GREEN:g} R; largest patch.",
    "Lens: f(rho) = 160 - 0.002 rho^2 px, about 160 degrees across the image's height; the target is a disc of 1 m.",
    f"Geolocation is measured with perfect attitude and with a tilt {ATTITUDE_ERROR_DEG:g} degree off, offsets of up to "
    "one height to the side; with the tilt error it grows in proportion to the height, as the paper finds. The middle of a large "
    "patch in a fisheye is not the image of the target's middle: the patch's outline is laid on the level ground first, and the "
    "middle taken there.",
    "The paper's speed statement is about two curves: the vehicle's speed comes about 2 s behind the estimated speed of the target. "
    "So it is measured here as a delay: the target stands, drives at 0.8 m/s and stands again under a vehicle that stays above it, "
    "and the delay is the shift in time with which the vehicle's true velocity is nearest to the filter's velocity of the target.",
    "How soon the filter knows the speed the paper does not say. Here it is its velocity relative to the vehicle, since the "
    "autopilot's own is off by up to 0.3 m/s, and with it the target's. How soon the vehicle is at that speed depends on how far away it began, here 6 m.",
    "L1: PX4's velocity loop integrates, so steady wind costs little with or without it; what L1 can take is gusts. Its "
    "compensation is sent as acceleration, beside the velocity.",
    "The filter's state is the pad in a frame that moves with the vehicle's own velocity: the paper's relative state and its "
    "velocity input, written once. The height above the ground comes from the range sensor.",
    "The ramp is the mission's last phase begun at 4 m. L1 off: the same law with nothing against wind but PX4's own loop.",
    "The rover of the paper is driven by hand; here it drives straight at 0.8 m/s with small wobbles.",
)


def reproduce(quick: bool) -> Reproduction:
    """Quick: geolocation on few frames and one landing. Full: also the speed's delay, and wind with and without L1."""
    config = preset("kim", LOW if quick else None)
    geolocation, chart = _geolocation_rows(config, 3 if quick else 20)
    flight = watched(config, "kim", seed=1, world={"duration_limit_s": 90.0})
    rows = [*geolocation, *_flight_rows(flight)]
    charts = [chart, *_flight_charts(flight)]
    if not quick:
        rows += _speed_rows((1, 2, 3))
        more, compared = _adaptive_rows((1, 2, 3))
        rows += more
        charts.append(compared)
    return Reproduction(
        key="kim",
        title="Kim et al. 2014: outdoor landing on a moving platform with an omnidirectional camera",
        rows=tuple(rows),
        figures=tuple(charts),
        errata=(),
        notes=NOTES,
    )


# -------------------------------------------------------------------------------------------------------- geolocation


@dataclass(frozen=True, slots=True)
class Located:
    """At one height: how many frames showed the target, and the errors of its place on the ground (perfect, tilted), m."""

    height_m: float
    seen: int
    asked: int
    exact_m: Array
    tilted_m: Array


def located(config: Config, height_m: float, count: int) -> Located:
    """Frames from that height above the deck, the target up to one height aside, each located on flat ground."""
    lens = config.cameras["down"]
    layout = load_pad(Scenario(pad=ScenarioPad(file="kim")))
    intrinsics = Intrinsics(lens.fx_px, lens.fy_px, lens.cx_px, lens.cy_px, lens.distortion)
    spec = CameraSpec(model=lens.model, intrinsics=intrinsics, colour=True, position_frd_m=(0.0, 0.0, 0.0))
    camera = Camera(spec, Scene(pad=layout))
    eye = DETECTORS["colour"](config.vision, config.pad, from_config(lens))
    q_BC = mounted(lens).q
    exact, tilted = [], []
    for k in range(count):
        rng = np.random.default_rng((8, round(100.0 * height_m), k))
        north, east = (float(value) for value in rng.uniform(-0.7, 0.7, 2) * height_m)
        view = CameraView(
            0, (north, east, -height_m - layout.deck_height_m), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, -layout.deck_height_m)
        )
        seen = eye.detect(CameraImage(0, "down", camera.render(view, rng), 0), None)
        if not isinstance(seen, PadBearing):
            continue
        ray = rotate(q_BC, seen.bearing_camera)
        exact.append(_miss_m(ray, height_m, (north, east), 0.0))
        tilted.append(_miss_m(ray, height_m, (north, east), math.radians(ATTITUDE_ERROR_DEG)))
    return Located(height_m, len(exact), count, np.array(exact), np.array(tilted))


def _miss_m(ray: tuple[float, float, float], height_m: float, vehicle_m: tuple[float, float], tilt_rad: float) -> float:
    """Of the place where the ray, turned about east by `tilt_rad`, meets the deck's plane; the target is at the origin."""
    cos, sin = math.cos(tilt_rad), math.sin(tilt_rad)
    x, y, z = cos * ray[0] + sin * ray[2], ray[1], cos * ray[2] - sin * ray[0]
    return math.hypot(vehicle_m[0] + height_m * x / z, vehicle_m[1] + height_m * y / z)


def _geolocation_rows(config: Config, count: int) -> tuple[list[Row], Chart]:
    found = [located(config, height, count) for height in HEIGHTS_M]
    seen, asked = sum(one.seen for one in found), sum(one.asked for one in found)
    rows = [number_row("Colour filter", f"target found (n = {asked})", None, round(100.0 * seen / asked, 1), "%", 0.0)]
    table = f"Geolocation error by height above the target (n = {count} each)"
    for one in found:
        for name, miss in (("perfect attitude", one.exact_m), ("1 degree off", one.tilted_m)):
            value = float(miss.mean()) if len(miss) else math.nan
            rows.append(number_row(table, f"{one.height_m:g} m, {name}", None, round(value, 4), "m", 0.0))
    shares = [float(one.tilted_m.mean()) / one.height_m for one in found if len(one.tilted_m)]
    rows.append(
        said_row(
            table,
            "error over height, 1 degree off",
            "constant",
            f"{min(shares):.3f} to {max(shares):.3f}",
            holds=max(shares) < 2.0 * min(shares),
        )
    )
    lines = tuple(
        Line(name, colour, HEIGHTS_M, [float(miss.mean()) if len(miss) else None for miss in misses])
        for name, colour, misses in (
            ("perfect attitude", "#0a7", [one.exact_m for one in found]),
            ("1 degree off", "#c33", [one.tilted_m for one in found]),
        )
    )
    return rows, Chart("Geolocation error", "height m", "m", lines)


# -------------------------------------------------------------------------------------------------------------- flight


def _flight_rows(flight: WatchedFlight) -> list[Row]:
    table = "Landing on a rover at 0.8 m/s (n = 1)"
    rows = [
        landed_row(table, flight),
        error_row(table, flight),
        number_row(
            table,
            "filter's velocity of the target off by, about 2 s after the first bearing",
            None,
            round(velocity_error_m_s(flight, 2.0), 2),
            "m/s",
            0.0,
        ),
        number_row(
            table,
            f"and from when on by less than {SPEED_FOUND_M_S:g} m/s for {HELD_S:g} s",
            None,
            round(speed_found_after_s(flight), 1),
            "s",
            0.0,
        ),
        number_row(
            table, "6 m flown to it and at its speed after", None, round(speed_met_after_s(flight), 1), "s", 0.0
        ),
    ]
    ramp = [i for i in flight.watch.instants if i.phase is Phase.COMMIT and -i.in_pad_m[2] > 0.4]
    if len(ramp) > 20:
        slope = np.polyfit([i.t_s for i in ramp], [-i.in_pad_m[2] for i in ramp], 1)[0]
        rows.append(number_row(table, "ramp of the height", -0.1, round(float(slope), 3), "m/s", 0.02))
        high, low = _miss_between(ramp, 1.5, 9.0), _miss_between(ramp, 0.0, 1.0)
        if math.isnan(high):
            return rows
        shrinks = f"{high:.2f} m above 1.5 m, {low:.2f} m below 1 m"
        rows.append(said_row(table, "horizontal error shrinks with height", "yes", shrinks, holds=low < 0.9 * high))
    return rows


def _first_sight_s(flight: WatchedFlight) -> float:
    """From where the companion flies at the target: before, it was in view of a vehicle that stood."""
    begin = flight.watch.entered_s(Phase.FOLLOW)
    return math.nan if begin is None else begin


def velocity_errors_m_s(flight: WatchedFlight) -> list[tuple[float, float]]:
    """(time, how far the filter's horizontal velocity relative to the vehicle is from the true one), every tick."""
    truth, found = flight.watch.instants, flight.watch.relative_velocities
    times, at = [i.t_s for i in truth], [t_s for t_s, _ in found]
    north, east = (
        np.interp(at, times, [i.pad_velocity_m_s[axis] - i.velocity_m_s[axis] for i in truth]) for axis in range(2)
    )
    return [(t, math.hypot(v[0] - n, v[1] - e)) for (t, v), n, e in zip(found, north, east, strict=True)]


def velocity_error_m_s(flight: WatchedFlight, after_s: float) -> float:
    """Mean over the second around `after_s` after the first bearing."""
    sights = flight.watch.sights
    around = [e for t, e in velocity_errors_m_s(flight) if sights and abs(t - sights[0][0] - after_s) <= 0.5]
    return float(np.mean(around)) if around else math.nan


def speed_found_after_s(flight: WatchedFlight) -> float:
    """From the first bearing until the filter's relative velocity is true to SPEED_FOUND_M_S for HELD_S."""
    sights = flight.watch.sights
    if not sights:
        return math.nan
    good_since: float | None = None
    for t_s, away in velocity_errors_m_s(flight):
        good_since = (t_s if good_since is None else good_since) if away < SPEED_FOUND_M_S else None
        if good_since is not None and t_s - good_since >= HELD_S:
            return good_since - sights[0][0]
    return math.nan


def speed_met_after_s(flight: WatchedFlight) -> float:
    """From the beginning of the pursuit until the vehicle's speed is the target's to SPEED_FOUND_M_S for HELD_S."""
    begin = _first_sight_s(flight)
    since: float | None = None
    for i in flight.watch.instants:
        if i.t_s < begin:
            continue
        away = abs(horizontal_norm(i.velocity_m_s) - horizontal_norm(i.pad_velocity_m_s))
        since = (i.t_s if since is None else since) if away < SPEED_FOUND_M_S else None
        if since is not None and i.t_s - since >= HELD_S:
            return since - begin
    return math.nan


def _speed_rows(seeds: Sequence[int]) -> list[Row]:
    """A target that drives off under the vehicle, stops, and drives off again, as by hand."""
    world = {
        "path": {"kind": "stop_and_go", "speed_m_s": SPEED_M_S, "go_s": 6.0, "stop_s": 6.0, "start_fraction": 0.6},
        "place.pad_distance_m": 1.0,
        "duration_limit_s": 45.0,
    }
    config = preset("kim", STAYS)
    delays = [speed_delay_s(watched(config, "kim", seed=seed, world=world)) for seed in seeds]
    table = f"Speed of a target that drives and stops under the vehicle (n = {len(seeds)})"
    name = "vehicle's speed behind the target's estimated one, mean"
    return [number_row(table, name, 2.0, round(float(np.mean(delays)), 2), "s", 0.5, good=-1)]


def speed_delay_s(flight: WatchedFlight) -> float:
    """The shift in time with which the vehicle's true velocity is nearest to the filter's velocity of the target, from the
    moment at which it has settled above it."""
    truth, estimates = flight.watch.instants, flight.watch.estimates
    begin = _first_sight_s(flight) + SETTLED_S
    t_s = np.arange(begin + LONGEST_DELAY_S, truth[-1].t_s, 0.05)
    delays = np.arange(0.0, LONGEST_DELAY_S, 0.05)
    misses = np.zeros(len(delays))
    for axis in range(2):
        flown = np.interp(t_s, [i.t_s for i in truth], [i.velocity_m_s[axis] for i in truth])
        times, found = [t for t, _ in estimates], [e.velocity_ned_m_s[axis] for _, e in estimates]
        misses += [float(np.sum((flown - np.interp(t_s - delay, times, found)) ** 2)) for delay in delays]
    return float(delays[int(misses.argmin())])


def _miss_between(instants: Sequence[Instant], low_m: float, high_m: float) -> float:
    misses = [horizontal_norm(i.in_pad_m) for i in instants if low_m <= -i.in_pad_m[2] < high_m]
    return math.sqrt(float(np.mean(np.square(misses)))) if misses else math.nan


def _flight_charts(flight: WatchedFlight) -> list[Chart]:
    instants = flight.watch.instants
    t_s = [i.t_s for i in instants]
    bands = phase_bands(flight)
    speeds = (
        Line("vehicle", "#36c", t_s, [horizontal_norm(i.velocity_m_s) for i in instants]),
        Line("target", "#c33", t_s, [horizontal_norm(i.pad_velocity_m_s) for i in instants], dashed=True),
        Line(
            "target, filter", "#0a7",
            [t for t, _ in flight.watch.estimates[::5]],
            [math.hypot(*e.velocity_ned_m_s[:2]) for _, e in flight.watch.estimates[::5]],
        ),
    )  # fmt: skip
    height = Line("height", "#0a7", t_s, [-i.in_pad_m[2] for i in instants])
    away = Line("horizontal error", "#c33", t_s, [horizontal_norm(i.in_pad_m) for i in instants])
    track = (
        Line("vehicle", "#36c", [i.vehicle_m[1] for i in instants], [i.vehicle_m[0] for i in instants]),
        Line("target", "#c33", [i.pad_m[1] for i in instants], [i.pad_m[0] for i in instants], dashed=True),
    )
    return [
        Chart("Track from above", "east m", "north m", track, equal=True, height=360.0),
        Chart("Horizontal speed", "time s", "m/s", speeds, bands, width=760.0),
        Chart("Height and horizontal error", "time s", "m", (height, away), bands, width=760.0),
    ]


# ------------------------------------------------------------------------------------------------------------------ L1


def _adaptive_rows(seeds: Sequence[int]) -> tuple[list[Row], Chart]:
    """Horizontal error while the vehicle stays above the target, in gusts that PX4's integrator is too slow for."""
    world = {
        "wind.mean_m_s": WIND_M_S,
        "wind.gust_sigma_m_s": GUST_SIGMA_M_S,
        "path": {"kind": "still"},
        "carrier": {"kind": "still"},
        "place.pad_distance_m": 1.0,
        "duration_limit_s": 25.0,
    }
    off = {"control.controller": "velocity", "control.integral_gain_hz2": 0.0, "control.demand_time_s": 0.0}
    flights = {
        "with L1": [watched(preset("kim", STAYS), "kim", seed=seed, world=world) for seed in seeds],
        "without": [watched(preset("kim", {**STAYS, **off}), "kim", seed=seed, world=world) for seed in seeds],
    }
    table = f"Wind of {WIND_M_S:g} m/s, gusts of {GUST_SIGMA_M_S:g} m/s, above a still target (n = {len(seeds)} each)"
    errors = {name: float(np.mean([_error_m(flight) for flight in flown])) for name, flown in flights.items()}
    rows = [
        number_row(table, f"horizontal error {name}, rms", None, round(error, 3), "m", 0.0)
        for name, error in errors.items()
    ]
    said = f"{errors['with L1']:.2f} against {errors['without']:.2f} m"
    smaller = errors["with L1"] < 0.9 * errors["without"]
    rows.append(said_row(table, "L1 makes the error smaller", "yes", said, holds=smaller))
    lines = tuple(
        Line(name, colour, *_error_line(flights[name][0]))
        for name, colour in (("with L1", "#0a7"), ("without", "#c33"))
    )
    return rows, Chart(f"Horizontal error in wind of {WIND_M_S:g} m/s and gusts", "time s", "m", lines, width=760.0)


def _error_m(flight: WatchedFlight) -> float:
    settled = [i for i in flight.watch.instants if i.phase in FOLLOWING and i.t_s > SETTLED_S]
    return math.sqrt(float(np.mean([horizontal_norm(i.in_pad_m) ** 2 for i in settled]))) if settled else math.nan


def _error_line(flight: WatchedFlight) -> tuple[list[float], list[float | None]]:
    following = [i for i in flight.watch.instants if i.phase in FOLLOWING]
    return [i.t_s for i in following], [horizontal_norm(i.in_pad_m) for i in following]
