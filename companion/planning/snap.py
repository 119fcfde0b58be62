"""Kernel of minimum snap: the derivatives at the waypoints that make the integral of squared snap least.

Each piece is a septic in Hermite form: position, velocity, acceleration and jerk at its two ends, which makes the path
three times smooth by construction. The squared snap is then a quadratic form in those values, only the inner velocities,
accelerations and jerks are unknown, and a waypoint touches its two neighbours only: a block-tridiagonal system with 3 x 3
blocks, the same for all three axes. Time is scaled by the mean duration, which keeps it well conditioned. Flat arrays;
called by min_snap. `GRAM` is the snap integral of the unit septic over (p0, v0, a0, j0, p1, v1, a1, j1).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from companion.compiled import compiled

Array = npt.NDArray[np.float64]


def _hermite() -> Array:
    """(p0, v0, a0, j0, p1, v1, a1, j1) of the unit septic to its coefficients, lowest power first."""
    rows = np.zeros((8, 8))
    for k in range(4):
        rows[k, k] = math.factorial(k)
        rows[4 + k, k:] = [math.perm(m, k) for m in range(k, 8)]
    return np.asarray(np.linalg.inv(rows), dtype=np.float64)


def _gram(hermite: Array) -> Array:
    snap = np.zeros((8, 8))
    for i in range(4, 8):
        for j in range(4, 8):
            snap[i, j] = math.perm(i, 4) * math.perm(j, 4) / (i + j - 7)
    product: Array = hermite.T @ snap @ hermite
    return product


HERMITE = _hermite()
GRAM = _gram(HERMITE)


@compiled
def solve(waypoints: Array, durations: Array, start: Array, end: Array, gram: Array) -> Array:
    """Position, velocity, acceleration, jerk (n + 1, 4, 3) at all waypoints.

    `waypoints` (n + 1, 3) m, `durations` (n,) s, `start` and `end` (3, 3): rows velocity, acceleration, jerk there.
    """
    n = len(durations)
    unit = 0.0
    for i in range(n):
        unit += durations[i] / n
    state = np.zeros((n + 1, 4, 3))
    power = 1.0
    for k in range(3):
        power *= unit
        for axis in range(3):
            state[0, 1 + k, axis] = start[k, axis] * power
            state[n, 1 + k, axis] = end[k, axis] * power
    for i in range(n + 1):
        for axis in range(3):
            state[i, 0, axis] = waypoints[i, axis]
    if n > 1:
        _eliminate(state, durations, unit, gram)
    power = 1.0
    for k in range(1, 4):
        power *= unit
        for i in range(n + 1):
            for axis in range(3):
                state[i, k, axis] /= power
    return state


@compiled
def _eliminate(state: Array, durations: Array, unit: float, gram: Array) -> None:
    """Block elimination forwards, substitution backwards (Thomas), into `state[1:-1, 1:]`."""
    n = len(durations)
    factors = np.empty((n, 3, 3))  # inverse pivot times the block to the right
    right = np.empty((n, 3, 3))  # inverse pivot times the right-hand side, unknown x axis
    pivot = np.empty((3, 3))
    inverse = np.empty((3, 3))
    side = np.empty((3, 3))
    before = np.empty(8)
    after = np.empty(8)
    _powers(durations[0] / unit, before)
    for i in range(1, n):
        _powers(durations[i] / unit, after)
        for r in range(3):
            for c in range(3):
                pivot[r, c] = (
                    gram[5 + r, 5 + c] * before[r + 1] * before[c + 1] * before[7]
                    + gram[1 + r, 1 + c] * after[r + 1] * after[c + 1] * after[7]
                )
            for axis in range(3):
                known = before[r + 1] * before[7] * (
                    gram[5 + r, 0] * state[i - 1, 0, axis] + gram[5 + r, 4] * state[i, 0, axis]
                ) + after[r + 1] * after[7] * (
                    gram[1 + r, 0] * state[i, 0, axis] + gram[1 + r, 4] * state[i + 1, 0, axis]
                )
                if i == 1:
                    for c in range(3):
                        known += gram[5 + r, 1 + c] * before[r + 1] * before[c + 1] * before[7] * state[0, 1 + c, axis]
                if i == n - 1:
                    for c in range(3):
                        known += gram[1 + r, 5 + c] * after[r + 1] * after[c + 1] * after[7] * state[n, 1 + c, axis]
                side[r, axis] = -known
        if i > 1:
            for r in range(3):
                for m in range(3):
                    left = gram[5 + r, 1 + m] * before[r + 1] * before[m + 1] * before[7]
                    for c in range(3):
                        pivot[r, c] -= left * factors[i - 1, m, c]
                        side[r, c] -= left * right[i - 1, m, c]
        _invert(pivot, inverse)
        for r in range(3):
            for c in range(3):
                total = block = 0.0
                for m in range(3):
                    total += inverse[r, m] * side[m, c]
                    block += inverse[r, m] * gram[1 + m, 5 + c] * after[m + 1] * after[c + 1] * after[7]
                right[i, r, c] = total
                factors[i, r, c] = block
        for k in range(8):
            before[k] = after[k]
    for i in range(n - 1, 0, -1):
        for r in range(3):
            for axis in range(3):
                value = right[i, r, axis]
                if i < n - 1:
                    for c in range(3):
                        value -= factors[i, r, c] * state[i + 1, 1 + c, axis]
                state[i, 1 + r, axis] = value


@compiled
def _powers(t: float, out: Array) -> None:
    """1, t, t2, t3 in places 0 to 3, t to the minus seventh in place 7: what a duration makes of the unit form."""
    out[0] = 1.0
    out[1] = t
    out[2] = t * t
    out[3] = t * t * t
    out[7] = 1.0 / (out[3] * out[3] * t)


@compiled
def _invert(m: Array, out: Array) -> None:
    """Inverse of a symmetric positive definite 3 x 3 matrix by cofactors."""
    out[0, 0] = m[1, 1] * m[2, 2] - m[1, 2] * m[2, 1]
    out[0, 1] = m[0, 2] * m[2, 1] - m[0, 1] * m[2, 2]
    out[0, 2] = m[0, 1] * m[1, 2] - m[0, 2] * m[1, 1]
    out[1, 1] = m[0, 0] * m[2, 2] - m[0, 2] * m[2, 0]
    out[1, 2] = m[0, 2] * m[1, 0] - m[0, 0] * m[1, 2]
    out[2, 2] = m[0, 0] * m[1, 1] - m[0, 1] * m[1, 0]
    scale = 1.0 / (
        m[0, 0] * out[0, 0]
        + m[0, 1] * (m[1, 2] * m[2, 0] - m[1, 0] * m[2, 2])
        + m[0, 2] * (m[1, 0] * m[2, 1] - m[1, 1] * m[2, 0])
    )
    for r in range(3):
        for c in range(r, 3):
            out[r, c] *= scale
            out[c, r] = out[r, c]


def polynomials(state: Array, durations: Array) -> Array:
    """Coefficients (n, 3, 8) over seconds, highest power first, of the pieces between the states (n + 1, 4, 3)."""
    powers = durations[:, None] ** np.arange(8.0)
    ends = np.concatenate([state[:-1], state[1:]], axis=1)
    scaled = ends * np.concatenate([powers[:, :4], powers[:, :4]], axis=1)[:, :, None]
    low = np.einsum("ij,njk->nki", HERMITE, scaled) / powers[:, None, :]
    return np.asarray(low[:, :, ::-1])


def snap_cost(state: Array, durations: Array) -> float:
    """Integral of squared snap, m2/s7."""
    powers = durations[:, None] ** np.arange(4.0)
    ends = np.concatenate([state[:-1] * powers[:, :, None], state[1:] * powers[:, :, None]], axis=1)
    return float((np.einsum("nik,ij,njk->n", ends, GRAM, ends) / durations**7).sum())
