"""Kernel of the minimum-jerk fan: cost and verdict of every candidate.

A candidate is the quintic between two full states, which is the one with least integral of squared jerk (Mueller, Hehn,
D'Andrea 2015). Here it is written in Bernstein form at once, so that its control points and their differences bound
position, velocity, acceleration and jerk; a section whose bounds do not hold is halved, and one whose end already
violates a limit is refused. Nothing is carried from one candidate to the next. Refusal is conservative: what is accepted
is proven. Flat arrays of floats (or lists, where nothing is compiled); called by min_jerk only.

Layout: `start` is position, velocity, acceleration (9). `ends` is the same per candidate (9 each). `pad` is the pad's
velocity now, its velocity after the preview, its acceleration (9). `limits` is by the L_ indices below.
"""

from __future__ import annotations

import math
from collections.abc import MutableSequence, Sequence

from companion.compiled import compiled

L_SPEED2, L_CLIMB, L_DESCENT, L_RELATIVE2, L_ACCELERATION2, L_JERK2, L_THRUST2, L_LIFT, L_RATE2 = range(9)
L_FLOOR_Z, L_VIEW_COSINE, L_VIEW_HEIGHT, L_CONE_RADIUS, L_CONE_SLOPE, L_CONE_TOP, L_GRAVITY = range(9, 16)
LIMIT_COUNT = 16

REASONS = (
    "",
    "speed",
    "climb",
    "descent",
    "relative speed",
    "acceleration",
    "jerk",
    "thrust",
    "least thrust",
    "body rate",
    "floor",
    "view",
    "descent cone",
)
NOT_CHECKED = -1
"""Verdict of a candidate that cannot win because a cheaper one is accepted."""

MAX_DEPTH = 5
ROW = 20
"""18 coordinates (x0..x5, y0..y5, z0..z5), then width and depth."""
WORKSPACE = ROW * (MAX_DEPTH + 3)


@compiled
def evaluate(
    durations: Sequence[float],
    start: Sequence[float],
    ends: Sequence[float],
    pad: Sequence[float],
    limits: Sequence[float],
    duration_weight: float,
    prune: bool,
    work: MutableSequence[float],
    costs: MutableSequence[float],
    verdicts: MutableSequence[int],
) -> int:
    """Index of the cheapest accepted candidate, or -1. Fills `costs` (m2/s5) and `verdicts` (index into REASONS).

    The cheapest is by cost plus `duration_weight` (m2/s6) times duration. With `prune`, candidates dearer than an accepted
    one are not checked.
    """
    best = -1
    best_cost = math.inf
    for k in range(len(durations)):
        duration = durations[k]
        costs[k] = _place(duration, start, ends, 9 * k, work)
        total = costs[k] + duration_weight * duration
        if prune and total >= best_cost:
            verdicts[k] = NOT_CHECKED
            continue
        verdicts[k] = _check(duration, pad, limits, work)
        if verdicts[k] == 0 and total < best_cost:
            best, best_cost = k, total
    return best


@compiled
def _place(T: float, start: Sequence[float], ends: Sequence[float], e: int, work: MutableSequence[float]) -> float:
    """Control points of the quintic into row 0 of `work`; returns the integral of squared jerk."""
    cost = 0.0
    v_step, a_step = T / 5.0, T * T / 20.0
    jerk_scale = 60.0 / (T * T * T)
    for axis in range(3):
        x0 = start[axis]
        x1 = x0 + start[3 + axis] * v_step
        x2 = x0 + 2.0 * start[3 + axis] * v_step + start[6 + axis] * a_step
        x5 = ends[e + axis]
        x4 = x5 - ends[e + 3 + axis] * v_step
        x3 = x5 - 2.0 * ends[e + 3 + axis] * v_step + ends[e + 6 + axis] * a_step
        row = 6 * axis
        work[row], work[row + 1], work[row + 2] = x0, x1, x2
        work[row + 3], work[row + 4], work[row + 5] = x3, x4, x5
        j0 = (x3 - 3.0 * x2 + 3.0 * x1 - x0) * jerk_scale
        j1 = (x4 - 3.0 * x3 + 3.0 * x2 - x1) * jerk_scale
        j2 = (x5 - 3.0 * x4 + 3.0 * x3 - x2) * jerk_scale
        cost += 0.2 * (j0 * j0 + j2 * j2 + j0 * j1 + j1 * j2) + (2.0 * j1 * j1 + j0 * j2) / 15.0
    return cost * T


@compiled
def _check(T: float, pad: Sequence[float], limits: Sequence[float], work: MutableSequence[float]) -> int:
    """0 where all sections hold, else why the first one does not. Rows of `work` are a stack of sections."""
    work[18], work[19] = T, 0.0
    top = 0
    while top >= 0:
        base = ROW * top
        width = work[base + 18]
        verdict = _motion(work, base, width, pad, limits)
        if verdict == 0:
            verdict = _place_in_space(work, base, width, pad, limits)
        if verdict == 0:
            top -= 1
        elif verdict > 0 or work[base + 19] >= MAX_DEPTH:
            return abs(verdict)
        else:
            _halve(work, base)
            top += 1
    return 0


@compiled
def _halve(work: MutableSequence[float], base: int) -> None:
    """de Casteljau at the middle: the later half stays in this row, the earlier goes on top of it."""
    upper = base + ROW
    for axis in range(3):
        r, u = base + 6 * axis, upper + 6 * axis
        a0, a1, a2, a3, a4, a5 = work[r], work[r + 1], work[r + 2], work[r + 3], work[r + 4], work[r + 5]
        b0, b1, b2, b3, b4 = 0.5 * (a0 + a1), 0.5 * (a1 + a2), 0.5 * (a2 + a3), 0.5 * (a3 + a4), 0.5 * (a4 + a5)
        c0, c1, c2, c3 = 0.5 * (b0 + b1), 0.5 * (b1 + b2), 0.5 * (b2 + b3), 0.5 * (b3 + b4)
        d0, d1, d2 = 0.5 * (c0 + c1), 0.5 * (c1 + c2), 0.5 * (c2 + c3)
        e0, e1 = 0.5 * (d0 + d1), 0.5 * (d1 + d2)
        f0 = 0.5 * (e0 + e1)
        work[u], work[u + 1], work[u + 2], work[u + 3], work[u + 4], work[u + 5] = a0, b0, c0, d0, e0, f0
        work[r], work[r + 1], work[r + 2], work[r + 3], work[r + 4] = f0, e1, d2, c3, b4
    work[base + 18] *= 0.5
    work[base + 19] += 1.0
    work[upper + 18], work[upper + 19] = work[base + 18], work[base + 19]


@compiled
def _motion(work: Sequence[float], base: int, width: float, pad: Sequence[float], limits: Sequence[float]) -> int:
    """Velocity, acceleration, jerk, thrust, body rate of one section: 0 holds, positive violated, negative unclear."""
    unclear = 0
    scale = 5.0 / width
    for i in range(5):
        vx = (work[base + i + 1] - work[base + i]) * scale
        vy = (work[base + i + 7] - work[base + i + 6]) * scale
        vz = (work[base + i + 13] - work[base + i + 12]) * scale
        reason = 0
        if vx * vx + vy * vy > limits[L_RELATIVE2]:
            reason = 4
        for m in range(0, 6, 3):
            sx, sy, sz = vx + pad[m], vy + pad[m + 1], vz + pad[m + 2]
            if sx * sx + sy * sy > limits[L_SPEED2]:
                reason = 1
            elif -sz > limits[L_CLIMB]:
                reason = 2
            elif sz > limits[L_DESCENT]:
                reason = 3
        if reason:
            if i == 0 or i == 4:
                return reason
            unclear = -reason
    scale = 20.0 / (width * width)
    lift = math.inf
    for i in range(4):
        ax = (work[base + i + 2] - 2.0 * work[base + i + 1] + work[base + i]) * scale
        ay = (work[base + i + 8] - 2.0 * work[base + i + 7] + work[base + i + 6]) * scale
        az = (work[base + i + 14] - 2.0 * work[base + i + 13] + work[base + i + 12]) * scale
        reason = 0
        for m in range(2):
            sx, sy, sz = ax + m * pad[6], ay + m * pad[7], az + m * pad[8]
            up = limits[L_GRAVITY] - sz
            flat = sx * sx + sy * sy
            lift = min(lift, up)
            if flat + sz * sz > limits[L_ACCELERATION2]:
                reason = 5
            elif flat + up * up > limits[L_THRUST2]:
                reason = 7
            elif up < limits[L_LIFT]:
                reason = 8
        if reason:
            if i == 0 or i == 3:
                return reason
            unclear = -reason
    scale = 60.0 / (width * width * width)
    rate2 = limits[L_RATE2] * lift * lift if lift > 0.0 else 0.0
    for i in range(3):
        jx = (work[base + i + 3] - 3.0 * work[base + i + 2] + 3.0 * work[base + i + 1] - work[base + i]) * scale
        jy = (work[base + i + 9] - 3.0 * work[base + i + 8] + 3.0 * work[base + i + 7] - work[base + i + 6]) * scale
        jz = (work[base + i + 15] - 3.0 * work[base + i + 14] + 3.0 * work[base + i + 13] - work[base + i + 12]) * scale
        jerk2 = jx * jx + jy * jy + jz * jz
        if jerk2 > limits[L_JERK2]:
            if i == 0 or i == 2:
                return 6
            unclear = -6
        elif jerk2 > rate2:
            unclear = -9
    return unclear


@compiled
def _place_in_space(
    work: Sequence[float], base: int, width: float, pad: Sequence[float], limits: Sequence[float]
) -> int:
    """Floor, descent cone and view of one section: 0 holds, positive violated, negative unclear."""
    unclear = 0
    above_top, high = True, False
    for i in range(6):
        z = work[base + 12 + i]
        above_top = above_top and -z >= limits[L_CONE_TOP]
        high = high or -z >= limits[L_VIEW_HEIGHT]
        if z > limits[L_FLOOR_Z]:
            if i == 0 or i == 5:
                return 10
            unclear = -10
    if limits[L_CONE_RADIUS] >= 0.0 and not above_top:
        verdict = _cone(work, base, limits)
        if verdict > 0:
            return verdict
        unclear = verdict if verdict else unclear
    if limits[L_VIEW_COSINE] > 0.0 and high:
        verdict = _view(work, base, width, pad, limits)
        if verdict > 0:
            return verdict
        unclear = verdict if verdict else unclear
    return unclear


@compiled
def _cone(work: Sequence[float], base: int, limits: Sequence[float]) -> int:
    unclear = 0
    for i in range(6):
        x, y, z = work[base + i], work[base + 6 + i], work[base + 12 + i]
        radius = limits[L_CONE_RADIUS] - limits[L_CONE_SLOPE] * z
        if radius < 0.0 or x * x + y * y > radius * radius:
            if (i == 0 or i == 5) and -z < limits[L_CONE_TOP]:
                return 12
            unclear = -12
    return unclear


@compiled
def _view(work: Sequence[float], base: int, width: float, pad: Sequence[float], limits: Sequence[float]) -> int:
    """Every position control point against every acceleration control point (see view.py for why that is a proof)."""
    scale = 20.0 / (width * width)
    cosine2 = limits[L_VIEW_COSINE] * limits[L_VIEW_COSINE]
    unclear = 0
    for j in range(4):
        ax = (work[base + j + 2] - 2.0 * work[base + j + 1] + work[base + j]) * scale
        ay = (work[base + j + 8] - 2.0 * work[base + j + 7] + work[base + j + 6]) * scale
        az = (work[base + j + 14] - 2.0 * work[base + j + 13] + work[base + j + 12]) * scale
        for m in range(2):
            wx, wy, wz = -ax - m * pad[6], -ay - m * pad[7], limits[L_GRAVITY] - az - m * pad[8]
            reach2 = cosine2 * (wx * wx + wy * wy + wz * wz)
            for i in range(6):
                x, y, z = work[base + i], work[base + 6 + i], work[base + 12 + i]
                along = -(x * wx + y * wy + z * wz)
                if along < 0.0 or along * along < reach2 * (x * x + y * y + z * z):
                    at_start, at_end = i == 0 and j == 0, i == 5 and j == 3
                    if (at_start or at_end) and -z >= limits[L_VIEW_HEIGHT]:
                        return 11
                    unclear = -11
    return unclear
