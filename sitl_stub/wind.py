"""Wind where the vehicle is: a mean that grows with height, and Dryden gusts (MIL-F-8785C, low altitude).

Velocity of the air in W, m/s. The mean is given for 6.1 m (20 ft) and follows the specification's logarithmic profile over
grass. The along-wind gust is a first-order process, the across and vertical ones of second order; their length grows with
height, their time is length over mean speed (turbulence is carried past the vehicle by the wind; the vehicle's own speed is left
out). Gusts are drawn at 50 Hz and held. World calls `step` each 4 ms; the generator given makes it repeatable.
"""

from __future__ import annotations

from math import cos, inf, log, sin, sqrt
from typing import Any

import numpy as np

from sitl_stub.autopilot.noise import NormalTape
from sitl_stub.compiled import COMPILED, compiled, room, used_by_kernels
from sitl_stub.rotation import Vec3

_REFERENCE_HEIGHT_M = 6.096
_ROUGHNESS_M = 0.0457
_LEAST_HEIGHT_M = 0.5
_GUST_PERIOD_S = 0.02
_GUST_DUE_S = _GUST_PERIOD_S - 1e-9
_LEAST_SPEED_M_S = 2.0
_FOOT_M = 0.3048
_REFERENCE_LOG = log(_REFERENCE_HEIGHT_M / _ROUGHNESS_M)
_ROOT_2, _ROOT_3 = sqrt(2.0), sqrt(3.0)
NUMBERS_A_STEP = 3
"""Random numbers that a step can draw."""
_NO_GUST = (0.0, 0.0, 0.0, 0.0, 0.0)

# Places in the flat state of the air. The kernel's functions write them as numbers: a name is looked up at each use.
NOW, SINCE_S, GUST, AIR, DUE_S = 0, 3, 4, 9, 14
"""Velocity; time since the last gust; five states of unit variance; mean speed at 6.1 m, the direction it goes (north, east), standard
deviations of horizontal and vertical gusts; when a gust is due: infinite never, 0 at each step, without gusts."""

Gust = tuple[float, float, float, float, float]
"""States of unit variance: along; across, two; vertical, two."""
Air = tuple[float, float, float, float, float]
"""Mean speed at 6.1 m, the direction it goes (north, east), standard deviations of horizontal and vertical gusts."""


class Wind:
    """Velocity of the air in W at a height above the ground; `flat` and `tape` are what kernels take."""

    def __init__(self, gust: Gust, air: Air, due_s: float, tape: NormalTape) -> None:
        self.flat: Any = room([0.0, 0.0, 0.0, _GUST_PERIOD_S, *gust, *air, due_s])
        self.tape = tape
        tape.reserve(NUMBERS_A_STEP)
        blow(room([*self.flat]), tape.numbers, tape.at, 0.0, 1.0)  # compiled before the first flight, not in it

    def step(self, dt_s: float, height_m: float) -> Vec3:
        """The air of the coming step."""
        tape = self.tape
        tape.reserve(NUMBERS_A_STEP)
        tape.at = blow(self.flat, tape.numbers, tape.at, dt_s, height_m)
        return self.now

    def hold(self, velocity_ned_m_s: Vec3) -> None:
        """Let the air move like this until the next gust."""
        self.flat[0], self.flat[1], self.flat[2] = velocity_ned_m_s

    @property
    def now(self) -> Vec3:
        """The air of the last step."""
        x, y, z = self.flat[NOW:SINCE_S].tolist() if COMPILED else self.flat[NOW:SINCE_S]
        return (x, y, z)


def still_air() -> Wind:
    """No wind, or what it is told to hold."""
    return Wind(_NO_GUST, (0.0, 0.0, 0.0, 0.0, 0.0), inf, _no_noise())


def steady_wind(mean_m_s: float, from_rad: float) -> Wind:
    """Mean wind only."""
    return Wind(_NO_GUST, (mean_m_s, -mean_m_s * cos(from_rad), -mean_m_s * sin(from_rad), 0.0, 0.0), 0.0, _no_noise())


def dryden_wind(
    mean_m_s: float, from_rad: float, gust_sigma_m_s: float, vertical_gust_sigma_m_s: float, rng: np.random.Generator
) -> Wind:
    """Mean wind and gusts. The sigmas are standard deviations of a horizontal and the vertical component."""
    north, east, tape = -cos(from_rad), -sin(from_rad), NormalTape(rng)
    # Unit variance each: along; across (two states); vertical (two states), started in their stationary spread.
    u, v, w = tape.next(), tape.next(), tape.next()
    air = (float(mean_m_s), north, east, float(gust_sigma_m_s), float(vertical_gust_sigma_m_s))
    return Wind((u, v, 0.5 * v, w, 0.5 * w), air, _GUST_DUE_S, tape)


def _no_noise() -> NormalTape:
    return NormalTape(np.random.default_rng(0))


@used_by_kernels
def profile(height_m: float) -> float:
    """Mean wind at a height as a part of that at 6.1 m; constant below half a metre."""
    height_m = _LEAST_HEIGHT_M if height_m < _LEAST_HEIGHT_M else height_m
    return log(height_m / _ROUGHNESS_M) / _REFERENCE_LOG


@compiled
def blow(w: Any, tape: Any, at: int, dt_s: float, height_m: float) -> int:
    """Go on by a step; gives the place on the tape after the numbers drawn."""
    w[3] += dt_s
    if w[3] < w[14]:
        return at
    if w[14] == 0.0:
        factor = profile(height_m)
        w[0], w[1] = w[10] * factor, w[11] * factor
        return at
    drawn, air = (tape[at], tape[at + 1], tape[at + 2]), (w[9], w[10], w[11], w[12], w[13])
    (w[4], w[5], w[6], w[7], w[8]), (w[0], w[1], w[2]) = _blown(
        (w[4], w[5], w[6], w[7], w[8]), air, drawn, w[3], height_m
    )
    w[3] = 0.0
    return at + 3


@used_by_kernels
def _blown(gust: Gust, air: Air, drawn: Vec3, dt_s: float, height_m: float) -> tuple[Gust, Vec3]:
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
