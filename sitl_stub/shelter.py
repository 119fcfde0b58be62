"""Air over a moving deck: behind a cab or a wind screen, and in its boundary layer, it moves partly with the deck.

A crude model with one number, the part of the air's motion against the deck that is taken away on the deck; it fades to
nothing with height and beside the deck. 0 (the default) is a deck that stands freely in the wind. Called by the world.
"""

from __future__ import annotations

import math

from sitl_stub.carriers.deck import DeckState
from sitl_stub.contact import DeckShape
from sitl_stub.rotation import Vec3

_FULL_BELOW_M = 0.4
_NONE_ABOVE_M = 1.5
_ASIDE_M = 0.5


def sheltered(wind_ned_m_s: Vec3, shelter: float, position_ned_m: Vec3, deck: DeckState, shape: DeckShape) -> Vec3:
    """Velocity of the air (W) where the vehicle is."""
    o, v = deck.position_ned_m, deck.velocity_ned_m_s
    height = o[2] - position_ned_m[2]
    radius = 0.5 * math.hypot(shape.length_m, shape.width_m)
    aside = math.hypot(position_ned_m[0] - o[0], position_ned_m[1] - o[1]) - radius
    share = shelter * _fade(height, _FULL_BELOW_M, _NONE_ABOVE_M) * _fade(aside, 0.0, _ASIDE_M)
    x, y, z = wind_ned_m_s
    return (x + share * (v[0] - x), y + share * (v[1] - y), z + share * (v[2] - z))


def _fade(value: float, full: float, none: float) -> float:
    return min(max((none - value) / (none - full), 0.0), 1.0)
