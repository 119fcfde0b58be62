"""Filter arithmetic: predict and update as small functions over flat sequences, textbook letters.

`x` is a list of n floats, `P` its covariance, row after row in one list of n * n floats (P[i * n + j]). The functions change
them in place. For six to ten states this is several times faster than NumPy, whose calls cost more than the arithmetic.

One scalar at a time: a measurement with correlated components is decorrelated first, so no matrix is ever inverted, and
a component that fails its gate is left out without touching the others. Called by the models' filters.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from companion.compiled import COMPILED, compiled

Vector = list[float]
Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

LOG_2_PI = math.log(2.0 * math.pi)


def update_scalar(
    x: Vector,
    P: Vector,
    n: int,
    indices: Sequence[int],
    coefficients: Sequence[float],
    y: float,
    R: float,
    g: Vector,
) -> float:
    """Fuse one scalar z = sum of coefficients[k] * x[indices[k]] + noise of variance R > 0, y = z - h(x). Returns S.

    `g` is room for n floats. P - P h' h P / S is formed on one triangle and mirrored, so that P stays symmetric to the
    last bit; with scalar updates this is as stable as Joseph's form while R > 0 and costs a third.
    """
    i0, c0 = indices[0], coefficients[0]
    for i in range(n):
        g[i] = c0 * P[i * n + i0]
    for k in range(1, len(indices)):
        ik, ck = indices[k], coefficients[k]
        for i in range(n):
            g[i] += ck * P[i * n + ik]
    S = R
    for k in range(len(indices)):
        S += coefficients[k] * g[indices[k]]
    for i in range(n):
        gain = g[i] / S
        x[i] += gain * y
        row = i * n
        for j in range(i + 1):
            value = P[row + j] - gain * g[j]
            P[row + j] = value
            P[j * n + i] = value
    return S


def transform_covariance(
    P: Vector, n: int, rows: Sequence[int], columns: Sequence[int], values: Sequence[float]
) -> None:
    """P <- F P F' with F = I + sum of values[k] at (rows[k], columns[k]).

    Motion models are nearly the identity: with a dozen entries this is five times fewer operations than the dense product.
    Both products are sums of whole rows, each row formed at once; the second works on the transpose. A large P goes through the
    same additions in machine code where there is a compiler: the same bits in a sixth of the time.
    """
    if COMPILED and n >= COMPILED_FROM:
        at = _places(tuple(rows), tuple(columns))
        P[:] = _transformed(np.array(P), n, at[0], at[1], np.array(values)).tolist()
        return
    changed = [(row, from_rows, [values[k] for k in at]) for row, from_rows, at in _by_row(tuple(rows), tuple(columns))]
    before: list[Sequence[float]] = [P[i : i + n] for i in range(0, n * n, n)]
    half = before[:]
    for row, from_rows, f in changed:
        half[row] = _summed(before, row, from_rows, f)
    turned: list[Sequence[float]] = list(zip(*half, strict=True))
    result = turned[:]
    for row, from_rows, f in changed:
        result[row] = _summed(turned, row, from_rows, f)
    P[:] = [value for row in result for value in row]


COMPILED_FROM = 6
"""States from which the way into an array and back is worth it."""


@functools.cache
def _places(rows: tuple[int, ...], columns: tuple[int, ...]) -> tuple[Indices, Indices]:
    return np.array(rows, np.int64), np.array(columns, np.int64)


@compiled
def _transformed(P: Array, n: int, rows: Indices, columns: Indices, values: Array) -> Array:
    """F P F' as `transform_covariance` forms it, addition by addition."""
    half = P.copy()
    for k in range(len(values)):
        row, column, value = rows[k] * n, columns[k] * n, values[k]
        for j in range(n):
            half[row + j] += value * P[column + j]
    turned = np.empty_like(half)
    for i in range(n):
        for j in range(n):
            turned[i * n + j] = half[j * n + i]
    result = turned.copy()
    for k in range(len(values)):
        row, column, value = rows[k] * n, columns[k] * n, values[k]
        for j in range(n):
            result[row + j] += value * turned[column + j]
    return result


@dataclass(frozen=True, slots=True)
class Step:
    """What one prediction does to a covariance of n x n, apart from the numbers: F = I + values at (rows, columns), then noise
    added to the elements `noise_at` (i * n + j), one after the other, then the states `fading` multiplied."""

    n: int
    rows: tuple[int, ...]
    columns: tuple[int, ...]
    noise_at: tuple[int, ...]
    fading: tuple[int, ...]
    arrays: tuple[Indices, Indices, Indices, Indices] = field(init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        indices = (self.rows, self.columns, self.noise_at, self.fading)
        object.__setattr__(self, "arrays", tuple(np.array(each, np.int64) for each in indices))


def predict_covariance(
    P: Vector, step: Step, values: Sequence[float], noise: Sequence[float], decay: float, gained: float
) -> None:
    """P <- D (F P F' + noise) D' + gained, in place, in one go: D multiplies each of `step.fading` by `decay`, and these gain the
    variance `gained`. In machine code where there is a compiler, to the same bits."""
    if COMPILED and step.n >= COMPILED_FROM:
        numbers = np.array((*values, *noise))
        P[:] = _predicted(np.array(P), step.n, *step.arrays, numbers, decay, gained).tolist()
        return
    n = step.n
    transform_covariance(P, n, step.rows, step.columns, values)
    for place, amount in zip(step.noise_at, noise, strict=True):
        P[place] += amount
    for i in step.fading:
        scale_state(P, n, i, decay)
        P[i * n + i] += gained


@compiled
def _predicted(
    P: Array,
    n: int,
    rows: Indices,
    columns: Indices,
    noise_at: Indices,
    fading: Indices,
    numbers: Array,
    decay: float,
    gained: float,
) -> Array:
    """`predict_covariance`, addition by addition; `numbers` are the values of F - I, then the noise."""
    count = len(rows)
    result = _transformed(P, n, rows, columns, numbers[:count])
    for k in range(len(noise_at)):
        result[noise_at[k]] += numbers[count + k]
    for k in range(len(fading)):
        i = fading[k]
        for j in range(n):
            result[i * n + j] *= decay
        for j in range(n):
            result[j * n + i] *= decay
        result[i * n + i] += gained
    return result


def warm_up() -> None:
    """Compile, or load from the cache, before anything flies: the first call takes a second where nothing is cached."""
    transform_covariance([0.0] * COMPILED_FROM**2, COMPILED_FROM, (0,), (1,), (0.5,))
    predict_covariance([0.0] * COMPILED_FROM**2, Step(COMPILED_FROM, (0,), (1,), (0,), (2,)), (0.5,), (0.0,), 1.0, 0.0)


@functools.cache
def _by_row(
    rows: tuple[int, ...], columns: tuple[int, ...]
) -> tuple[tuple[int, tuple[int, ...], tuple[int, ...]], ...]:
    """Entries gathered by row: (row, its columns, where their values stand)."""
    at = {row: tuple(k for k, other in enumerate(rows) if other == row) for row in rows}
    return tuple((row, tuple(columns[k] for k in places), places) for row, places in at.items())


def _summed(matrix: Sequence[Sequence[float]], row: int, from_rows: Sequence[int], f: Vector) -> Sequence[float]:
    """matrix[row] + sum of f[k] * matrix[from_rows[k]], in this order. One pass over the columns is what makes it quick."""
    own = matrix[row]
    if len(f) == 1:
        f0 = f[0]
        return [a + f0 * b for a, b in zip(own, matrix[from_rows[0]], strict=True)]
    if len(f) == 2:
        f0, f1 = f
        i, j = from_rows
        return [a + f0 * b + f1 * c for a, b, c in zip(own, matrix[i], matrix[j], strict=True)]
    if len(f) == 4:
        f0, f1, f2, f3 = f
        i, j, k, m = from_rows
        rows = zip(own, matrix[i], matrix[j], matrix[k], matrix[m], strict=True)
        return [a + f0 * b + f1 * c + f2 * d + f3 * e for a, b, c, d, e in rows]
    if len(f) == 5:
        f0, f1, f2, f3, f4 = f
        i, j, k, m, o = from_rows
        wide = zip(own, matrix[i], matrix[j], matrix[k], matrix[m], matrix[o], strict=True)
        return [a + f0 * b + f1 * c + f2 * d + f3 * e + f4 * g for a, b, c, d, e, g in wide]
    for factor, other in zip(f, from_rows, strict=True):
        own = [a + factor * b for a, b in zip(own, matrix[other], strict=True)]
    return own


def scale_state(P: Vector, n: int, i: int, factor: float) -> None:
    """P <- F P F' where F only multiplies state i by `factor`."""
    row = slice(i * n, i * n + n)
    P[row] = [value * factor for value in P[row]]
    P[i::n] = [value * factor for value in P[i::n]]


def log_likelihood(y: float, S: float) -> float:
    """Of a scalar innovation y with variance S."""
    return -0.5 * (LOG_2_PI + math.log(S) + y * y / S)


def forget(P: Vector, n: int, i: int, variance: float) -> None:
    """State i is no longer tied to the others, and known only to `variance`."""
    for j in range(n):
        P[i * n + j] = 0.0
        P[j * n + i] = 0.0
    P[i * n + i] = variance
