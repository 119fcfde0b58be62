"""The paper `shivam`: fourth-order Bezier landing curve, its four tables and cases, the heading loop, and flights.

Plane of the paper: x, y in metres, headings from x towards y in degrees, pad at the origin, 1 m/s. The loop is the paper's:
r' = V cos(chi - theta), theta' = (V / r) sin(chi - theta), chi' = k (chi_d - chi), chi_d the tangent's heading where the arc
length is V t. Flown in the simulator, x is north and y east.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from companion.campaign.engine import Row as FlightRow
from companion.geometry import wrap_pi
from companion.messages import Vec3
from companion.planning.bezier import ArcLength, BezierCurve, arc_length, landing_curve
from companion.reproduce.flights import flight, flown
from companion.reproduce.row import Reproduction, Row, number_row
from companion.telemetry.report import BLUE, GREEN, GREY, ORANGE, RED
from companion.telemetry.svg_plot import Chart, Line

SPEED_M_S = 1.0
GAIN_HZ = 20.0
"""k of the heading loop; the paper prints none."""
TABLE_LEVELS = 10
"""n of the 2^n sub-intervals of the arc length table; the paper prints none."""
STEP_S = 0.01
STOP_M = 0.02
"""Nearer to the pad than this the polar kinematics divide by next to nothing."""
SAMPLES = 20_001
TOUCH_M = 0.1
COLOURS = (BLUE, ORANGE, GREEN, RED, GREY)
PURPLE = "#9333ea"
WIDE, TALL = 780.0, 400.0
"""Five names stand beside a title."""

LENGTHS = "Arc length (`printed`: computed beforehand, see above)"
BENDS = "Peak curvature (`printed`: computed beforehand, see above)"

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Case:
    """One line of a table: what goes in, and what is printed of the control points (None: not printed there)."""

    number: int
    name: str
    start_m: Point
    heading_deg: float
    ratio: float
    p1: tuple[str, str] | None
    p2: tuple[str, str] | None
    p3: tuple[str, str] | None
    length_m: float
    curvature_1_m: float


TABLES = {1: "Table I (case 1)", 2: "Table II (case 2)", 3: "Table III (case 3)", 4: "Table IV (case 4)"}
_TEN = (10.0, 10.0)
CASES = (
    Case(1, "a = 0.5", _TEN, -180.0, 0.5, ("5", "10"), ("0", "10"), ("0", "5"), 17.114, 0.2121),
    Case(2, "a = 0.1", _TEN, -180.0, 0.1, ("9", "10"), None, ("0", "9"), 17.437, 0.2753),
    Case(2, "a = 0.3", _TEN, -180.0, 0.3, ("7", "10"), None, ("0", "7"), 17.196, 0.2319),
    Case(2, "a = 0.5", _TEN, -180.0, 0.5, ("5", "10"), None, ("0", "5"), 17.114, 0.2121),
    Case(2, "a = 0.7", _TEN, -180.0, 0.7, ("3", "10"), None, ("0", "3"), 17.196, 0.2319),
    Case(2, "a = 0.9", _TEN, -180.0, 0.9, ("1", "10"), None, ("0", "1"), 17.437, 0.2753),
    Case(3, "P0 (10, 15)", (10.0, 15.0), -180.0, 0.5, ("0", "15"), ("0", "15"), ("0", "7.5"), 21.507, 0.1849),
    Case(3, "P0 (9, 13)", (9.0, 13.0), -180.0, 0.5, ("4.5", "13"), ("0", "13"), ("0", "6.5"), 18.909, 0.2070),
    Case(3, "P0 (8, 11)", (8.0, 11.0), -180.0, 0.5, ("4", "11"), ("0", "11"), ("0", "5.5"), 16.313, 0.2355),
    Case(3, "P0 (6, 10)", (6.0, 10.0), -180.0, 0.5, ("3", "10"), ("0", "10"), ("0", "5"), 13.806, 0.3035),
    Case(4, "-180 deg", _TEN, -180.0, 0.5, ("5", "10"), ("0", "10"), ("0", "5"), 17.114, 0.2121),
    Case(4, "-170 deg", _TEN, -170.0, 0.5, ("5", "9.12"), ("0", "8.24"), ("0", "4.12"), 16.268, 0.1832),
    Case(4, "-160 deg", _TEN, -160.0, 0.5, ("5", "8.18"), ("0", "6.36"), ("0", "3.18"), 15.536, 0.1767),
    Case(4, "-150 deg", _TEN, -150.0, 0.5, ("5", "7.11"), ("0", "4.23"), ("0", "2.11"), 14.889, 0.2257),
)
FINAL_HEADING_DEG = -90.0
MISPRINTED = (3, "P0 (10, 15)", "P1")
"""Table III prints (0, 15) for the midpoint of (10, 15) and (0, 15)."""

FLIGHTS = {"still": 0.0, "moving at 0.5 m/s": 0.5, "moving at 1.0 m/s": 1.0}
"""The pad, and its speed, m/s."""

ERRATA = (
    "The slopes below (21) are printed as -tan(chi). Table IV agrees with +tan(chi) only: with -tan, P2 for -170 "
    "deg would be (0, 11.76) and not (0, 8.24). Directions are used instead of slopes: +-90 deg has none.",
    "The division in (22) and (23), (a P2 + P0) / (a + 1), gives the midpoints for a = 1, not for the stated a = "
    "0.5, and cannot pass the midpoint. Table II is P1 = P0 + a (P2 - P0), P3 = P2 + a (P4 - P2), which is used.",
    "Table III, first row, prints P1 = (0, 15), which is P2; the midpoint is (5, 15).",
    "The text of case 4 says a = 0.1; its table has midpoints, a = 0.5, as here.",
)
NOTES = (
    "Arc lengths and peak curvatures are shown as curves in the paper, without numbers; the column `printed` of "
    "those two tables holds values computed from the formulas beforehand with 20 001 samples, independently of this"
    " program.",
    f"Not printed and chosen here: the gain of the heading loop, k = {GAIN_HZ:g} 1/s; 2^{TABLE_LEVELS} sub-intervals"
    f" of the arc length table; steps of {STEP_S * 1e3:g} ms (RK4).",
    "The loop follows the heading and never looks at the position: it ends beside the pad by V / k times the "
    f"difference of the end directions, {math.sqrt(2.0) / GAIN_HZ * SPEED_M_S:.3f} m for a right angle. Distances "
    "left are of that size, and fall with 1 / k.",
    "Flights are simulated: the default quadrotor, configs/papers/shivam.toml, seed 1, one flight each, without "
    "wind and with positions known without error. The curve is flown from rest to rest over the pad, 17 m in 17 s, "
    "at an even glide to 1.2 m above the deck, and straight down from there; the paper has constant speed in a "
    "plane. The moving pad drives north, so that the vehicle, hovering at first, already moves at -180 deg as seen "
    "from it; the curve moves with the pad.",
)


def curve_of(case: Case) -> BezierCurve:
    """The case's curve, z = 0."""
    start = (*case.start_m, 0.0)
    return landing_curve(
        start, math.radians(case.heading_deg), (0.0, 0.0, 0.0), math.radians(FINAL_HEADING_DEG), case.ratio
    )


def reproduce(quick: bool) -> Reproduction:
    """Quick: everything but the flights over moving pads."""
    curves = [curve_of(case) for case in CASES]
    tracks = [track(curve) for curve in curves]
    speeds = dict(list(FLIGHTS.items())[: 1 if quick else None])
    flights = flown(
        [
            flight(i, "shivam", preset="shivam", world={"path.speed_m_s": speed})
            for i, speed in enumerate(speeds.values())
        ]
    )
    rows = [
        *_control_point_rows(curves),
        *_shape_rows(curves),
        *_end_rows(curves),
        *_loop_rows(curves, tracks),
        *_flight_rows(list(speeds), flights),
    ]
    figures = [*_figures(curves, tracks), *_flight_figures(list(speeds), flights)]
    return Reproduction(
        "shivam", "shivam: Bezier curve guidance for landing", tuple(rows), tuple(figures), ERRATA, NOTES
    )


# ------------------------------------------------------------------------------------------------------------- tables


def _control_point_rows(curves: Sequence[BezierCurve]) -> list[Row]:
    rows = []
    for case, curve in zip(CASES, curves, strict=True):
        for number, printed in (("P1", case.p1), ("P2", case.p2), ("P3", case.p3)):
            if printed is not None:
                rows.append(_point_row(case, number, printed, curve.points_m[int(number[1])]))
    return rows


def _point_row(case: Case, number: str, printed: tuple[str, str], point: Vec3) -> Row:
    """Compared as printed: rounded to the same digits."""
    ours = tuple(_as_printed(value, text) for value, text in zip(point, printed, strict=False))
    verdict: Any = "same" if ours == printed else "differs"
    tolerance = "the printed digits"
    if (case.number, case.name, number) == MISPRINTED:
        tolerance += "; misprint, see errata"
    return Row(
        TABLES[case.number],
        f"{case.name}, {number}",
        f"({', '.join(printed)}) m",
        f"({', '.join(ours)}) m",
        "",
        tolerance,
        verdict,
    )


def _as_printed(value: float, text: str) -> str:
    decimals = len(text.partition(".")[2])
    rounded = f"{value:.{decimals}f}"
    return rounded.lstrip("-") if float(rounded) == 0.0 else rounded


def peak_curvature_1_m(curve: BezierCurve, samples: int = SAMPLES) -> float:
    """Largest along the curve."""
    return max(abs(curve.curvature(i / (samples - 1))) for i in range(samples))


def _shape_rows(curves: Sequence[BezierCurve]) -> list[Row]:
    lengths, bends = [], []
    for case, curve in zip(CASES, curves, strict=True):
        name = f"case {case.number}, {case.name}"
        length = arc_length(curve, 12).total_m
        lengths.append(number_row(LENGTHS, name, case.length_m, length, "m", 0.001))
        peak = peak_curvature_1_m(curve, 2001)
        bends.append(number_row(BENDS, name, case.curvature_1_m, peak, "1/m", 0.00005))
    least = min((row for row in bends if row.name.startswith("case 2")), key=lambda row: row.ours)
    flattest = least.name.removeprefix("case 2, ")
    verdict: Any = "same" if flattest == "a = 0.5" else "differs"
    return [*lengths, *bends, Row(BENDS, "case 2, the flattest", "a = 0.5", flattest, "", "", verdict)]


def _end_rows(curves: Sequence[BezierCurve]) -> list[Row]:
    table = "What must hold at the ends, largest of all cases"
    heading_i = max(_angle_off(curve.heading(0.0), case.heading_deg) for case, curve in zip(CASES, curves, strict=True))
    heading_f = max(_angle_off(curve.heading(1.0), FINAL_HEADING_DEG) for curve in curves)
    bend = max(abs(curve.curvature(tau)) for curve in curves for tau in (0.0, 1.0))
    outside = max(outside_hull_m(curve) for curve in curves)
    return [
        number_row(table, "heading at the start less chi_i", 0.0, heading_i, "rad", 1e-9),
        number_row(table, "heading at the pad less chi_f", 0.0, heading_f, "rad", 1e-9),
        number_row(table, "curvature at either end", 0.0, bend, "1/m", 1e-9),
        number_row(table, "outside the hull of the control points", 0.0, outside, "m", 1e-9),
    ]


def _angle_off(angle_rad: float, wanted_deg: float) -> float:
    return abs(wrap_pi(angle_rad - math.radians(wanted_deg)))


def outside_hull_m(curve: BezierCurve, samples: int = 1001) -> float:
    """How far the curve leaves the triangle P0 P2 P4, which holds P1 and P3; 0: nowhere."""
    corners = [curve.points_m[i] for i in (0, 2, 4)]
    return max(
        max(0.0, *(_beyond_m(corners, i, curve.position(k / (samples - 1))) for i in range(3))) for k in range(samples)
    )


def _beyond_m(corners: Sequence[Vec3], side: int, point: Vec3) -> float:
    """Distance beyond one side, seen from the third corner."""
    (ax, ay, _), (bx, by, _), (cx, cy, _) = (corners[(side + i) % 3] for i in range(3))
    nx, ny = ay - by, bx - ax
    inner = nx * (cx - ax) + ny * (cy - ay)
    here = nx * (point[0] - ax) + ny * (point[1] - ay)
    return -math.copysign(1.0, inner) * here / math.hypot(nx, ny)


# ------------------------------------------------------------------------------------------------------- heading loop


@dataclass(frozen=True, slots=True)
class Track:
    """The planar vehicle under the paper's loop, evenly in time."""

    t_s: list[float]
    x_m: list[float]
    y_m: list[float]
    distance_m: list[float]
    heading_rad: list[float]
    curvature_1_m: list[float]


def track(curve: BezierCurve) -> Track:
    """Follow the curve until its length has been flown, or the pad is reached."""
    table = arc_length(curve, TABLE_LEVELS)
    x, y, _ = curve.points_m[0]
    state = (math.hypot(x, y), math.atan2(y, x), curve.heading(0.0))
    found = Track([], [], [], [], [], [])
    steps = round(table.total_m / SPEED_M_S / STEP_S)
    for i in range(steps + 1):
        _note(found, i * STEP_S, state, curve, table)
        if state[0] < STOP_M:
            break
        state = _stepped(state, i * STEP_S, lambda t: commanded_heading_rad(curve, table, t))
    return found


def commanded_heading_rad(curve: BezierCurve, table: ArcLength, t_s: float) -> float:
    """chi_d(t): the tangent where the arc length is V t."""
    return curve.heading(table.parameter_at(SPEED_M_S * t_s))


def _note(found: Track, t_s: float, state: tuple[float, float, float], curve: BezierCurve, table: ArcLength) -> None:
    r, theta, chi = state
    found.t_s.append(t_s)
    found.x_m.append(r * math.cos(theta))
    found.y_m.append(r * math.sin(theta))
    found.distance_m.append(r)
    found.heading_rad.append(chi)
    turn = GAIN_HZ * wrap_pi(commanded_heading_rad(curve, table, t_s) - chi)
    found.curvature_1_m.append(turn / SPEED_M_S)


def _stepped(
    state: tuple[float, float, float], t_s: float, heading_rad: Callable[[float], float]
) -> tuple[float, float, float]:
    """One step of RK4."""
    a = _slope(state, heading_rad(t_s))
    b = _slope(_moved(state, a, 0.5 * STEP_S), heading_rad(t_s + 0.5 * STEP_S))
    c = _slope(_moved(state, b, 0.5 * STEP_S), heading_rad(t_s + 0.5 * STEP_S))
    d = _slope(_moved(state, c, STEP_S), heading_rad(t_s + STEP_S))
    r, theta, chi = ((p + 2.0 * q + 2.0 * s + u) / 6.0 for p, q, s, u in zip(a, b, c, d, strict=True))
    return _moved(state, (r, theta, chi), STEP_S)


def _slope(state: tuple[float, float, float], wanted_rad: float) -> tuple[float, float, float]:
    r, theta, chi = state
    return (
        SPEED_M_S * math.cos(chi - theta),
        SPEED_M_S / r * math.sin(chi - theta),
        GAIN_HZ * wrap_pi(wanted_rad - chi),
    )


def _moved(
    state: tuple[float, float, float], slope: tuple[float, float, float], dt_s: float
) -> tuple[float, float, float]:
    r, theta, chi = (value + rate * dt_s for value, rate in zip(state, slope, strict=True))
    return r, theta, chi


def _loop_rows(curves: Sequence[BezierCurve], tracks: Sequence[Track]) -> list[Row]:
    table = "Tracked by the heading loop"
    rows = []
    for case, curve, found in zip(CASES, curves, tracks, strict=True):
        name = f"case {case.number}, {case.name}"
        rows.append(number_row(table, f"{name}: distance left", 0.0, min(found.distance_m), "m", TOUCH_M))
        off = _angle_off(found.heading_rad[-1], FINAL_HEADING_DEG)
        rows.append(number_row(table, f"{name}: heading at the end less chi_f", 0.0, math.degrees(off), "deg", 1.0))
        aside = max(_distance_to(curve, x, y) for x, y in list(zip(found.x_m, found.y_m, strict=True))[::50])
        rows.append(Row(table, f"{name}: furthest from the curve", None, aside, "m", "", "not printed"))
    return rows


def _distance_to(curve: BezierCurve, x_m: float, y_m: float, samples: int = 400) -> float:
    points = (curve.position(i / samples) for i in range(samples + 1))
    return min(math.hypot(p[0] - x_m, p[1] - y_m) for p in points)


# ------------------------------------------------------------------------------------------------------------ flights


def _relative(row: FlightRow) -> list[tuple[float, float, float]]:
    """(t, x, y) of the vehicle against the pad, north and east, from when the curve began until touchdown."""
    begin = next((t for t, phase in row["phases"] if phase == "follow"), 0.0)
    end = row["touchdown_s"] or math.inf
    return [(t, v[0] - p[0], v[1] - p[1]) for t, v, p, _ in row["track"] if begin <= t <= end]


def _asked(row: FlightRow) -> BezierCurve:
    """The paper's curve from where the flight was when it began."""
    _, x, y = _relative(row)[0]
    return landing_curve((x, y, 0.0), math.radians(-180.0), (0.0, 0.0, 0.0), math.radians(FINAL_HEADING_DEG), 0.5)


def _flight_rows(names: Sequence[str], flights: Sequence[FlightRow]) -> list[Row]:
    table = "Flown by the simulated quadrotor (the paper flies none)"
    rows = []
    for name, row in zip(names, flights, strict=True):
        curve, path = _asked(row), _relative(row)
        aside = max(_distance_to(curve, x, y) for _, x, y in path[::5])
        found: list[tuple[str, float | str | None, str]] = [
            ("outcome", str(row["outcome"]), ""),
            ("off the pad's centre at touchdown", row["touchdown_error_m"], "m"),
            ("speed across the deck at touchdown", row["touchdown_relative_speed_horizontal_m_s"], "m/s"),
            ("furthest from the curve, seen from the pad", aside, "m"),
            ("heading of arrival less chi_f", _arrival_off_deg(path), "deg"),
            ("start to touchdown", row["time_to_touchdown_s"], "s"),
        ]
        rows += [
            Row(table, f"pad {name}: {what}", None, "-" if value is None else value, unit, "", "not printed")
            for what, value, unit in found
        ]
    return rows


def _arrival_off_deg(path: Sequence[tuple[float, float, float]]) -> float | None:
    """Direction of the last metre but 0.3 m towards the pad, against chi_f."""
    near = [(x, y) for _, x, y in path if 0.3 <= math.hypot(x, y) <= 1.3]
    if len(near) < 2:
        return None
    (x0, y0), (x1, y1) = near[0], near[-1]
    return math.degrees(_angle_off(math.atan2(y1 - y0, x1 - x0), FINAL_HEADING_DEG))


# ------------------------------------------------------------------------------------------------------------ figures


def _figures(curves: Sequence[BezierCurve], tracks: Sequence[Track]) -> list[Chart]:
    charts = []
    for number in TABLES:
        chosen = [i for i, case in enumerate(CASES) if case.number == number]
        names = [CASES[i].name for i in chosen]
        found = [tracks[i] for i in chosen]
        charts += [
            _paths(f"Case {number}: path of the heading loop", names, found, [curves[i] for i in chosen]),
            _over_time(f"Case {number}: distance from the pad", "m", names, found, lambda f: f.distance_m),
            _over_time(
                f"Case {number}: heading",
                "deg",
                names,
                found,
                lambda f: [math.degrees(chi) if chi < 0.0 else math.degrees(chi) - 360.0 for chi in f.heading_rad],
            ),
            _over_time(f"Case {number}: curvature", "1/m", names, found, lambda f: f.curvature_1_m),
        ]
    return charts


def _paths(title: str, names: Sequence[str], found: Sequence[Track], curves: Sequence[BezierCurve]) -> Chart:
    lines = [Line(n, c, f.x_m[::4], f.y_m[::4]) for n, c, f in zip(names, COLOURS, found, strict=False)]
    points = [p for curve in curves for p in curve.points_m]
    dots = Line("control points", PURPLE, [p[0] for p in points], [p[1] for p in points], dots=True)
    return Chart(title, "x, m", "y, m", (*lines, dots), equal=True, width=WIDE, height=TALL)


def _over_time(
    title: str, unit: str, names: Sequence[str], found: Sequence[Track], values: Callable[[Track], list[float]]
) -> Chart:
    lines = [Line(n, c, f.t_s[::4], values(f)[::4]) for n, c, f in zip(names, COLOURS, found, strict=False)]
    return Chart(title, "time, s", unit, tuple(lines), width=WIDE, height=TALL)


def _flight_figures(names: Sequence[str], flights: Sequence[FlightRow]) -> list[Chart]:
    paths, distances = [], []
    for name, colour, row in zip(names, COLOURS, flights, strict=False):
        path = _relative(row)
        paths.append(Line(name, colour, [x for _, x, _ in path], [y for _, _, y in path]))
        distances.append(Line(name, colour, [t for t, _, _ in path], [math.hypot(x, y) for _, x, y in path]))
    curve = curve_of(CASES[0])
    points = [curve.position(i / 100) for i in range(101)]
    paths.append(Line("curve of case 1", GREY, [p[0] for p in points], [p[1] for p in points], dashed=True))
    return [
        Chart("Flown, seen from the pad (simulated)", "north, m", "east, m", tuple(paths), equal=True),
        Chart("Flown: horizontal distance from the pad (simulated)", "time, s", "m", tuple(distances)),
    ]
