"""How hard the vehicle presses on the deck after it has touched it.

A vehicle that leans into a curve stands on two feet or one at first. The motors must let it down on the others: PX4 takes
torque from the collective, and with the collective at its least there is none. So the press begins as the last metre ended
and grows only when the vehicle has had the time to come to stand level. Called by goals.py.
"""

from __future__ import annotations

from companion.config import Mission

RIGHTING_S = 0.2
"""So long nothing is added: the vehicle has begun to come level."""

GENTLE = 0.8
"""Of the final descent: PX4 then holds 0.85 of the hover thrust, and the feet stay on the deck."""

GROWTH_S = 0.3
"""Then the press grows to the whole over this time."""


def press(age_s: float, mission: Mission) -> tuple[float, float]:
    """Sink against the pad, m/s, and acceleration down, m/s2, so long after the touchdown was first suspected."""
    share = min(1.0, max(0.0, age_s - RIGHTING_S) / GROWTH_S)
    gentle = min(GENTLE * mission.final_descent_speed_m_s, mission.press_speed_m_s)
    return gentle + share * (mission.press_speed_m_s - gentle), share * mission.press_acceleration_m_s2
