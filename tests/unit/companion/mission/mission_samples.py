"""Facts of an ordinary flight, for the mission's tests to change."""

from __future__ import annotations

from companion.messages import AutopilotMode, LandedState, PadEstimate, VehicleStatus
from companion.mission.facts import Facts
from companion.mission.touchdown import NO_EVIDENCE, TouchdownEvidence

STATUS = VehicleStatus(
    t_ns=0,
    connected=True,
    armed=True,
    mode=AutopilotMode.HOLD,
    intended_mode=AutopilotMode.HOLD,
    landed_state=LandedState.IN_AIR,
    failsafe=False,
    ready_to_arm=True,
    battery_fraction=0.8,
    home_position_ned_m=None,
    link_age_s=0.1,
)
PAD = PadEstimate(
    t_ns=0,
    position_ned_m=(0.0, 0.0, 0.0),
    velocity_ned_m_s=(1.0, 0.0, 0.0),
    acceleration_ned_m_s2=(0.0, 0.0, 0.0),
    yaw_rad=0.0,
    yaw_rate_rad_s=0.0,
    covariance=tuple(tuple(0.01 if i == j else 0.0 for j in range(6)) for i in range(6)),
    vision_age_s=0.05,
    beacon_age_s=0.2,
    model="test",
)
FACTS = Facts(
    t_ns=0,
    status=STATUS,
    mode_age_s=0.1,
    state_age_s=0.02,
    distance_from_start_m=5.0,
    height_above_start_m=1.0,
    tilt_rad=0.0,
    pad=None,
    relative_position_m=None,
    relative_velocity_m_s=None,
    touchdown=NO_EVIDENCE,
    no_plan_reason=None,
    operator=None,
    refused=None,
    frame_age_s=0.03,
    sight_age_s=0.05,
)
STANDING = TouchdownEvidence(suspected=True, airborne=False, proven_for_s=1.0, signs=("range 0.15 m", "thrust low"))
