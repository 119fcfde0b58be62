"""What a carrier is, and how its deck moves.

A carrier advances in knots of 20 ms; between knots the deck's pose is a cubic Hermite curve through values and rates, so
that pose and velocity are continuous and agree with each other. W is local NED; the deck frame D (= pad frame P) is x
along travel, y right, z down, its origin on the pad's centre; roll, pitch, yaw are the usual aerospace angles.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

KNOT_S = 0.02

Six = tuple[float, float, float, float, float, float]


class CarrierMotion(NamedTuple):
    """North, east, down (m), roll, pitch, yaw (rad, yaw not wrapped) of the pad's centre, and their rates."""

    pose: Six
    rate: Six


class Carrier(Protocol):
    """A moving thing with a deck."""

    def motion(self) -> CarrierMotion:
        """Where the deck is now."""
        ...

    def advance(self) -> None:
        """Go on by one knot, `KNOT_S`."""
        ...

    def highest_deck_m(self) -> float:
        """The deck's top never comes higher than this above the ground or the mean water."""
        ...
