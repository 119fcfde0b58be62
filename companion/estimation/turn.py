"""One step along an arc, for the models that turn. The turn rate w is positive clockwise from above (NED), SI units."""

from __future__ import annotations

import math

from companion.estimation.kalman import Vector
from companion.estimation.motion import VX, VY, X, Y

MIN_SPEED_M_S = 0.3
"""Below it the direction of travel is noise: the acceleration along travel acts in proportion."""

ARC_ENTRIES = ((X, VX), (X, VY), (Y, VX), (Y, VY), (VX, VX), (VX, VY), (VY, VX), (VY, VY))
"""Where F - I is not zero for the shared states, in the order in which `arc_entries` gives the values; then, for turn rate and
acceleration along travel, X, Y, VX, VY each."""

Arc = tuple[float, float, float, float, float, float, float, float, float, float, float]


def arc(x: Vector, w: float, along: float, dt: float) -> Arc:
    """Move position and velocity of `x` along an arc of mean turn rate w and acceleration along travel; returns what
    `arc_entries` needs. The chord of an arc has the direction half way through the turn and the length of the arc times sinc of
    half the angle."""
    vx, vy = x[VX], x[VY]
    angle = w * dt
    c, s = math.cos(angle), math.sin(angle)
    ch, sh = math.cos(0.5 * angle), math.sin(0.5 * angle)
    speed = max(math.sqrt(vx * vx + vy * vy), MIN_SPEED_M_S)
    ux, uy = vx / speed, vy / speed
    gain = along * dt
    mx, my = vx + 0.5 * gain * ux, vy + 0.5 * gain * uy
    bx, by = ch * mx - sh * my, sh * mx + ch * my
    ex, ey = vx + gain * ux, vy + gain * uy
    nx, ny = c * ex - s * ey, s * ex + c * ey
    chord = dt * (1.0 - angle * angle / 24.0)
    x[X] += chord * bx
    x[Y] += chord * by
    x[VX], x[VY] = nx, ny
    return c, s, ch, sh, ux, uy, chord, bx, by, nx, ny


def arc_entries(moved: Arc, dt: float) -> tuple[float, ...]:
    """The entries of F - I of a step along an arc."""
    c, s, ch, sh, ux, uy, chord, bx, by, nx, ny = moved
    half = 0.5 * dt * dt
    return (
        chord * ch, -chord * sh, chord * sh, chord * ch, c - 1.0, -s, s, c - 1.0,
        -half * by, half * bx, -dt * ny, dt * nx,
        half * (ch * ux - sh * uy), half * (sh * ux + ch * uy), dt * (c * ux - s * uy), dt * (s * ux + c * uy),
    )  # fmt: skip


def arc_acceleration(x: Vector, w: float, along: float) -> tuple[float, float]:
    """Centripetal and along travel, NED, m/s^2."""
    factor = along / max(math.hypot(x[VX], x[VY]), MIN_SPEED_M_S)
    return (-w * x[VY] + factor * x[VX], w * x[VX] + factor * x[VY])
