"""The law of the paper `dalang`: v = kp (p_r - p) - kd v_c, with kp 0.8 1/s and kd 0.27 (configs/peers/dalang.toml).

v_c is the vehicle's own velocity over ground, not relative to the pad: the law brakes the more the faster the pad is and
trails it by (1 + kd) / kp = 1.59 s of its motion. In all three axes; no feed-forward. For comparison.
"""

from __future__ import annotations

from companion.config import Control
from companion.control.law import ControlInput, ControlOutput
from companion.geometry import ZERO, scale, subtract


class AbsoluteDampingLaw:
    """`controller = "dalang"`: kp is `position_gain_hz`, kd is `damping`. No state."""

    def __init__(self, config: Control) -> None:
        self._config = config

    def reset(self) -> None:
        """Nothing is remembered."""

    def update(self, control: ControlInput) -> ControlOutput:
        if not control.feedback:
            return ControlOutput(control.reference_ahead.velocity_m_s, ZERO)
        c = self._config
        pull = scale(subtract(control.reference.position_m, control.relative_position_m), c.position_gain_hz)
        return ControlOutput(subtract(pull, scale(control.velocity_ned_m_s, c.damping)), ZERO)
