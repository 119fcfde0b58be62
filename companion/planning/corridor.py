"""Minimum snap inside a corridor around the straight lines between waypoints: a quadratic program.

Unknown are velocity, acceleration and jerk at the inner waypoints, and the position of those that need not be met. Each
septic piece is written in Bernstein form; its control points stay within the half width of the segment's line in the two
directions across it, so the whole piece does. Solved by piqp (the extra `qp`). Time is scaled by the mean duration.
"""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from companion.config import Planning
from companion.planning import snap
from companion.planning.min_snap import SnapPath, durations_by_distance, end_derivatives, plan_path
from companion.planning.proof import monomial_to_bernstein
from companion.planning.request import NoPlan, Plan, PlanRequest

Array = npt.NDArray[np.float64]
BERNSTEIN = monomial_to_bernstein(7) @ snap.HERMITE
"""Hermite values of the unit septic to its Bernstein control points (8, 8)."""


class CorridorError(ValueError):
    """No path keeps within the corridor, or the solver is missing; the text says which."""


def corridor_minimum_snap(
    waypoints_m: Array,
    durations_s: Array,
    half_width_m: float,
    fixed: Sequence[bool] | None = None,
    start: Array | None = None,
    end: Array | None = None,
) -> SnapPath:
    """Least integral of squared snap within `half_width_m` of each segment's line, across it in two directions.

    `fixed` says for each waypoint whether the path goes through it (default: all; the two ends always). `start`, `end`
    (3, 3) as in `minimum_snap`. CorridorError where there is no such path.
    """
    count = len(waypoints_m)
    through = [True] * count if fixed is None else [True, *fixed[1:-1], True]
    unit = float(durations_s.mean())
    scaled = durations_s / unit
    known = _known_values(waypoints_m, unit, start, end)
    unknown = np.array([[not through[i], True, True, True] if 0 < i < count - 1 else [False] * 4 for i in range(count)])
    values = _solve(known, unknown.ravel(), waypoints_m, scaled, half_width_m)
    state = values.reshape(count, 4, 3) / (unit ** np.arange(4.0))[None, :, None]
    return SnapPath(waypoints_m, durations_s, state)


def boxed_minimum_snap(waypoints_m: Array, durations_s: Array, half_side_m: float) -> SnapPath:
    """Least integral of squared snap from rest to rest that passes each inner waypoint within `half_side_m` on each axis.

    The `guo` paper's corridor: inequalities at the waypoints in place of equalities. Nothing keeps the path in between them.
    """
    unit = float(durations_s.mean())
    values = _known_values(waypoints_m, unit, None, None)
    hessian = _hessian(durations_s / unit)
    inner, ends = np.arange(4, len(values) - 4), np.r_[0:4, len(values) - 4 : len(values)]
    rows = np.eye(len(inner))[::4]
    for axis in range(3):
        gradient = hessian[np.ix_(inner, ends)] @ values[ends, axis]
        quadratic, middles = hessian[np.ix_(inner, inner)], waypoints_m[1:-1, axis]
        values[inner, axis] = _quadratic_program(quadratic, gradient, rows, middles, half_side_m)
    state = values.reshape(-1, 4, 3) / (unit ** np.arange(4.0))[None, :, None]
    return SnapPath(waypoints_m, durations_s, state)


def _hessian(durations: Array) -> Array:
    """Of the integral of squared snap in the Hermite values of one axis, scaled time."""
    hessian = np.zeros((4 * len(durations) + 4, 4 * len(durations) + 4))
    for i, duration in enumerate(durations):
        block = slice(4 * i, 4 * i + 8)
        powers = np.tile(duration ** np.arange(4.0), 2)
        hessian[block, block] += snap.GRAM * np.outer(powers, powers) / duration**7
    return hessian


def _known_values(waypoints: Array, unit: float, start: Array | None, end: Array | None) -> Array:
    """Hermite values (4 a waypoint, 3 axes) with the unknown ones zero, in scaled time."""
    known = np.zeros((len(waypoints), 4, 3))
    known[:, 0] = waypoints
    powers = unit ** np.arange(1.0, 4.0)[:, None]
    if start is not None:
        known[0, 1:] = start * powers
    if end is not None:
        known[-1, 1:] = end * powers
    return known.reshape(-1, 3)


def _solve(
    known: Array, unknown: npt.NDArray[np.bool_], waypoints: Array, durations: Array, half_width_m: float
) -> Array:
    """All Hermite values (4 (n + 1), 3). One program for the three axes, since the corridor ties them."""
    base = np.where(unknown[:, None], 0.0, known)
    hessian, rows, middles = _hessian(durations), [], []
    free, given = np.flatnonzero(unknown), np.flatnonzero(~unknown)
    for i, duration in enumerate(durations):
        block = slice(4 * i, 4 * i + 8)
        powers = np.tile(duration ** np.arange(4.0), 2)
        points = np.zeros((8, len(known)))
        points[:, block] = BERNSTEIN * powers
        for normal in across(waypoints[i + 1] - waypoints[i]):
            rows.append(np.einsum("a,kv->kav", normal, points[:, free]).reshape(8, -1))
            middles.append((waypoints[i] - points @ base) @ normal)
    gradient = (hessian[np.ix_(free, given)] @ base[given]).T.ravel()
    quadratic = np.kron(np.eye(3), hessian[np.ix_(free, free)]).astype(np.float64)
    solution = _quadratic_program(
        quadratic, gradient.astype(np.float64), np.concatenate(rows), np.concatenate(middles), half_width_m
    )
    base[free] = solution.reshape(3, -1).T
    return base


def across(direction: Array) -> tuple[Array, Array]:
    """Two unit normals of a line: one horizontal (any, for a vertical line), one across both."""
    along = direction / np.linalg.norm(direction)
    level = np.array([-along[1], along[0], 0.0])
    size = float(np.linalg.norm(level))
    level = level / size if size > 1e-9 else np.array([1.0, 0.0, 0.0])
    return level, np.cross(along, level)


def _quadratic_program(quadratic: Array, gradient: Array, rows: Array, middles: Array, half_width_m: float) -> Array:
    """Least 1/2 x'Px + c'x with |Gx - m| <= half width; rows without unknowns are left to the waypoints themselves."""
    used = np.abs(rows).max(axis=1, initial=0.0) > 1e-12
    if bool((np.abs(middles[~used]) > half_width_m + 1e-9).any()):
        raise CorridorError(f"the end states alone leave the corridor of {half_width_m:.2f} m")
    if not used.any():
        return np.zeros(len(gradient))
    solver: Any = _piqp().DenseSolver()
    solver.settings.eps_abs = 1e-9
    solver.settings.eps_rel = 1e-10
    lower, upper = middles[used] - half_width_m, middles[used] + half_width_m
    solver.setup(np.asfortranarray(quadratic), gradient, G=np.asfortranarray(rows[used]), h_l=lower, h_u=upper)
    status = solver.solve()
    if status != _piqp().PIQP_SOLVED:
        raise CorridorError(f"no path keeps within {half_width_m:.2f} m of the lines (solver: {status})")
    return np.array(solver.result.x)


def _piqp() -> Any:
    try:
        return importlib.import_module("piqp")
    except ImportError as error:
        raise CorridorError("the corridor needs the extra `qp` (piqp), which is not installed") from error


class CorridorPlanner:
    """Minimum snap within a corridor around the lines through the request's waypoints."""

    def __init__(self, half_width_m: float = 1.5) -> None:
        _piqp()
        self._half_width_m = half_width_m

    @classmethod
    def from_config(cls, planning: Planning) -> CorridorPlanner:
        return cls(planning.corridor_half_width_m)

    def plan(self, request: PlanRequest) -> Plan | NoPlan:
        """A Plan, or NoPlan with what binds or why no path keeps within the corridor."""
        start, end = end_derivatives(request)

        def path(waypoints: Array, total_s: float) -> SnapPath:
            return corridor_minimum_snap(
                waypoints, durations_by_distance(waypoints, total_s), self._half_width_m, None, start, end
            )

        try:
            return plan_path("corridor", request, path)
        except CorridorError as error:
            return NoPlan("corridor", request.t_ns, str(error))
