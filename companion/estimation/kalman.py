"""Filter arithmetic: predict and update as small functions over flat sequences, textbook letters.

`x` is a list of n floats, `P` its covariance, row after row in one sequence of n * n floats (P[i * n + j]). The functions change
them in place. For six to ten states this is several times faster than NumPy, whose calls cost more than the arithmetic. The P of
a motion model is what `room` gives: an array for machine code where there is a compiler, a list where there is none; both ways do
the same operations in the same order, to the same bits.

One scalar at a time: a measurement with correlated components is decorrelated first, so no matrix is ever inverted, and
a component that fails its gate is left out without touching the others. Called by the models' filters.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from companion.compiled import compiled, room

Vector = list[float]
Array = npt.NDArray[np.float64]
Covariance = Vector | Array
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
    Both products are sums of whole rows, each row formed at once; the second works on the transpose.
    """
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


@dataclass(frozen=True, slots=True)
class Step:
    """What one prediction does to a covariance of n x n, apart from the numbers: F = I + values at (rows, columns), then noise
    added to the elements `noise_at` (i * n + j), one after the other, then the states `fading` multiplied."""

    n: int
    rows: tuple[int, ...]
    columns: tuple[int, ...]
    noise_at: tuple[int, ...]
    fading: tuple[int, ...]
    packed: Indices = field(init=False, compare=False, repr=False)
    """For the kernel: n, how many entries, noises and fading states, then these."""

    def __post_init__(self) -> None:
        counts = (self.n, len(self.rows), len(self.noise_at), len(self.fading))
        packed = np.array((*counts, *self.rows, *self.columns, *self.noise_at, *self.fading), np.int64)
        object.__setattr__(self, "packed", packed)


def predict_covariance(
    P: Covariance, step: Step, values: Sequence[float], noise: Sequence[float], decay: float, gained: float
) -> None:
    """P <- D (F P F' + noise) D' + gained, in place, in one go: D multiplies each of `step.fading` by `decay`, and these gain the
    variance `gained`."""
    if not isinstance(P, list):
        _predict(P, step.packed, np.array((*values, *noise, decay, gained)))
        return
    n = step.n
    transform_covariance(P, n, step.rows, step.columns, values)
    for place, amount in zip(step.noise_at, noise, strict=True):
        P[place] += amount
    for i in step.fading:
        scale_state(P, n, i, decay)
        P[i * n + i] += gained


@compiled
def _predict(P: Array, step: Indices, numbers: Array) -> None:
    """`predict_covariance`, addition by addition; `numbers` are the values of F - I, the noise, decay and gained."""
    n, entries, noises, fading = step[0], step[1], step[2], step[3]
    columns_at, noise_at, fading_at = 4 + entries, 4 + 2 * entries, 4 + 2 * entries + noises
    half = P.copy()
    for k in range(entries):
        row, column, value = step[4 + k] * n, step[columns_at + k] * n, numbers[k]
        for j in range(n):
            half[row + j] += value * P[column + j]
    turned = np.empty_like(P)
    for i in range(n):
        for j in range(n):
            turned[i * n + j] = half[j * n + i]
    P[:] = turned
    for k in range(entries):
        row, column, value = step[4 + k] * n, step[columns_at + k] * n, numbers[k]
        for j in range(n):
            P[row + j] += value * turned[column + j]
    for k in range(noises):
        P[step[noise_at + k]] += numbers[entries + k]
    decay, gained = numbers[entries + noises], numbers[entries + noises + 1]
    for k in range(fading):
        i = step[fading_at + k]
        for j in range(n):
            P[i * n + j] *= decay
        for j in range(n):
            P[j * n + i] *= decay
        P[i * n + i] += gained


def packed(rows: Sequence[tuple[Sequence[int], Sequence[float], float, float]]) -> tuple[Indices, Array]:
    """Scalars (indices, coefficients, z, R) for `fuse`: how many and, of each, its length and indices; z, R and coefficients."""
    places: list[int] = [len(rows)]
    numbers: list[float] = []
    for indices, coefficients, z, R in rows:
        places += (len(indices), *indices)
        numbers += (z, R, *coefficients)
    return np.array(places, np.int64), np.array(numbers)


_update_scalar_compiled: Any = compiled(update_scalar)


@compiled
def fuse(x: Array, P: Array, places: Indices, numbers: Array) -> Array:
    """Fuse what `packed` made, one scalar after the other; returns innovation and its variance of each."""
    told, g = np.empty(2 * places[0]), np.empty(len(x))
    i, k = 1, 0
    for row in range(places[0]):
        length, z, R = places[i], numbers[k], numbers[k + 1]
        indices, coefficients = places[i + 1 : i + 1 + length], numbers[k + 2 : k + 2 + length]
        y = z
        for m in range(length):
            y -= coefficients[m] * x[indices[m]]
        told[2 * row] = y
        told[2 * row + 1] = _update_scalar_compiled(x, P, len(x), indices, coefficients, y, R, g)
        i, k = i + 1 + length, k + 2 + length
    return told


def update_state(x: Vector, P: Covariance, index: int, y: float, R: float) -> None:
    """Fuse a scalar that is one state, plus noise of variance R; y is the residual."""
    n = len(x)
    if isinstance(P, list):
        update_scalar(x, P, n, (index,), (1.0,), y, R, [0.0] * n)
        return
    mean = np.array(x)
    _update_scalar_compiled(mean, P, n, np.array((index,), np.int64), np.array((1.0,)), y, R, np.empty(n))
    x[:] = mean.tolist()


@compiled
def moments(weights: Array, means: Array, sizes: Indices, P: Array, shared: int) -> Array:
    """Mean, then covariance of the first `shared` states of a mixture. `means` holds these states of one component after the
    other, `P` the whole covariances, of `sizes` squared."""
    total = 0.0
    for k in range(len(weights)):
        total += weights[k]
    scale = 1.0 / total
    result = np.zeros(shared + shared * shared)
    for k in range(len(weights)):
        for i in range(shared):
            result[i] += weights[k] * means[k * shared + i]
    for i in range(shared):
        result[i] *= scale
    d, start = np.empty(shared), 0
    for k in range(len(weights)):
        w, n = weights[k] * scale, sizes[k]
        for i in range(shared):
            d[i] = means[k * shared + i] - result[i]
        for i in range(shared):
            for j in range(i + 1):
                result[shared + i * shared + j] += w * (P[start + i * n + j] + d[i] * d[j])
        start += n * n
    for i in range(shared):
        for j in range(i):
            result[shared + j * shared + i] = result[shared + i * shared + j]
    return result


def replace_shared(P: Covariance, n: int, own: Vector, shared: int, keep: float) -> None:
    """P with the covariance `own` of the first `shared` states; the ties of these to the others are kept to the part `keep`."""
    if isinstance(P, list):
        _replace_shared(P, n, own, shared, keep)
    else:
        _replace_shared_compiled(P, n, np.array(own), shared, keep)


def _replace_shared(P: Vector, n: int, own: Vector, shared: int, keep: float) -> None:
    for i in range(shared):
        for j in range(shared):
            P[i * n + j] = own[i * shared + j]
        for j in range(shared, n):
            P[i * n + j] *= keep
            P[j * n + i] *= keep


_replace_shared_compiled: Any = compiled(_replace_shared)


def warm_up() -> None:
    """Compile, or load from the cache, before anything flies: the first call takes a second where nothing is cached."""
    x, P = [0.0], room([1.0])
    predict_covariance(P, Step(1, (0,), (0,), (0,), (0,)), (0.5,), (0.0,), 1.0, 0.0)
    update_state(x, P, 0, 0.0, 1.0)
    if not isinstance(P, list):
        one = np.ones(1)
        fuse(np.array(x), P, *packed([((0,), (1.0,), 0.0, 1.0)]))
        moments(one, one, np.array([1]), P, 1)
        replace_shared(P, 1, [1.0], 1, 1.0)


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


def scale_state(P: Covariance, n: int, i: int, factor: float) -> None:
    """P <- F P F' where F only multiplies state i by `factor`."""
    row = slice(i * n, i * n + n)
    P[row] = [value * factor for value in P[row]]
    P[i::n] = [value * factor for value in P[i::n]]


def log_likelihood(y: float, S: float) -> float:
    """Of a scalar innovation y with variance S."""
    return -0.5 * (LOG_2_PI + math.log(S) + y * y / S)


def forget(P: Covariance, n: int, i: int, variance: float) -> None:
    """State i is no longer tied to the others, and known only to `variance`."""
    for j in range(n):
        P[i * n + j] = 0.0
        P[j * n + i] = 0.0
    P[i * n + i] = variance
