"""Is a measured component plausible? Gates that reject outliers and yet never starve the filter.

One AxisGate for each component (north, east, down, yaw) of each source, so that a fault on one axis costs that axis only.
A component outside its normalised-innovation gate is rejected. What happens then depends on how it left:

* gradually (the pad did something the model did not foresee): after a few rejections that agree with each other the state
  is trusted less (REACQUIRE) and follows;
* in a jump, faster than a pad can move: the contradiction is believed only after it has lasted as long as the track had
  been confirmed before, at most `JUMP_PATIENCE_S`. So 6 s of outliers on one axis do not move a good track, and a false
  first sight is given up at once. Jumps on both horizontal axes together are believed earlier: that is a new place, not a
  fault of one axis.

Units are those of the component (m or rad). Pure but for the small state; called by track.py.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

NS = 1_000_000_000
JUMP_PATIENCE_S = 8.0
BOTH_AXES_PATIENCE_S = 1.5
AGREEING = 5
"""Rejected measurements in a row that agree with each other before they may count as the truth."""
PLAUSIBLE_ACCELERATION = 4.0
"""m/s^2 (or rad/s^2): a pad may gain half of this times dt^2 between two sights without it being a jump."""
LOCKED_SIGMA = 0.08
LOCKED_GROWTH_PER_S = 0.02
"""While an axis is locked its gate widens slowly: the state coasts on what was known before the jump."""


class Decision(Enum):
    ACCEPT = "accepted"
    REJECT = "rejected"
    REACQUIRE = "reacquired"


@dataclass(slots=True)
class AxisGate:
    """State of one gate. `jump` is the innovation that locked it, None while open; `returned` says that the measured values
    have since jumped back towards the state."""

    confirmed_s: float = 0.0
    last_ns: int | None = None
    last_y: float = 0.0
    rejected_since_ns: int | None = None
    jump: float | None = None
    returned: bool = False
    agreeing: int = 0

    def copied(self) -> AxisGate:
        """Written out: dataclasses.replace takes ten times as long."""
        return AxisGate(
            self.confirmed_s,
            self.last_ns,
            self.last_y,
            self.rejected_since_ns,
            self.jump,
            self.returned,
            self.agreeing,
        )


def judge(
    gate: AxisGate, *, t_ns: int, y: float, S: float, R: float, limit: float, both_axes: bool = False
) -> Decision:
    """Decide on innovation `y` of variance `S` (measurement noise `R`), `limit` being the gate in standard deviations."""
    dt_s = 0.0 if gate.last_ns is None else (t_ns - gate.last_ns) / NS
    jumped = gate.last_ns is not None and _is_jump(y - gate.last_y, dt_s, S, R, limit)
    inside = y * y <= limit * limit * (S if gate.jump is None else _locked_variance(gate, t_ns, S, R))
    agrees = gate.last_ns is not None and abs(y - gate.last_y) <= limit * math.sqrt(2.0 * R) + dt_s
    gate.last_ns, gate.last_y = t_ns, y
    if inside:
        return _accept(gate, dt_s)
    if gate.rejected_since_ns is None:
        gate.rejected_since_ns, gate.agreeing = t_ns, 1
        gate.jump = y if jumped else None
    else:
        gate.agreeing = gate.agreeing + 1 if agrees else 1
        if jumped and gate.jump is not None:
            gate.returned = abs(y) < 0.7 * abs(gate.jump)
    return _reacquire(gate) if _is_convincing(gate, t_ns, both_axes=both_axes) else Decision.REJECT


def _is_jump(change: float, dt_s: float, S: float, R: float, limit: float) -> bool:
    reachable = limit * math.sqrt(S + R) + 0.5 * PLAUSIBLE_ACCELERATION * dt_s * dt_s
    return abs(change) > reachable


def _locked_variance(gate: AxisGate, t_ns: int, S: float, R: float) -> float:
    since_s = 0.0 if gate.rejected_since_ns is None else (t_ns - gate.rejected_since_ns) / NS
    sigma = LOCKED_SIGMA + LOCKED_GROWTH_PER_S * since_s
    return min(S, R + sigma * sigma)


def _is_convincing(gate: AxisGate, t_ns: int, *, both_axes: bool) -> bool:
    """Has the rejected value lasted long enough, in agreement with itself, to be believed?"""
    if gate.agreeing < AGREEING:
        return False
    if gate.jump is None or gate.returned:
        return True
    patience_s = min(BOTH_AXES_PATIENCE_S if both_axes else JUMP_PATIENCE_S, gate.confirmed_s)
    return gate.rejected_since_ns is not None and (t_ns - gate.rejected_since_ns) / NS >= patience_s


def _accept(gate: AxisGate, dt_s: float) -> Decision:
    gate.confirmed_s = min(JUMP_PATIENCE_S, gate.confirmed_s + min(dt_s, 0.5))
    _open(gate)
    return Decision.ACCEPT


def _reacquire(gate: AxisGate) -> Decision:
    gate.confirmed_s = 0.0
    _open(gate)
    return Decision.REACQUIRE


def _open(gate: AxisGate) -> None:
    gate.rejected_since_ns, gate.jump, gate.returned, gate.agreeing = None, None, False, 0
