"""Filter arithmetic: predict and update as small functions over flat sequences, textbook letters.

`x` is a list of n floats, `P` its covariance, row after row in one list of n * n floats (P[i * n + j]). The functions change
them in place. For six to ten states this is several times faster than NumPy, whose calls cost more than the arithmetic.

One scalar at a time: a measurement with correlated components is decorrelated first, so no matrix is ever inverted, and
a component that fails its gate is left out without touching the others. Called by the models' filters.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

Vector = list[float]

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
    Both products are sums of whole rows; the second works on the transpose, which slices of stride n give for nothing.
    """
    entries = list(zip(rows, columns, values, strict=True))
    before = [P[i : i + n] for i in range(0, n * n, n)]
    half = before[:]
    for row, column, f in entries:
        half[row] = [a + f * b for a, b in zip(half[row], before[column], strict=True)]
    flat = [value for row in half for value in row]
    turned = [flat[i::n] for i in range(n)]
    result = turned[:]
    for row, column, f in entries:
        result[row] = [a + f * b for a, b in zip(result[row], turned[column], strict=True)]
    P[:] = [value for row in result for value in row]


def scale_state(P: Vector, n: int, i: int, factor: float) -> None:
    """P <- F P F' where F only multiplies state i by `factor`."""
    for j in range(n):
        P[i * n + j] *= factor
        P[j * n + i] *= factor


def log_likelihood(y: float, S: float) -> float:
    """Of a scalar innovation y with variance S."""
    return -0.5 * (LOG_2_PI + math.log(S) + y * y / S)


def forget(P: Vector, n: int, i: int, variance: float) -> None:
    """State i is no longer tied to the others, and known only to `variance`."""
    for j in range(n):
        P[i * n + j] = 0.0
        P[j * n + i] = 0.0
    P[i * n + i] = variance
