"""Proportional following without feed-forward, as in common student projects: v = k (goal - p).

The vehicle trails a pad that moves by (pad speed) / k. Horizontally the error is taken to the goal itself, not to a planned
reference; vertically the reference's descent is flown. For comparison (configs/peers), not for landing on what moves.
"""

from __future__ import annotations

from companion.config import Control
from companion.control.law import ControlInput, ControlOutput
from companion.geometry import ZERO
from companion.messages import Vec3


class ProportionalFollowLaw:
    """`controller = "p_follow"`. No state."""

    def __init__(self, config: Control) -> None:
        self._config = config

    def reset(self) -> None:
        """Nothing is remembered."""

    def update(self, control: ControlInput) -> ControlOutput:
        c = self._config
        if not control.feedback:
            return ControlOutput(control.reference_ahead.velocity_m_s, ZERO)
        return ControlOutput(velocity_towards_goal(control, c.position_gain_hz, c.vertical_gain_hz), ZERO)


def velocity_towards_goal(control: ControlInput, horizontal_gain_hz: float, vertical_gain_hz: float) -> Vec3:
    """Proportional to the distance from the goal across, to that from the reference down; W, m/s."""
    goal = control.reference.position_m if control.goal_position_m is None else control.goal_position_m
    here, reference = control.relative_position_m, control.reference
    return (
        horizontal_gain_hz * (goal[0] - here[0]),
        horizontal_gain_hz * (goal[1] - here[1]),
        control.reference_ahead.velocity_m_s[2] + vertical_gain_hz * (reference.position_m[2] - here[2]),
    )
