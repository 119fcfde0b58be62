"""The deck at any instant: interpolates a carrier's knots into pose, velocity and angular velocity.

All in W (local NED) unless said; called by the world for contact, cameras, range sensor and beacon.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sitl_stub.carriers.motion import KNOT_S, Carrier, CarrierMotion, Six

_new = tuple.__new__
Vec3 = tuple[float, float, float]
Nine = tuple[float, float, float, float, float, float, float, float, float]


class DeckState(NamedTuple):
    """The deck's top at one instant; its origin is the pad's centre, x along travel, y right, z down."""

    position_ned_m: Vec3
    velocity_ned_m_s: Vec3
    rotation_ned_deck: Nine
    """Rows of the matrix that takes vectors of the deck to W."""
    angular_velocity_ned_rad_s: Vec3
    rpy_rad: Vec3
    """Roll, pitch, yaw; yaw not wrapped."""


class Deck:
    """Draws the carrier's knots as they are needed and keeps the last two. Time never goes back by more than a knot."""

    __slots__ = ("_after", "_before", "_carrier", "_knot", "_last", "_last_t_s")

    def __init__(self, carrier: Carrier) -> None:
        self._carrier = carrier
        self._before = carrier.motion()
        carrier.advance()
        self._after = carrier.motion()
        self._knot = 0
        self._last_t_s = -1.0
        self._last = self.at(0.0)

    def at(self, t_s: float) -> DeckState:
        """The deck at `t_s`, seconds since the scenario began."""
        if t_s == self._last_t_s:
            return self._last
        while t_s >= (self._knot + 1) * KNOT_S:
            self._knot += 1
            self._carrier.advance()
            self._before, self._after = self._after, self._carrier.motion()
        u = (t_s - self._knot * KNOT_S) / KNOT_S
        self._last, self._last_t_s = deck_state(*interpolate(self._before, self._after, u)), t_s
        return self._last


def interpolate(before: CarrierMotion, after: CarrierMotion, u: float) -> tuple[Six, Six]:
    """Cubic Hermite at fraction `u` of the knot interval: pose and its exact derivative."""
    u2 = u * u
    p1 = u2 * (3.0 - 2.0 * u)
    p0 = 1.0 - p1
    m0 = KNOT_S * u * (1.0 - u) * (1.0 - u)
    m1 = KNOT_S * u2 * (u - 1.0)
    d1 = 6.0 * u * (1.0 - u) / KNOT_S
    r0 = 1.0 - u * (4.0 - 3.0 * u)
    r1 = u * (3.0 * u - 2.0)
    (n, e, d, a, b, c), (dn, de, dd, da, db, dc) = before
    (n2, e2, d2, a2, b2, c2), (dn2, de2, dd2, da2, db2, dc2) = after
    return (
        p0 * n + m0 * dn + p1 * n2 + m1 * dn2,
        p0 * e + m0 * de + p1 * e2 + m1 * de2,
        p0 * d + m0 * dd + p1 * d2 + m1 * dd2,
        p0 * a + m0 * da + p1 * a2 + m1 * da2,
        p0 * b + m0 * db + p1 * b2 + m1 * db2,
        p0 * c + m0 * dc + p1 * c2 + m1 * dc2,
    ), (
        d1 * (n2 - n) + r0 * dn + r1 * dn2,
        d1 * (e2 - e) + r0 * de + r1 * de2,
        d1 * (d2 - d) + r0 * dd + r1 * dd2,
        d1 * (a2 - a) + r0 * da + r1 * da2,
        d1 * (b2 - b) + r0 * db + r1 * db2,
        d1 * (c2 - c) + r0 * dc + r1 * dc2,
    )


def deck_state(pose: Six, rate: Six) -> DeckState:
    """Angles and their rates to a rotation matrix and an angular velocity (in W)."""
    n, e, d, roll, pitch, yaw = pose
    vn, ve, vd, roll_rate, pitch_rate, yaw_rate = rate
    cy, sy = math.cos(yaw), math.sin(yaw)
    if roll == 0.0 and pitch == 0.0 and roll_rate == 0.0 and pitch_rate == 0.0:
        flat = (cy, -sy, 0.0, sy, cy, 0.0, 0.0, 0.0, 1.0)
        return _new(DeckState, ((n, e, d), (vn, ve, vd), flat, (0.0, 0.0, yaw_rate), (0.0, 0.0, yaw)))
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    rotation = (
        cy * cp,
        cy * sp * sr - sy * cr,
        cy * sp * cr + sy * sr,
        sy * cp,
        sy * sp * sr + cy * cr,
        sy * sp * cr - cy * sr,
        -sp,
        cp * sr,
        cp * cr,
    )
    # w = yaw' z_W + pitch' (Rz y) + roll' (Rz Ry x)
    angular = (
        -sy * pitch_rate + cy * cp * roll_rate,
        cy * pitch_rate + sy * cp * roll_rate,
        yaw_rate - sp * roll_rate,
    )
    return DeckState((n, e, d), (vn, ve, vd), rotation, angular, (roll, pitch, yaw))
