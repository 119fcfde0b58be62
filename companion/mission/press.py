"""How hard the vehicle presses on the deck after it has touched it.

A vehicle that leans into a curve stands on two feet or one at first. The motors must let it down on the others: PX4 takes
torque from the collective, and with the collective at its least there is none. So the press begins as the last metre ended
and grows only when the vehicle has had the time to come to stand level. Called by goals.py.
"""

from __future__ import annotations

from companion.config import Mission

RIGHTING_S = 0.15
"""So long the press stays what it is at the touch: the vehicle begins to come level."""

RIGHTING_ACCELERATION = 0.75
"""Of the whole press's acceleration, from the touch on. With the sink of the descent PX4 then keeps somewhat over half of
the hover thrust: enough torque to set the vehicle level, and weight enough on the feet that the deck does not slide away."""

GROWTH_S = 0.3
"""Then the press grows to the whole over this time."""


def press(age_s: float, mission: Mission) -> tuple[float, float]:
    """Sink against the pad, m/s, and acceleration down, m/s2, so long after the touchdown was first suspected."""
    share = min(1.0, max(0.0, age_s - RIGHTING_S) / GROWTH_S)
    gentle = min(mission.final_descent_speed_m_s, mission.press_speed_m_s)
    acceleration = RIGHTING_ACCELERATION + share * (1.0 - RIGHTING_ACCELERATION)
    return gentle + share * (mission.press_speed_m_s - gentle), acceleration * mission.press_acceleration_m_s2
