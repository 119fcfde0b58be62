"""Wind where the vehicle is: a mean that grows with height, and Dryden gusts (MIL-F-8785C, low altitude).

Velocity of the air in W, m/s. The mean is given for 6.1 m (20 ft) and follows the specification's logarithmic profile over
grass. The along-wind gust is a first-order process, the across and vertical ones of second order; their length grows with
height, their time is length over mean speed (turbulence is carried past the vehicle by the wind; the vehicle's own speed is left
out). Gusts are drawn at 50 Hz and held. World calls `step` each 4 ms; the generator given makes it repeatable.
"""

from __future__ import annotations

from math import cos, log, sin, sqrt
from typing import Protocol

import numpy as np

from sitl_stub.compiled import compiled, used_by_kernels
from sitl_stub.rotation import Vec3

_REFERENCE_HEIGHT_M = 6.096
_ROUGHNESS_M = 0.0457
_LEAST_HEIGHT_M = 0.5
_GUST_PERIOD_S = 0.02
_GUST_DUE_S = _GUST_PERIOD_S - 1e-9
_LEAST_SPEED_M_S = 2.0
_FOOT_M = 0.3048
_BLOCK = 1024
_REFERENCE_LOG = log(_REFERENCE_HEIGHT_M / _ROUGHNESS_M)
_ROOT_2, _ROOT_3 = sqrt(2.0), sqrt(3.0)

Gust = tuple[float, float, float, float, float]
"""States of unit variance: along; across, two; vertical, two."""
Air = tuple[float, float, float, float, float]
"""Mean speed at 6.1 m, the direction it goes (north, east), standard deviations of horizontal and vertical gusts."""


class Wind(Protocol):
    """Velocity of the air in W at a height above the ground."""

    def step(self, dt_s: float, height_m: float) -> Vec3: ...

    def steady_steps(self, dt_s: float) -> int:
        """How many more steps give what the last one gave, at any height."""

    def skip(self, steps: int, dt_s: float) -> None:
        """Go on by so many of them."""


class StillAir:
    """No wind."""

    def step(self, dt_s: float, height_m: float) -> Vec3:
        return (0.0, 0.0, 0.0)

    def steady_steps(self, dt_s: float) -> int:
        return 1 << 30

    def skip(self, steps: int, dt_s: float) -> None:
        """Nothing to go on with."""


@used_by_kernels
def profile(height_m: float) -> float:
    """Mean wind at a height as a part of that at 6.1 m; constant below half a metre."""
    height_m = _LEAST_HEIGHT_M if height_m < _LEAST_HEIGHT_M else height_m
    return log(height_m / _ROUGHNESS_M) / _REFERENCE_LOG


class SteadyWind:
    """Mean wind only."""

    def __init__(self, mean_m_s: float, from_rad: float) -> None:
        self._north, self._east = -mean_m_s * cos(from_rad), -mean_m_s * sin(from_rad)

    def step(self, dt_s: float, height_m: float) -> Vec3:
        factor = profile(height_m)
        return (self._north * factor, self._east * factor, 0.0)

    def steady_steps(self, dt_s: float) -> int:
        return 0

    def skip(self, steps: int, dt_s: float) -> None:
        """Nothing to go on with."""


class DrydenWind:
    """Mean wind and gusts. The sigmas are standard deviations of a horizontal and the vertical component."""

    def __init__(
        self,
        mean_m_s: float,
        from_rad: float,
        gust_sigma_m_s: float,
        vertical_gust_sigma_m_s: float,
        rng: np.random.Generator,
    ) -> None:
        north, east = -cos(from_rad), -sin(from_rad)
        self._air: Air = (float(mean_m_s), north, east, float(gust_sigma_m_s), float(vertical_gust_sigma_m_s))
        self._rng = rng
        self._noise: list[float] = []
        # Unit variance each: along; across (two states); vertical (two states), started in their stationary spread.
        u, v, w = self._draw(), self._draw(), self._draw()
        self._gust: Gust = (u, v, 0.5 * v, w, 0.5 * w)
        blown(
            self._gust, self._air, (0.0, 0.0, 0.0), _GUST_PERIOD_S, 1.0
        )  # compiled before the first flight, not in it
        self._since_s = _GUST_PERIOD_S
        self._now: Vec3 = (0.0, 0.0, 0.0)

    def _draw(self) -> float:
        if not self._noise:
            self._noise = self._rng.standard_normal(_BLOCK).tolist()
        return self._noise.pop()

    def step(self, dt_s: float, height_m: float) -> Vec3:
        self._since_s += dt_s
        if self._since_s >= _GUST_DUE_S:
            self._blow(self._since_s, height_m)
            self._since_s = 0.0
        return self._now

    def steady_steps(self, dt_s: float) -> int:
        steps, since_s = 0, self._since_s + dt_s
        while since_s < _GUST_DUE_S:
            steps, since_s = steps + 1, since_s + dt_s
        return steps

    def skip(self, steps: int, dt_s: float) -> None:
        for _ in range(steps):
            self._since_s += dt_s

    def _blow(self, dt_s: float, height_m: float) -> None:
        drawn = (self._draw(), self._draw(), self._draw())
        self._gust, self._now = blown(self._gust, self._air, drawn, dt_s, height_m)


@compiled
def blown(gust: Gust, air: Air, drawn: Vec3, dt_s: float, height_m: float) -> tuple[Gust, Vec3]:
    """The filters a gust period later, and the velocity of the air."""
    u, v1, v2, w1, w2 = gust
    mean_m_s, north, east, sigma_m_s, vertical_sigma_m_s = air
    mean_m_s = mean_m_s * profile(height_m)
    speed_m_s = _LEAST_SPEED_M_S if mean_m_s < _LEAST_SPEED_M_S else mean_m_s
    flat_m, vertical_m = gust_lengths_m(height_m)
    share = min(dt_s * speed_m_s / flat_m, 1.0)
    u += -share * u + sqrt(share * (2.0 - share)) * drawn[0]
    v1, v2 = _second_order(v1, v2, share, drawn[1])
    w1, w2 = _second_order(w1, w2, min(dt_s * speed_m_s / vertical_m, 1.0), drawn[2])
    along = mean_m_s + sigma_m_s * u
    across = sigma_m_s * _shaped(v1, v2)
    return (u, v1, v2, w1, w2), (
        north * along - east * across,
        east * along + north * across,
        vertical_sigma_m_s * _shaped(w1, w2),
    )


@used_by_kernels
def _second_order(first: float, second: float, share: float, drawn: float) -> tuple[float, float]:
    second += share * (first - second)
    first += -share * first + sqrt(share * (2.0 - share)) * drawn
    return first, second


@used_by_kernels
def _shaped(first: float, second: float) -> float:
    """Dryden's across-wind filter (1 + sqrt3 T s) / (1 + T s)^2 in partial fractions, at unit variance."""
    return (_ROOT_3 * first + (1.0 - _ROOT_3) * second) / _ROOT_2


@used_by_kernels
def gust_lengths_m(height_m: float) -> tuple[float, float]:
    """Length scales of horizontal and vertical gusts between 3 and 300 m (MIL-F-8785C)."""
    feet = min(max(height_m / _FOOT_M, 10.0), 1000.0)
    return feet / (0.177 + 0.000823 * feet) ** 1.2 * _FOOT_M, feet * _FOOT_M
