"""Tables 1 and 2 of `guo`: four ways through the same waypoints, compared by shape, time, distance and energy.

The printed waypoints are two-dimensional; the paper's own figures are of a 3-D version whose heights it does not print, so
both are measured here, the 3-D one at heights stated in HEIGHTS_M. Deviation is the distance from the nearest of the straight
lines between the waypoints, at equal times. NED, SI. Called by guo.py.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from companion.planning.catmull_rom import catmull_rom_path
from companion.planning.corridor import boxed_minimum_snap
from companion.planning.min_snap import (
    SnapPath,
    distance_to_segment,
    durations_by_distance,
    improved_minimum_snap,
    minimum_snap,
    segment_deviations,
)
from companion.planning.trajectory import Trajectory
from companion.reproduce.power import AIR_KG_M3, hover_power_w
from companion.reproduce.row import Row, number_row
from companion.telemetry.svg_plot import Chart, Line

Array = npt.NDArray[np.float64]

WAYPOINTS_M = np.array([(10, 30, 0), (20, 70, 0), (60, 70, 0), (40, 30, 0), (90, 30, 0)], dtype=np.float64)
HEIGHTS_M = (10.0, 15.0, 20.0, 15.0, 10.0)
"""Of the stated 3-D version: a gentle hill."""
TOTAL_S = 180.0
THRESHOLD_M = 2.0
CORRIDOR_M, SPACING_M = 3.0, 3.5
"""The corridor: points of the straight lines every SPACING_M (not printed; with this one the 3-D path is as far off on average as the
printed one), each to be passed within CORRIDOR_M on each axis. With 3 m as the whole side no path could be 1.68 m off."""
SAMPLES = 4000

TOP_SPEED_M_S = 3.48
"""The paper does not say how its vehicle followed the paths. Minimum snap brings a time law: each of its paths is sped up until its
fastest instant has this speed, with which the improved method's path takes its printed time."""
CRUISE_M_S = 2.05
TURN_M_S2 = 3.0
"""For the Bézier, whose speed jumps at the waypoints: the mean speed of that same flight, and PX4's own MPC_ACC_HOR."""

MASS_KG = 1.8
DRAG_AREA_M2 = 0.02
"""C_D A of a small quadrotor: at 2 m/s its part of the power is a tenth of a watt."""
PRINTED_POWER_W = 312.6
"""The printed energies over the printed durations: 312.8, 312.1, 312.6, 312.7 W."""

BEZIER = "Bézier (Catmull-Rom)"
METHODS: dict[str, tuple[Callable[[Array], Trajectory], str]] = {
    "improved minimum snap": (lambda w: improved_minimum_snap(w, TOTAL_S, THRESHOLD_M).trajectory(), "#0a7"),
    "minimum snap, corridor": (lambda w: corridor_path(w).trajectory(), "#c60"),
    "minimum snap": (lambda w: minimum_snap(w, durations_by_distance(w, TOTAL_S)).trajectory(), "#c33"),
    BEZIER: (lambda w: catmull_rom_path(w, durations_by_distance(w, TOTAL_S)), "#36c"),
}
"""Name to the method and the colour of its line."""

PRINTED: dict[str, tuple[float, float, float, float, float, float]] = {
    "improved minimum snap": (0.409, 0.476, 0.1257, 185.68, 87.93, 27_507.0),
    "minimum snap, corridor": (1.684, 0.986, 9.6933, 173.35, 101.19, 31_582.0),
    "minimum snap": (3.309, 3.624, 0.0153, 199.45, 110.11, 34_419.0),
    "Bézier (Catmull-Rom)": (2.106, 1.319, 0.0095, 188.72, 99.15, 31_009.0),
}
"""Mean, standard deviation (m), generation (s), distance (m), duration (s), energy (J)."""


@dataclass(frozen=True, slots=True)
class PathFigures:
    """What the two tables hold for one method, and the path's plan view for the picture."""

    mean_m: float
    std_m: float
    largest_m: float
    generation_s: float
    distance_m: float
    duration_s: float
    energy_j: float
    points_m: Array


def waypoints_3d_m() -> Array:
    """The printed waypoints at the stated heights, z down."""
    waypoints = WAYPOINTS_M.copy()
    waypoints[:, 2] = [-height for height in HEIGHTS_M]
    return waypoints


def corridor_path(waypoints_m: Array) -> SnapPath:
    """The paper's corridor: it does not meet the inner waypoints."""
    points = [waypoints_m[:1]]
    for a, b in itertools.pairwise(waypoints_m):
        count = math.ceil(float(np.linalg.norm(b - a)) / SPACING_M)
        points.append(a + (b - a) * np.arange(1, count + 1)[:, None] / count)
    close = np.concatenate(points)
    return boxed_minimum_snap(close, durations_by_distance(close, TOTAL_S), CORRIDOR_M)


def rotor_radius_m() -> float:
    """The radius with which the paper's power model gives the printed power at rest: it prints none of its constants."""
    return hover_power_w(MASS_KG, 1.0) / PRINTED_POWER_W


def power_w(speed_m_s: Array) -> Array:
    """P = 1/2 C_D A rho v^3 + sqrt((m g)^3 / (2 pi r^2 rho))."""
    lift = hover_power_w(MASS_KG, rotor_radius_m())
    return np.asarray(0.5 * DRAG_AREA_M2 * AIR_KG_M3 * speed_m_s**3 + lift)


def deviation_m(points_m: Array, waypoints_m: Array) -> Array:
    """Distance (N,) from the nearest straight line between waypoints."""
    lines = [distance_to_segment(points_m, a, b) for a, b in itertools.pairwise(waypoints_m)]
    return np.asarray(np.min(lines, axis=0))


def points_of(path: Trajectory, samples: int = SAMPLES) -> Array:
    """Positions (samples + 1, 3) at equal times."""
    return np.array([path.sample(t)[0] for t in np.linspace(0.0, path.duration_s, samples + 1)])


def sped_up(path: Trajectory) -> tuple[float, float]:
    """Duration (s) and energy (J) of a path in its own time law, its fastest instant at TOP_SPEED_M_S."""
    t_s = np.linspace(0.0, path.duration_s, SAMPLES + 1)
    speed = np.array([np.linalg.norm(path.sample(t)[1]) for t in t_s])
    faster = TOP_SPEED_M_S / float(speed.max())
    duration_s = path.duration_s / faster
    return duration_s, float(np.trapezoid(power_w(faster * speed), t_s / faster))


def flown(points_m: Array) -> tuple[float, float]:
    """Duration (s) and energy (J) along a polyline, from rest to rest, within CRUISE_M_S and TURN_M_S2 across and along."""
    steps = np.linalg.norm(np.diff(points_m, axis=0), axis=1)
    points_m = points_m[np.concatenate([[True], steps > 1e-9])]
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points_m, axis=0), axis=1))])
    even = np.linspace(0.0, way[-1], SAMPLES)
    tangent = np.gradient(np.column_stack([np.interp(even, way, points_m[:, k]) for k in range(3)]), even, axis=0)
    bend = np.linalg.norm(np.gradient(tangent, even, axis=0), axis=1)
    square = np.minimum(CRUISE_M_S**2, TURN_M_S2 / np.maximum(bend, 1e-9))
    step = even[1] - even[0]
    for order in (range(1, SAMPLES), range(SAMPLES - 2, -1, -1)):
        back = -1 if order.step > 0 else 1
        square[order[0] + back] = 0.0
        for i in order:
            square[i] = min(square[i], square[i + back] + 2.0 * TURN_M_S2 * step)
    speed = np.sqrt(square)
    between = 0.5 * (speed[1:] + speed[:-1])
    spent = step / between
    return float(spent.sum()), float((power_w(between) * spent).sum())


def measured(name: str, waypoints_m: Array, repeats: int) -> PathFigures:
    """One method on one set of waypoints. The generation time is the least of `repeats`, after one call that compiles."""
    method, _ = METHODS[name]
    path = method(waypoints_m)
    least_s = math.inf
    for _ in range(repeats):
        begin = time.perf_counter()
        method(waypoints_m)
        least_s = min(least_s, time.perf_counter() - begin)
    points = points_of(path)
    away = deviation_m(points, waypoints_m)
    distance = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    cost = flown(points) if name == BEZIER else sped_up(path)
    return PathFigures(float(away.mean()), float(away.std()), float(away.max()), least_s, distance, *cost, points)


def order(values: dict[str, float]) -> str:
    """Names from the least value up."""
    return " < ".join(sorted(values, key=lambda name: values[name]))


def path_rows(quick: bool) -> tuple[list[Row], list[Chart], dict[str, PathFigures]]:
    """Rows of Tables 1 and 2 and the pictures; the figures are those on the printed (2-D) waypoints."""
    repeats = 3 if quick else 20
    flat = {name: measured(name, WAYPOINTS_M, repeats) for name in METHODS}
    high = {name: measured(name, waypoints_3d_m(), repeats) for name in METHODS}
    rows = [*_deviation_rows("Table 1, 2-D as printed", flat), *_deviation_rows("Table 1, 3-D stated here", high)]
    rows += _tracking_rows(high)
    rows += _total_time_rows()
    return rows, [*_maps(flat), _deviation_chart(flat)], flat


def _deviation_rows(table: str, found: dict[str, PathFigures]) -> list[Row]:
    rows = []
    for name, figures in found.items():
        mean, std = PRINTED[name][:2]
        rows.append(number_row(table, f"{name}: mean", mean, round(figures.mean_m, 3), "m", 0.25 * mean, good=-1))
        rows.append(number_row(table, f"{name}: std", std, round(figures.std_m, 3), "m", 0.25 * std, good=-1))
    rows.append(_order_row(table, "order by mean", 0, {name: figures.mean_m for name, figures in found.items()}))
    within = found["improved minimum snap"].largest_m
    rows.append(number_row(table, "improved: largest", THRESHOLD_M, round(within, 3), "m", 0.0, good=-1))
    return rows


def _order_row(table: str, name: str, column: int, ours: dict[str, float]) -> Row:
    printed = order({method: PRINTED[method][column] for method in ours})
    found = order(ours)
    return Row(table, name, printed, found, "", "the same order", "same" if found == printed else "differs")


def _tracking_rows(found: dict[str, PathFigures]) -> list[Row]:
    table, rows = "Table 2, 3-D stated here", []
    for name, figures in found.items():
        _, _, generation, distance, duration, energy = PRINTED[name]
        ours = figures.generation_s
        rows.append(number_row(table, f"{name}: generation", generation, round(ours, 6), "s", 0.0, good=-1))
        rows.append(
            number_row(
                table, f"{name}: distance", distance, round(figures.distance_m, 2), "m", 0.05 * distance, good=-1
            )
        )
        rows.append(
            number_row(
                table, f"{name}: duration", duration, round(figures.duration_s, 2), "s", 0.05 * duration, good=-1
            )
        )
        rows.append(
            number_row(table, f"{name}: energy", energy, round(figures.energy_j, 0), "J", 0.05 * energy, good=-1)
        )
    for quantity, column, values in (
        ("distance", 3, {name: f.distance_m for name, f in found.items()}),
        ("duration", 4, {name: f.duration_s for name, f in found.items()}),
        ("energy", 5, {name: f.energy_j for name, f in found.items()}),
    ):
        rows.append(_order_row(table, f"order by {quantity}", column, values))
    return rows


def _total_time_rows() -> list[Row]:
    """Plain minimum snap at other total times: the paper sees the deviation shrink and the corners sharpen."""
    reference = points_of(minimum_snap(WAYPOINTS_M, durations_by_distance(WAYPOINTS_M, TOTAL_S)).trajectory(), 400)
    rows = []
    for total_s in (700.0, 1000.0):
        path = minimum_snap(WAYPOINTS_M, durations_by_distance(WAYPOINTS_M, total_s))
        moved = float(np.abs(points_of(path.trajectory(), 400) - reference).max())
        ours = f"the same shape to {moved:.1e} m; largest deviation {segment_deviations(path).max():.2f} m"
        printed = "deviation shrinks" if total_s == 700.0 else "corners sharpen"
        rows.append(Row("Fig. 3, total time", f"T = {total_s:.0f} s", printed, ours, "", "", "differs"))
    return rows


def _maps(found: dict[str, PathFigures]) -> list[Chart]:
    """Figs. 2, 4 and 5 from above."""
    lines = Line("straight", "#999", WAYPOINTS_M[:, 0].tolist(), WAYPOINTS_M[:, 1].tolist(), dashed=True)
    charts = []
    for name, figures in found.items():
        x, y = figures.points_m[::8, 0].tolist(), figures.points_m[::8, 1].tolist()
        flown_line = Line("path", METHODS[name][1], x, y)
        charts.append(Chart(f"{name}, T = 180 s", "x m", "y m", (lines, flown_line), equal=True, height=340.0))
    return charts


def _deviation_chart(found: dict[str, PathFigures]) -> Chart:
    lines = []
    for name, figures in found.items():
        away = deviation_m(figures.points_m, WAYPOINTS_M)[::8]
        t_s = np.linspace(0.0, TOTAL_S, len(away))
        lines.append(Line(name.split(" (")[0], METHODS[name][1], t_s.tolist(), away.tolist()))
    return Chart("Deviation from the straight lines", "time s", "m", tuple(lines), width=760.0)
