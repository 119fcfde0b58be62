"""LANDING_TARGET, for those who keep the autopilot's own precision landing and want the pad's position only.

PX4 takes nothing but frame LOCAL_NED with position_valid 1: the pad in the autopilot's local frame. ArduPilot takes the
direction to the pad in the body: the position in BODY_FRD, or (all its versions) angles about the camera's axes (forward and
right) and the distance. Both want the time at which it was true on the autopilot's clock.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from companion.geometry import norm, quaternion_conjugate, rotate, subtract
from companion.mavlink.dialect import LandingTarget
from companion.messages import PadReport, Vec3, VehicleState

FRAME_LOCAL_NED, FRAME_BODY_FRD = 1, 12
TYPE_VISION_FIDUCIAL = 2
NO_ROTATION = (1.0, 0.0, 0.0, 0.0)

Form = Callable[[PadReport, VehicleState, int], LandingTarget]


def px4_form(pad: PadReport, vehicle: VehicleState, t_boot_us: int) -> LandingTarget:
    """The pad in the autopilot's local NED."""
    north, east, down = pad.position_ned_m
    distance = norm(subtract(pad.position_ned_m, vehicle.position_ned_m))
    return _target(t_boot_us, FRAME_LOCAL_NED, (north, east, down), (0.0, 0.0), distance)


def ardupilot_form(pad: PadReport, vehicle: VehicleState, t_boot_us: int) -> LandingTarget:
    """The pad seen from the vehicle: x forward, y right, z down in the body, and the two angles off its down axis.

    angle_x is positive to the right, angle_y positive backwards, as in an image whose top looks forward.
    """
    p_BP_W = subtract(pad.position_ned_m, vehicle.position_ned_m)
    forward, right, down = p_BP = rotate(quaternion_conjugate(vehicle.q_ned_frd), p_BP_W)
    angles = (math.atan2(right, down), math.atan2(-forward, down))
    return _target(t_boot_us, FRAME_BODY_FRD, p_BP, angles, norm(p_BP))


def ardupilot_angles_form(pad: PadReport, vehicle: VehicleState, t_boot_us: int) -> LandingTarget:
    """The two angles and the distance only, as the first version of the message had them."""
    full = ardupilot_form(pad, vehicle, t_boot_us)
    return full._replace(x=0.0, y=0.0, z=0.0, position_valid=0)


LANDING_TARGET_FORMS: dict[str, Form] = {
    "px4": px4_form,
    "ardupilot": ardupilot_form,
    "ardupilot_angles": ardupilot_angles_form,
}


def _target(
    t_boot_us: int, frame: int, position: Vec3, angles: tuple[float, float], distance_m: float
) -> LandingTarget:
    return LandingTarget(
        time_usec=t_boot_us,
        angle_x=angles[0],
        angle_y=angles[1],
        distance=distance_m,
        size_x=0.0,
        size_y=0.0,
        target_num=0,
        frame=frame,
        x=position[0],
        y=position[1],
        z=position[2],
        q=NO_ROTATION,
        type=TYPE_VISION_FIDUCIAL,
        position_valid=1,
    )
