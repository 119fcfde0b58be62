"""Following by a position setpoint, as PX4's precision landing does: the goal's measured place is the place to fly to.

PX4 flies a position setpoint in two steps: a trajectory that approaches it with v = MPC_XY_TRAJ_P (goal - point), and
v = MPC_XY_P (point - vehicle) + the trajectory's own velocity. So the vehicle trails a moving goal by 1 / MPC_XY_TRAJ_P of its
motion (2 s), while an error of its own velocity estimate puts it off by that error / MPC_XY_P only. Vertically the reference's
descent is flown. Source: PX4 v1.17 behaviour as recorded (docs/landing-laws.md). For comparison (configs/peers).
"""

from __future__ import annotations

from companion.config import Control
from companion.control.law import ControlInput, ControlOutput
from companion.control.limits import limited_length
from companion.geometry import ZERO, add, scale, subtract
from companion.messages import Vec3


class PositionTargetLaw:
    """`controller = "position_target"`. State: the trajectory's point over the ground, W, m (its height is not used)."""

    def __init__(self, config: Control) -> None:
        self._config = config
        self._point_m: Vec3 | None = None

    def reset(self) -> None:
        """The next trajectory starts at the vehicle."""
        self._point_m = None

    def update(self, control: ControlInput) -> ControlOutput:
        if not control.feedback:
            return ControlOutput(control.reference_ahead.velocity_m_s, ZERO)
        c, here = self._config, control.position_ned_m
        goal = control.reference.position_m if control.goal_position_m is None else control.goal_position_m
        goal_ned_m = add(subtract(here, control.relative_position_m), goal)
        point = here if self._point_m is None else self._point_m
        away = subtract(goal_ned_m, point)
        along = limited_length(scale((away[0], away[1], 0.0), c.trajectory_gain_hz), c.max_speed_m_s)
        self._point_m = point = add(point, scale(along, control.dt_s))
        down = control.reference.position_m[2] - control.relative_position_m[2]
        velocity = (
            along[0] + c.position_gain_hz * (point[0] - here[0]),
            along[1] + c.position_gain_hz * (point[1] - here[1]),
            control.reference_ahead.velocity_m_s[2] + c.vertical_gain_hz * down,
        )
        return ControlOutput(velocity, ZERO)
