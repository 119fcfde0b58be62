"""Control: a reference relative to the pad, and where vehicle and pad are, to one velocity setpoint.

One law a file. A law is chosen by `control.controller`, the yaw law by `control.yaw`. Everything is in W (NED), SI.
"""

from __future__ import annotations

from collections.abc import Callable

from companion.config import Control
from companion.control.dalang import AbsoluteDampingLaw
from companion.control.l1 import AdaptiveLaw
from companion.control.law import ControlInput, Controller, ControlOutput, Reference, YawInput
from companion.control.marker_centred import MarkerCentredLaw
from companion.control.p_follow import ProportionalFollowLaw
from companion.control.position_target import PositionTargetLaw
from companion.control.target_velocity import TargetVelocityLaw
from companion.control.velocity import VelocityLaw
from companion.control.yaw import hold_yaw, yaw_in_box, yaw_to_command, yaw_to_pad, yaw_to_travel

__all__ = ["CONTROLLERS", "YAW_LAWS", "ControlInput", "ControlOutput", "Controller", "Reference", "YawInput"]

CONTROLLERS: dict[str, Callable[[Control], Controller]] = {
    "velocity": VelocityLaw,
    "l1": AdaptiveLaw,
    "dalang": AbsoluteDampingLaw,
    "guo": MarkerCentredLaw,
    "p_follow": ProportionalFollowLaw,
    "position_target": PositionTargetLaw,
    "target_velocity": TargetVelocityLaw,
}

YAW_LAWS: dict[str, Callable[[YawInput], float]] = {
    "hold": hold_yaw,
    "pad": yaw_to_pad,
    "travel": yaw_to_travel,
    "dalang": yaw_to_command,
    "guo": yaw_in_box,
}
"""Each gives the yaw error in rad that the proportional yaw-rate loop takes to zero."""
