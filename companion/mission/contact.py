"""What the deck will do when the feet meet it: the touchdown window on a deck that heaves and tilts.

A level, steady deck always fits. On a boat the vehicle waits low above the deck until the predicted heave and tilt at the
time of contact fit. W, SI; `deck_climb_m_s` is positive up. Called by pipeline.py each tick.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from companion.config import Mission
from companion.geometry import horizontal_norm
from companion.messages import Vec3

CLOSING_S = 0.3
"""The horizontal error is carried on for so long only: after that the control law has answered it."""


FORESEEN_S = 1.0
"""How hard the pad will turn or brake is foreseen so far ahead at most."""


class Deck(Protocol):
    """What the deck does at an instant, W."""

    @property
    def down_m_s(self) -> float: ...

    @property
    def roll_rad(self) -> float: ...

    @property
    def pitch_rad(self) -> float: ...


@dataclass(frozen=True, slots=True)
class Contact:
    """`in_s` from now; `miss_m` horizontal, predicted."""

    in_s: float
    miss_m: float
    deck_tilt_rad: float
    deck_climb_m_s: float


def time_to_contact_s(height_m: float, sink_m_s: float, mission: Mission) -> float:
    """Feet first, at the final descent speed; a vehicle that sinks faster against the deck slows down evenly to it."""
    final_m_s = mission.final_descent_speed_m_s
    return max(0.0, height_m - mission.vehicle_leg_height_m) / max(final_m_s, 0.5 * (final_m_s + sink_m_s))


def contact(in_s: float, position_m: Vec3, velocity_m_s: Vec3, deck_then: Deck) -> Contact:
    """`position_m`, `velocity_m_s`: vehicle minus pad now; `deck_then`: the deck predicted for the contact."""
    ahead_s = min(in_s, CLOSING_S)
    return Contact(
        in_s=in_s,
        miss_m=horizontal_norm(
            (position_m[0] + ahead_s * velocity_m_s[0], position_m[1] + ahead_s * velocity_m_s[1], 0.0)
        ),
        deck_tilt_rad=math.acos(math.cos(deck_then.roll_rad) * math.cos(deck_then.pitch_rad)),
        deck_climb_m_s=-deck_then.down_m_s,
    )


def window_is_closed(then: Contact | None, mission: Mission) -> str | None:
    """Why the deck is not to be touched then; None where it may be (or nothing is predicted)."""
    if then is None:
        return None
    if abs(then.deck_climb_m_s) > mission.commit_heave_m_s:
        return f"the deck will heave at {then.deck_climb_m_s:+.1f} m/s, {mission.commit_heave_m_s:.1f} m/s allowed"
    tilt_deg = math.degrees(then.deck_tilt_rad)
    if tilt_deg > mission.commit_deck_tilt_deg:
        return f"the deck will tilt {tilt_deg:.0f} deg, {mission.commit_deck_tilt_deg:.0f} deg allowed"
    return None


def is_bent(acceleration_m_s2: Vec3, mission: Mission, *, before: bool) -> bool:
    """Does the pad turn (or brake) harder than it is to be touched? Once it does, until it does so clearly less. The
    acceleration is the pad's at contact, or FORESEEN_S ahead where that is sooner."""
    limit = mission.straight_acceleration_m_s2 if before else mission.bent_acceleration_m_s2
    return horizontal_norm(acceleration_m_s2) > limit
