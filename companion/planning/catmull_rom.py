"""Cubic Bezier segments with Catmull-Rom tangents: the `guo` paper's comparison, not a planner to fly.

Each segment's tangent at a waypoint is half the chord between its neighbours, at the ends the chord itself. The time is
shared by distance, so the speed jumps at waypoints; the shape is what is compared.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from companion.planning.trajectory import Piece, Trajectory

Array = npt.NDArray[np.float64]

BEZIER_TO_POLYNOMIAL = np.array(
    [[-1.0, 3.0, -3.0, 1.0], [3.0, -6.0, 3.0, 0.0], [-3.0, 3.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]]
)
"""Rows: powers from the third down; columns: the four control points."""


def catmull_rom_control_points(waypoints_m: Array) -> Array:
    """Control points (n, 4, 3) of the n segments between n + 1 waypoints (n + 1, 3)."""
    tangents = np.empty_like(waypoints_m)
    tangents[1:-1] = 0.5 * (waypoints_m[2:] - waypoints_m[:-2])
    tangents[0] = 0.5 * (waypoints_m[1] - waypoints_m[0])
    tangents[-1] = 0.5 * (waypoints_m[-1] - waypoints_m[-2])
    first, last = waypoints_m[:-1], waypoints_m[1:]
    return np.stack([first, first + tangents[:-1] / 3.0, last - tangents[1:] / 3.0, last], axis=1)


def catmull_rom_path(waypoints_m: Array, durations_s: Array, start_ns: int = 0) -> Trajectory:
    """The segments flown in the given times (n,)."""
    unit = np.einsum("pk,nka->nap", BEZIER_TO_POLYNOMIAL, catmull_rom_control_points(waypoints_m))
    scaled = unit / durations_s[:, None, None] ** np.arange(3.0, -1.0, -1.0)
    pieces: tuple[Piece, ...] = tuple((tuple(x), tuple(y), tuple(z)) for x, y, z in scaled.tolist())
    return Trajectory(start_ns, tuple(np.concatenate([[0.0], np.cumsum(durations_s)]).tolist()), pieces)
