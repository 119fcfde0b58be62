"""Filter arithmetic: predict and update as small functions over flat sequences, textbook letters.

`x` is a sequence of n floats, `P` its covariance, row after row in one sequence of n * n floats (P[i * n + j]). The
functions change them in place. They run as they stand on Python lists, and compiled (compiled.py) on NumPy arrays, with
the same operations in the same order. That is why they use loops and indices and call nothing but each other and `math`.

One scalar at a time: a measurement with correlated components is decorrelated first, so no matrix is ever inverted, and
a component that fails its gate is left out without touching the others. Called by the models' filters.
"""

from __future__ import annotations

import math
from collections.abc import MutableSequence, Sequence

Vector = MutableSequence[float]

LOG_2_PI = math.log(2.0 * math.pi)


def innovation_variance(P: Sequence[float], n: int, h: Sequence[float], R: float) -> float:
    """S = h P h' + R of a scalar measurement h x."""
    S = R
    for i in range(n):
        if h[i] != 0.0:
            row = 0.0
            for j in range(n):
                if h[j] != 0.0:
                    row += P[i * n + j] * h[j]
            S += h[i] * row
    return S


def update_scalar(x: Vector, P: Vector, n: int, h: Sequence[float], y: float, R: float, g: Vector) -> float:
    """Fuse one scalar: y = z - h(x) with h linearised as the row `h`, variance R > 0. Returns S.

    `g` is room for n floats. P - P h' h P / S is formed on one triangle and mirrored, so that P stays symmetric to the
    last bit; with scalar updates this is as stable as Joseph's form while R > 0 and costs a third.
    """
    S = R
    for i in range(n):
        total = 0.0
        for j in range(n):
            if h[j] != 0.0:
                total += P[i * n + j] * h[j]
        g[i] = total
        S += h[i] * total
    for i in range(n):
        k = g[i] / S
        x[i] += k * y
        for j in range(i + 1):
            value = P[i * n + j] - k * g[j]
            P[i * n + j] = value
            P[j * n + i] = value
    return S


def transform_covariance(
    P: Vector, n: int, rows: Sequence[int], columns: Sequence[int], values: Sequence[float], count: int, work: Vector
) -> None:
    """P <- F P F' with F = I + sum of values[k] at (rows[k], columns[k]), k < count. `work` has room for n * n floats.

    Motion models are nearly the identity: with a dozen entries this is five times fewer operations than the dense product.
    """
    for i in range(n * n):
        work[i] = P[i]
    for k in range(count):
        to, source, f = rows[k] * n, columns[k] * n, values[k]
        if f != 0.0:
            for j in range(n):
                work[to + j] += f * P[source + j]
    for i in range(n * n):
        P[i] = work[i]
    for k in range(count):
        to, source, f = rows[k], columns[k], values[k]
        if f != 0.0:
            for i in range(n):
                P[i * n + to] += f * work[i * n + source]


def log_likelihood(y: float, S: float) -> float:
    """Of a scalar innovation y with variance S."""
    return -0.5 * (LOG_2_PI + math.log(S) + y * y / S)


def inflate(P: Vector, n: int, i: int, variance: float) -> None:
    """Add `variance` to state i: what is known of it is trusted that much less."""
    P[i * n + i] += variance


def forget(P: Vector, n: int, i: int, variance: float) -> None:
    """State i is no longer tied to the others, and known only to `variance`."""
    for j in range(n):
        P[i * n + j] = 0.0
        P[j * n + i] = 0.0
    P[i * n + i] = variance
