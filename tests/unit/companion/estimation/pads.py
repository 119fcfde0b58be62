"""Pads to estimate: paths, sights of them with seeded noise, and the truth to compare with."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from companion.estimation.measurement import PadMeasurement
from companion.messages import ObservationSource, PadEstimate

FRAME_S = 1.0 / 30.0


@dataclass(frozen=True)
class Truth:
    x: float
    y: float
    vx: float
    vy: float
    yaw: float


Path = Callable[[float], Truth]


def still(t: float) -> Truth:
    return Truth(3.0, -2.0, 0.0, 0.0, 0.4)


def line(speed_m_s: float) -> Path:
    """North-east by 0.8 : 0.6."""
    vx, vy = 0.8 * speed_m_s, 0.6 * speed_m_s
    return lambda t: Truth(vx * t, vy * t, vx, vy, math.atan2(vy, vx))


def circle(radius_m: float, speed_m_s: float) -> Path:
    w, r, v = speed_m_s / radius_m, radius_m, speed_m_s
    return lambda t: Truth(
        r * math.sin(w * t), r * (1 - math.cos(w * t)), v * math.cos(w * t), v * math.sin(w * t), w * t
    )


def figure_8(half_length_m: float, half_width_m: float, speed_m_s: float) -> Path:
    a, b = half_length_m, half_width_m
    w = speed_m_s / math.hypot(a, 2 * b)

    def at(t: float) -> Truth:
        vx, vy = a * w * math.cos(w * t), 2 * b * w * math.cos(2 * w * t)
        return Truth(a * math.sin(w * t), b * math.sin(2 * w * t), vx, vy, math.atan2(vy, vx))

    return at


def ns(t_s: float) -> int:
    return round(t_s * 1e9)


def diagonal(variance: float) -> tuple[tuple[float, ...], ...]:
    return ((variance, 0.0, 0.0), (0.0, variance, 0.0), (0.0, 0.0, variance))


def sight(
    path: Path, t_s: float, rng: np.random.Generator, *, sigma_m: float = 0.03, with_yaw: bool = False
) -> PadMeasurement:
    """What a camera shows, true at t_s."""
    truth, noise = path(t_s), rng.normal(0.0, sigma_m, 3).tolist()
    return PadMeasurement(
        t_ns=ns(t_s),
        source=ObservationSource.VISION_POSE,
        position_o_m=(truth.x + noise[0], truth.y + noise[1], noise[2]),
        covariance_m2=diagonal(sigma_m**2),
        yaw_rad=truth.yaw + float(rng.normal(0.0, 0.02)) if with_yaw else None,
        yaw_sigma_rad=0.02,
    )


def sights(
    path: Path, seconds: Iterable[float], *, seed: int, sigma_m: float = 0.03, with_yaw: bool = False
) -> list[PadMeasurement]:
    rng = np.random.default_rng(seed)
    return [sight(path, t, rng, sigma_m=sigma_m, with_yaw=with_yaw) for t in seconds]


def frames(start_s: float, end_s: float) -> list[float]:
    """Capture times at 30 Hz."""
    return [start_s + k * FRAME_S for k in range(round((end_s - start_s) / FRAME_S))]


def beacon(path: Path, t_s: float, bias_m: tuple[float, float], rng: np.random.Generator) -> PadMeasurement:
    truth = path(t_s)
    position, velocity = rng.normal(0.0, 0.05, 2).tolist(), rng.normal(0.0, 0.1, 2).tolist()
    return PadMeasurement(
        t_ns=ns(t_s),
        source=ObservationSource.BEACON,
        position_o_m=(truth.x + bias_m[0] + position[0], truth.y + bias_m[1] + position[1], 1.0),
        covariance_m2=diagonal(0.01),
        bias_sigma_m=1.5,
        velocity_m_s=(truth.vx + velocity[0], truth.vy + velocity[1], 0.0),
        velocity_sigma_m_s=0.15,
    )


def error_m(estimate: PadEstimate | None, truth: Truth) -> float:
    """Horizontal distance between estimate and truth."""
    assert estimate is not None
    return math.hypot(estimate.position_ned_m[0] - truth.x, estimate.position_ned_m[1] - truth.y)
