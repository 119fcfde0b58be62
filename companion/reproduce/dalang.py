"""The paper `dalang`: odometry only, a cubic B-spline from four points, PD velocity setpoints; its two tables of verdicts.

The curve is computed and compared with the printed formulas; the verdicts are flown in the simulator with the preset
(configs/papers/dalang.toml), and again by the default pipeline, which has its camera. "Success": stands on the deck while the
pad moves; "MPS": only once it has stopped. W local NED, SI.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from companion.campaign.engine import Row as FlightRow
from companion.config import Config, load_with
from companion.messages import Vec3
from companion.planning.four_point import control_points, four_point_trajectory
from companion.reproduce.flights import flight, flown
from companion.reproduce.papers import preset_file
from companion.reproduce.row import Reproduction, Row, number_row
from companion.telemetry.report import BLUE, GREEN, GREY, ORANGE, RED
from companion.telemetry.svg_plot import Chart, Line

KNOTS = (0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0)
"""Clamped: degree 3, four control points."""
MOVES_M_S = 0.02
START_M, PAD_M, CLEARANCE_M = (7.0, -3.0, -3.0), (0.0, 0.0, -0.5), 0.5
"""An example for the curve: heights from the pad's surface, z down."""


@dataclass(frozen=True, slots=True)
class Case:
    """One line of a table: its settings, what the paper says of it."""

    table: str
    name: str
    threshold_m: float
    pad_speed_m_s: float
    printed: str


BASE = Case("Table I: deviation threshold", "1.0 m", 1.0, 0.1, "Success")
CASES = (
    Case("Table I: deviation threshold", "0.2 m", 0.2, 0.1, "MPS"),
    Case("Table I: deviation threshold", "0.8 m", 0.8, 0.1, "MPS"),
    BASE,
    Case("Table II: top speeds (UAV, UGV)", "1.0, 1.0 m/s", 1.0, 1.0, "MPS"),
    Case("Table II: top speeds (UAV, UGV)", "1.0, 0.2 m/s", 1.0, 0.2, "MPS"),
    Case("Table II: top speeds (UAV, UGV)", "1.0, 0.1 m/s", 1.0, 0.1, "Success"),
)
ELSEWHERE = {"away from the vehicle": 90.0, "across": 180.0}
"""Where else the pad could have driven, deg; the scenario's is 270, towards the vehicle."""


def reproduce(quick: bool) -> Reproduction:
    """Quick: the curve, and the one case that both tables share. Full: six cases, twice, and other directions."""
    cases = (BASE,) if quick else CASES
    flights = _flights(cases, quick)
    rows = [*_curve_rows(), *_verdict_rows(cases, flights, "preset"), *_lag_rows(flights["preset"][cases.index(BASE)])]
    if not quick:
        rows += [*_default_rows(flights["default"]), *_direction_rows(flights["elsewhere"])]
    return Reproduction(
        key="dalang",
        title="dalang: B-spline landing by odometry alone",
        rows=tuple(rows),
        figures=tuple(_figures(cases, flights["preset"])),
        errata=ERRATA,
        notes=NOTES,
    )


ERRATA = (
    "Eq. (9) prints the factor j - 1 for the derivative of a basis function of degree j; it is j. With j - 1 the "
    "velocity references would be two thirds of the curve's own (rows of the curve below).",
    "Algorithm 1 adds the pad's pose in the drone's frame to the drone's pose for P3, and takes dx, dy as absolute "
    "values that it then subtracts where needed: the points are the ones used here, a quarter and three quarters of"
    " the way.",
    "Algorithm 2 compares the tracked pose with the landing threshold and computes a distance that it does not use;"
    " equation (17) and the text say that the horizontal distance counts, and that is what is flown.",
)

NOTES = (
    "Not printed and chosen here: a clearance of 0.5 m; where the vehicle starts (3 m up, 7 m from the pad); where "
    "the pad goes (towards the vehicle); how long a curve takes (9 s, 112 samples of 0.08 s, or what 1 m/s takes "
    "where that is longer); the pad's speed in Table I (0.1 m/s) and the threshold in Table II (1.0 m). With these "
    "one setting gives the six verdicts of the print.",
    "A curve is made to where the pad stands and stays there over the ground. It is made anew when the pad has "
    "moved by the threshold. A pad at v has moved by 9 s v when a curve ends: 0.9 m at 0.1 m/s, which is more than "
    "0.2 and 0.8 m and less than 1.0 m; 1.8 m at 0.2 m/s. So only with 1.0 m and 0.1 m/s does a curve ever end "
    "while the pad moves, and without its end there is no landing.",
    "After its end the regulator goes for the pad itself and trails it by (1 + kd) / kp = 1.59 s of its motion, "
    "0.16 m at 0.1 m/s: more than the 0.1 m within which it may land. Success needs a pad that comes towards the "
    "vehicle, which is then within 0.1 m while it passes; with a pad that drives away or across the same settings "
    "land only when it stands (rows below).",
    "The pad drives for 70 s (20 s at 1.0 m/s), then stops. Rover and vehicle know their places without error and "
    "there is no wind, as in the paper. The vehicle is the simulator's default quadrotor; its range sensor serves "
    "the proof of touchdown.",
    "The default pipeline flies the same worlds with its own configuration: camera, nested ArUco marker, beacon.",
    "Seed 1 for every flight; what is left at random is the rover's wobble and the camera's noise. One flight a case.",
)


# ------------------------------------------------------------------------------------------------------------- flights


def _flights(cases: Sequence[Case], quick: bool) -> dict[str, list[FlightRow]]:
    samples = [
        flight(
            i, "dalang", preset="dalang", world=_world(case), app={"planning.deviation_threshold_m": case.threshold_m}
        )
        for i, case in enumerate(cases)
    ]
    if not quick:
        samples += [flight(100 + i, "dalang", preset=None, world=_world(case)) for i, case in enumerate(cases)]
        headings = [{**_world(BASE), "place.path_heading_deg": heading} for heading in ELSEWHERE.values()]
        samples += [flight(200 + i, "dalang", preset="dalang", world=world) for i, world in enumerate(headings)]
    rows = flown(samples)
    part = {0: "preset", 1: "default", 2: "elsewhere"}
    return {name: [row for row in rows if row["sample"] // 100 == number] for number, name in part.items()}


def _world(case: Case) -> dict[str, Any]:
    return {"path.speed_m_s": case.pad_speed_m_s, "path.go_s": 20.0 if case.pad_speed_m_s > 0.5 else 70.0}


def verdict_of(row: FlightRow) -> str:
    """The paper's word for what happened."""
    if row["outcome"] != "landed" or row["pad_speed_m_s"] is None:
        return str(row["outcome"])
    return "Success" if row["pad_speed_m_s"] > MOVES_M_S else "MPS"


def _told(row: FlightRow) -> str:
    verdict = verdict_of(row)
    if row["touchdown_error_m"] is None:
        return verdict
    return f"{verdict} ({row['touchdown_s']:.0f} s, {row['touchdown_error_m']:.2f} m off)"


def _verdict_rows(cases: Sequence[Case], flights: dict[str, list[FlightRow]], who: str) -> list[Row]:
    return [
        Row(case.table, case.name, case.printed, _told(row), "", "the same word", _agrees(case.printed, row))
        for case, row in zip(cases, flights[who], strict=True)
    ]


def _agrees(printed: str, row: FlightRow) -> Any:
    return "same" if verdict_of(row) == printed else "differs"


def _default_rows(rows: Sequence[FlightRow]) -> list[Row]:
    table = "The same six with the default pipeline (with its camera)"
    found = []
    for case, row in zip(CASES, rows, strict=True):
        verdict: Any = "differs" if verdict_of(row) != "Success" else "same" if case.printed == "Success" else "better"
        name = f"{case.table.split(':')[0]}, {case.name}"
        found.append(Row(table, name, case.printed, _told(row), "", "lands while the pad moves", verdict))
    return found


def _direction_rows(rows: Sequence[FlightRow]) -> list[Row]:
    table = "Other directions of the pad, 1.0 m and 0.1 m/s"
    return [
        Row(table, name, None, _told(row), "", "", "not printed") for name, row in zip(ELSEWHERE, rows, strict=True)
    ]


# ----------------------------------------------------------------------------------------------------------- the curve


def basis(index: int, degree: int, t: float) -> float:
    """N_index,degree(t) of equations (6) and (7), by their recursion; 0/0 is 0, and the last span is closed."""
    low, high = KNOTS[index], KNOTS[index + 1]
    if degree == 0:
        return 1.0 if low <= t < high or (t == high == KNOTS[-1] and low < high) else 0.0
    rise, fall = KNOTS[index + degree] - low, KNOTS[index + degree + 1] - high
    left = (t - low) / rise * basis(index, degree - 1, t) if rise > 0.0 else 0.0
    right = (KNOTS[index + degree + 1] - t) / fall * basis(index + 1, degree - 1, t) if fall > 0.0 else 0.0
    return left + right


def basis_slope(index: int, degree: int, t: float, factor: float) -> float:
    """Equation (9) with its factor given."""
    rise = KNOTS[index + degree] - KNOTS[index]
    fall = KNOTS[index + degree + 1] - KNOTS[index + 1]
    left = basis(index, degree - 1, t) / rise if rise > 0.0 else 0.0
    right = basis(index + 1, degree - 1, t) / fall if fall > 0.0 else 0.0
    return factor * (left - right)


def _mixed(points: Sequence[Vec3], weights: Sequence[float]) -> list[float]:
    return [sum(w * p[axis] for w, p in zip(weights, points, strict=True)) for axis in range(3)]


def _curve_rows() -> list[Row]:
    table = "Control points and Cox-de Boor"
    points = control_points(START_M, PAD_M, CLEARANCE_M)
    path = four_point_trajectory(points, 1.0)
    shares = [i / 100 for i in range(101)]
    off = max(math.dist(path.sample(t)[0], _mixed(points, [basis(i, 3, t) for i in range(4)])) for t in shares)
    slope = {
        factor: max(
            math.dist(path.sample(t)[1], _mixed(points, [basis_slope(i, 3, t, factor) for i in range(4)]))
            for t in shares
        )
        for factor in (3.0, 2.0)
    }
    share = [(START_M[0] - p[0]) / (START_M[0] - PAD_M[0]) for p in points]
    return [
        number_row(table, "P1: share of the horizontal way", 0.25, share[1], "", 1e-12),
        number_row(table, "P2: share of the horizontal way", 0.75, share[2], "", 1e-12),
        number_row(table, "P1: height over the clearance", 3.0, -points[1][2] / CLEARANCE_M, "", 1e-12),
        number_row(table, "P2: height over P1's", 0.5, points[2][2] / points[1][2], "", 1e-12),
        number_row(table, "largest distance of our curve from (5) to (7)", 0.0, off, "m", 1e-9),
        number_row(table, "largest difference of velocity, (9) with the degree j = 3", 0.0, slope[3.0], "m/s", 1e-9),
        number_row(table, "largest difference of velocity, (9) as printed, j - 1", None, slope[2.0], "m/s", 0.0),
    ]


# ------------------------------------------------------------------------------------------------------------- the lag


def lag_s(config: Config) -> float:
    """By how many seconds of the pad's motion the law trails: v_pad = kp e - kd v_pad."""
    return (1.0 + config.control.damping) / config.control.position_gain_hz


def _lag_rows(row: FlightRow) -> list[Row]:
    table = "The lag, explained"
    config = load_with([preset_file("dalang")], {})
    trail_m = lag_s(config) * BASE.pad_speed_m_s
    curve_m = config.planning.min_duration_s * BASE.pad_speed_m_s
    along = row["touchdown_error_along_m"]
    behind: float | str = "-" if along is None else -along
    return [
        Row(table, "(1 + kd) / kp", None, lag_s(config), "s", "", "not printed"),
        Row(table, "trails a pad at 0.1 m/s by", None, trail_m, "m", "", "not printed"),
        Row(table, "of which it may land within", 0.1, config.mission.follow_radius_m, "m", "0", "same"),
        Row(table, "fastest pad it could follow and land on", None, 0.1 / lag_s(config), "m/s", "", "not printed"),
        Row(table, "the pad's way during one curve at 0.1 m/s", None, curve_m, "m", "", "not printed"),
        Row(table, "flown: behind the centre at touchdown", None, behind, "m", "", "not printed"),
    ]


# ------------------------------------------------------------------------------------------------------------- figures


def _figures(cases: Sequence[Case], rows: Sequence[FlightRow]) -> list[Chart]:
    base = rows[cases.index(BASE)]
    charts = [_plan_view(base), _side_view(base)]
    for table in dict.fromkeys(case.table for case in cases):
        chosen = [(case, row) for case, row in zip(cases, rows, strict=True) if case.table == table]
        charts.append(_distances(table, chosen))
    return charts


def _plan_view(row: FlightRow) -> Chart:
    """Fig. 6: the flown path and the pad's."""
    track = row["track"]
    return Chart(
        "Flown path and the pad's, 1.0 m and 0.1 m/s (simulated)",
        "east, m",
        "north, m",
        (
            Line("pad", ORANGE, [pad[1] for _, _, pad, _ in track], [pad[0] for _, _, pad, _ in track]),
            Line("vehicle", BLUE, [v[1] for _, v, _, _ in track], [v[0] for _, v, _, _ in track]),
        ),
        equal=True,
    )


def _side_view(row: FlightRow) -> Chart:
    """Figs. 5 and 6 from the side, with the curve that was followed."""
    track = row["track"]
    (_, start, pad, _) = track[0]
    above = (0.0, 0.0, -CLEARANCE_M)
    points = control_points(tuple(a - b for a, b in zip(start, pad, strict=True)), above, CLEARANCE_M)
    curve = [four_point_trajectory(points, 1.0).sample(i / 100)[0] for i in range(101)]
    return Chart(
        "Curve and flown path from the side, 1.0 m and 0.1 m/s (simulated)",
        "east, m",
        "height, m",
        (
            Line("curve", GREY, [p[1] + pad[1] for p in curve], [-p[2] - pad[2] for p in curve], dashed=True),
            Line("pad", ORANGE, [pad[1] for _, _, pad, _ in track], [-pad[2] for _, _, pad, _ in track]),
            Line("vehicle", BLUE, [v[1] for _, v, _, _ in track], [-v[2] for _, v, _, _ in track]),
        ),
    )


def _distances(table: str, chosen: Sequence[tuple[Case, FlightRow]]) -> Chart:
    colours = (BLUE, GREEN, RED)
    lines = [
        Line(
            case.name,
            colour,
            [t for t, _, _, _ in row["track"]],
            [math.dist(vehicle[:2], pad[:2]) for _, vehicle, pad, _ in row["track"]],
        )
        for colour, (case, row) in zip(colours, chosen, strict=False)
    ]
    ends = max(row["track"][-1][0] for _, row in chosen)
    limit = Line("0.1 m", GREY, [0.0, ends], [0.1, 0.1], dashed=True)
    return Chart(
        f"{table}: horizontal distance (simulated)", "time, s", "m", (*lines, limit), y_range=(0.0, 8.0), width=780.0
    )
