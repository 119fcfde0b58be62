"""The target's estimated velocity plus a proportional correction: v = v_pad + k (goal - p).

What ArduPilot's precision landing does with a moving target, re-stated from its documentation: a constant-velocity estimate of
the target is fed forward, nothing else; no look-ahead, no acceleration, no planned approach. It trails in curves by
(pad acceleration) / (k x the autopilot's gain). For comparison (configs/peers).
"""

from __future__ import annotations

from companion.config import Control
from companion.control.law import ControlInput, ControlOutput
from companion.control.p_follow import velocity_towards_goal
from companion.geometry import ZERO, add


class TargetVelocityLaw:
    """`controller = "target_velocity"`. No state."""

    def __init__(self, config: Control) -> None:
        self._config = config

    def reset(self) -> None:
        """Nothing is remembered."""

    def update(self, control: ControlInput) -> ControlOutput:
        c, pad = self._config, control.pad_velocity_ahead_m_s
        if not control.feedback:
            return ControlOutput(add(pad, control.reference_ahead.velocity_m_s), ZERO)
        return ControlOutput(
            add((pad[0], pad[1], 0.0), velocity_towards_goal(control, c.position_gain_hz, c.vertical_gain_hz)), ZERO
        )
