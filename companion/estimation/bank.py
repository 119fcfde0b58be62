"""Several motion models side by side, weighted by how well each foresees the measurements (interacting multiple model).

Before each prediction the models exchange what they share (position, beacon bias, velocity); what a model adds it keeps to
itself, so a turn rate is not diluted by a model that has none. A bank of one model is that model alone: every estimator
here is a bank. Frame O, NED, SI. Used by track.py.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import itemgetter

import numpy as np

from companion.compiled import room
from companion.estimation.kalman import (
    Array,
    Covariance,
    Indices,
    Vector,
    fuse,
    log_likelihood,
    moments,
    packed,
    replace_shared,
    update_scalar,
    update_state,
)
from companion.estimation.motion import SHARED, VX, VY, Motion, MotionModel, X, Y

LEAST_SHARE = 1e-3
"""Contributions below this are left out of a mixture: they cost as much as the large ones."""
LEAST_TO_LOOK_AHEAD = 0.02
"""A prediction that is only looked at does without models less probable than this."""
LEAST_PROBABILITY = 1e-3
"""No model is ever given up: the pad may start to turn at any time."""

LOWER = tuple((i, j) for i in range(SHARED) for j in range(i + 1))
LOWER_ROW, LOWER_COLUMN = itemgetter(*(i for i, _ in LOWER)), itemgetter(*(j for _, j in LOWER))
MIRROR = itemgetter(*(LOWER.index((max(i, j), min(i, j))) for i in range(SHARED) for j in range(SHARED)))
"""Elements of a symmetric matrix out of its lower triangle."""


@functools.cache
def lower_of(n: int) -> Callable[[Covariance], tuple[float, ...]]:
    """The lower triangle of the shared states out of a covariance of n x n."""
    return itemgetter(*(i * n + j for i, j in LOWER))


@dataclass(slots=True)
class Member:
    """One model with its mean, covariance and probability."""

    model: MotionModel
    x: Vector
    P: Covariance
    probability: float

    def copied(self) -> Member:
        return Member(self.model, self.x[:], self.P.copy(), self.probability)

    def with_own_mean(self) -> Member:
        """A copy that shares the covariance: only its mean and its probability may be changed."""
        return Member(self.model, self.x[:], self.P, self.probability)


@dataclass(slots=True)
class Mixture:
    """First two moments over the shared states, and the motion, of the whole bank."""

    x: list[float]
    P: list[float]
    motion: Motion


def start(models: Sequence[MotionModel], probabilities: Sequence[float], shared: Mixture) -> list[Member]:
    """Every model at the same shared state, its own states at their prior."""
    return [Member(model, *_extended(model, shared), p) for model, p in zip(models, probabilities, strict=True)]


def _extended(model: MotionModel, shared: Mixture) -> tuple[Vector, Covariance]:
    n = model.size
    mean, variance = model.added()
    x = list(shared.x) + list(mean)
    P = [0.0] * (n * n)
    for i in range(SHARED):
        P[i * n : i * n + SHARED] = shared.P[i * SHARED : (i + 1) * SHARED]
    for k, value in enumerate(variance):
        i = SHARED + k
        P[i * n + i] = value
    return x, room(P)


def copied(members: Sequence[Member]) -> list[Member]:
    return [member.copied() for member in members]


def likely(members: Sequence[Member]) -> list[Member]:
    """The members that something speaks for, their probabilities summing up to one again."""
    kept = [member for member in members if member.probability >= LEAST_TO_LOOK_AHEAD]
    total = sum(member.probability for member in kept)
    for member in kept:
        member.probability /= total
    return kept


def predict(members: Sequence[Member], dt_s: float) -> None:
    for member in members:
        member.model.predict(member.x, member.P, dt_s)


def mix(members: Sequence[Member], dt_s: float, sojourn_s: float) -> None:
    """The interaction step: a model keeps its hypothesis for `sojourn_s` on average, then passes to any other."""
    count = len(members)
    if count == 1 or dt_s <= 0.0:
        return
    stay = math.exp(-dt_s / sojourn_s)
    leave = (1.0 - stay) / (count - 1)
    before = [member.copied() for member in members]
    for j, member in enumerate(members):
        shares = [(stay if i == j else leave) * other.probability for i, other in enumerate(before)]
        total = sum(shares)
        member.probability = total
        _take(member, before, [share / total for share in shares], j)


def _take(member: Member, before: Sequence[Member], shares: Sequence[float], own: int) -> None:
    """Write the mixture into `member`. The tie between shared and own states is kept in proportion to the own share, which
    keeps the covariance positive."""
    if shares[own] > 1.0 - LEAST_SHARE:
        return
    x, P = _moments(before, shares)
    member.x[:SHARED] = x
    replace_shared(member.P, member.model.size, P, SHARED, shares[own])


def _moments(members: Sequence[Member], shares: Sequence[float]) -> tuple[list[float], list[float]]:
    """Mean and covariance of the shared states of a mixture, spread of the means included."""
    parts = [(w, m.x, m.P, m.model.size) for w, m in zip(shares, members, strict=True) if w > LEAST_SHARE]
    if len(parts) == 1:
        _, x, Pm, n = parts[0]
        rows = Pm if isinstance(Pm, list) else Pm.tolist()
        return x[:SHARED], [value for i in range(SHARED) for value in rows[i * n : i * n + SHARED]]
    if not isinstance(parts[0][2], list):
        return _moments_compiled(parts)
    total_w = 0.0
    for w, *_ in parts:
        total_w += w
    scale = 1.0 / total_w
    mean = [0.0] * SHARED
    for w, x, _, _ in parts:
        mean = [total + w * value for total, value in zip(mean, x, strict=False)]
    mean = [total * scale for total in mean]
    triangle = [0.0] * len(LOWER)
    for w, x, Pm, n in parts:
        w *= scale
        d = [a - b for a, b in zip(x, mean, strict=False)]
        lower = zip(triangle, lower_of(n)(Pm), LOWER_ROW(d), LOWER_COLUMN(d), strict=True)
        triangle = [p + w * (value + di * dj) for p, value, di, dj in lower]
    return mean, list(MIRROR(triangle))


def _moments_compiled(parts: Sequence[tuple[float, Vector, Covariance, int]]) -> tuple[list[float], list[float]]:
    """`_moments` of more than one part, addition by addition."""
    weights = np.array([w for w, *_ in parts])
    means = np.array([value for _, x, _, _ in parts for value in x[:SHARED]])
    P = np.concatenate([Pm for _, _, Pm, _ in parts])
    found: list[float] = moments(weights, means, _sizes(tuple(n for *_, n in parts)), P, SHARED).tolist()
    return found[:SHARED], found[SHARED:]


@functools.cache
def _sizes(sizes: tuple[int, ...]) -> Indices:
    return np.array(sizes, np.int64)


def combined(members: Sequence[Member]) -> Mixture:
    """The bank as one estimate."""
    x, P = _moments(members, [member.probability for member in members])
    return Mixture(x, P, mean_motion(members))


def mean_position_and_velocity(members: Sequence[Member]) -> tuple[float, float, float, float]:
    """North, east and their rates of the bank as one estimate, to the bits of `combined`."""
    parts = [(member.probability, member.x) for member in members if member.probability > LEAST_SHARE]
    if len(parts) == 1:
        x = parts[0][1]
        return x[X], x[Y], x[VX], x[VY]
    scale = 1.0 / sum(w for w, _ in parts)
    north = east = vn = ve = 0.0
    for w, x in parts:
        north, east, vn, ve = north + w * x[X], east + w * x[Y], vn + w * x[VX], ve + w * x[VY]
    return north * scale, east * scale, vn * scale, ve * scale


def mean_motion(members: Sequence[Member]) -> Motion:
    """Each model's motion by its probability."""
    north = east = turn = 0.0
    for member in members:
        motion, w = member.model.motion(member.x), member.probability
        north += w * motion.acceleration_m_s2[0]
        east += w * motion.acceleration_m_s2[1]
        turn += w * motion.turn_rate_rad_s
    return Motion((north, east), turn)


@dataclass(frozen=True, slots=True)
class Row:
    """A scalar measurement of shared states: z = sum of coefficients * x[indices] + noise of variance R."""

    indices: tuple[int, ...]
    coefficients: tuple[float, ...]
    z: float
    R: float

    def residual(self, x: Sequence[float]) -> float:
        z = self.z
        for i, c in zip(self.indices, self.coefficients, strict=True):
            z -= c * x[i]
        return z

    def cross(self, other: Row, P: Sequence[float], n: int) -> float:
        """Covariance of two predicted scalars."""
        total = 0.0
        for i, ci in zip(self.indices, self.coefficients, strict=True):
            for j, cj in zip(other.indices, other.coefficients, strict=True):
                total += ci * cj * P[i * n + j]
        return total

    def variance(self, P: Sequence[float], n: int) -> float:
        return self.R + self.cross(self, P, n)


def decorrelated(first: Row, second: Row, covariance: float) -> tuple[Row, Row]:
    """Two scalars with correlated noise as two with independent noise: the second loses what the first says of it."""
    if covariance == 0.0:
        return first, second
    k = covariance / first.R
    coefficients = second.coefficients + tuple(-k * c for c in first.coefficients)
    indices = second.indices + first.indices
    return first, Row(indices, coefficients, second.z - k * first.z, second.R - k * covariance)


def update(members: Sequence[Member], rows: Sequence[Row]) -> None:
    """Fuse scalars one after the other into every model and re-weigh the models by their likelihood."""
    for_kernel = packed([(row.indices, row.coefficients, row.z, row.R) for row in rows])
    logs = []
    for member in members:
        x, P = member.x, member.P
        told = _fused(x, P, rows) if isinstance(P, list) else _fused_compiled(x, P, *for_kernel)
        total = 0.0
        for y, S in told:
            total += log_likelihood(y, S)
        logs.append(total)
    _reweigh(members, logs)


def _fused(x: Vector, P: Vector, rows: Sequence[Row]) -> list[tuple[float, float]]:
    """Innovation and its variance of each."""
    n = len(x)
    g, told = [0.0] * n, []
    for row in rows:
        y = row.residual(x)
        told.append((y, update_scalar(x, P, n, row.indices, row.coefficients, y, row.R, g)))
    return told


def _fused_compiled(x: Vector, P: Array, places: Indices, numbers: Array) -> list[tuple[float, float]]:
    mean = np.array(x)
    told = fuse(mean, P, places, numbers).tolist()
    x[:] = mean.tolist()
    return list(zip(told[::2], told[1::2], strict=True))


def _reweigh(members: Sequence[Member], logs: Sequence[float]) -> None:
    if len(members) == 1:
        return
    top = max(logs)
    weights = [m.probability * math.exp(max(-50.0, log - top)) for m, log in zip(members, logs, strict=True)]
    total = sum(weights)
    kept = [max(LEAST_PROBABILITY, w / total) for w in weights]
    total = sum(kept)
    for member, w in zip(members, kept, strict=True):
        member.probability = w / total


def update_own(member: Member, index: int, y: float, R: float) -> None:
    """Fuse a scalar that only this model knows (turn rate, yaw): y is the residual. Says nothing about other models."""
    update_state(member.x, member.P, index, y, R)


def position_rows(z: tuple[float, float], R: tuple[float, float]) -> tuple[Row, Row]:
    """Direct sight of the pad's horizontal position."""
    return Row((X,), (1.0,), z[0], R[0]), Row((Y,), (1.0,), z[1], R[1])
