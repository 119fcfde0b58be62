"""From messages to the mission's Facts: what is known of vehicle, autopilot, pad and deck at one instant.

Part of the pipeline, which owns one and asks it once a tick. No decision is made here but one: what counts as evidence of
a touchdown is gathered every tick, whatever the phase. W is local NED, SI.
"""

from __future__ import annotations

import math
from typing import Protocol

from companion.config import Config
from companion.estimation import DeckMotion, PadMotion, VehiclePose
from companion.geometry import ZERO, dot, horizontal_norm, quaternion_from_euler, rotate, subtract
from companion.messages import (
    CommandKind,
    CommandResult,
    OperatorAction,
    PadEstimate,
    RangeMeasurement,
    ThrustReport,
    Vec2,
    Vec3,
    VehicleStatus,
)
from companion.mission.contact import FORESEEN_S, Contact, contact, is_bent, time_to_contact_s
from companion.mission.facts import Facts
from companion.mission.preflight import MAX_STATE_AGE_S
from companion.mission.touchdown import NO_EVIDENCE, TouchdownDetector, TouchdownEvidence, TouchdownSigns
from companion.mission.zones import Zones, inside, place_zones

DOWN: Vec3 = (0.0, 0.0, 1.0)

MAX_RANGE_AGE_S = 0.3
MAX_THRUST_AGE_S = 0.5
BRAKING_M_S2 = 4.0
"""What the vehicle surely brakes with: a no-fly zone counts from where the vehicle could stop."""

FREE_HEIGHT_M = 1.5
"""From here up the deck's ground effect does not change the hover thrust."""

MAX_SIGHT_DELAY_S = 1.0
"""What comes in later than this after its capture says where the pad was, not that it is in sight."""

SAME_SIGHT_NS = 1_000_000
"""Rounding of an age to seconds and back is no new sight."""

MAX_CONTACT_S = 3.0
"""A deck is not predicted further ahead."""


class Prediction(Protocol):
    """The pad at a time ahead."""

    def motion(self, t_ns: int) -> PadMotion | None: ...

    def deck(self, t_ns: int) -> DeckMotion | None: ...


CONTACT_FORESEEN_BELOW_M = 2.0
"""Higher up the moment of contact is too far away to matter."""


class Situation:
    """State: the latest of each message, where the flight began, and the touchdown evidence."""

    def __init__(self, config: Config, prediction: Prediction) -> None:
        self._config = config
        self._prediction = prediction
        self._touchdown = TouchdownDetector(config.mission)
        self._evidence: TouchdownEvidence = NO_EVIDENCE
        self._range: RangeMeasurement | None = None
        self._thrust: ThrustReport | None = None
        self._frame_ns: int | None = None
        self._sight: tuple[int, int] | None = None
        self._last_tick_ns: int | None = None
        self._is_bent = False
        self._placed: tuple[tuple[Vec2 | None, Vec3 | None], Zones] | None = None
        self.status: VehicleStatus | None = None
        self.operator: OperatorAction | None = None
        self.refused: str | None = None
        self.no_plan: str | None = None
        self.plan_to_go_s: float | None = None
        self.flight_start_ned_m: Vec3 | None = None
        self.commanded_down_m_s: float | None = None

    def add_range(self, message: RangeMeasurement) -> None:
        self._range = message

    def add_thrust(self, message: ThrustReport) -> None:
        self._thrust = message

    def add_frame(self, t_ns: int) -> None:
        """A camera frame has been looked at."""
        self._frame_ns = t_ns

    def add_command_result(self, result: CommandResult) -> None:
        self.refused = None if result.accepted else f"{result.kind}: {result.result}"
        if not result.accepted and result.kind is CommandKind.FORCE_DISARM:
            self.refused = None  # nothing left to escalate to: asked again after the request period

    def facts(
        self, t_ns: int, pose: VehiclePose | None, state_ns: int | None, pad: PadEstimate | None, *, dt_s: float
    ) -> Facts:
        """All of it at `t_ns`. `state_ns` is when the newest vehicle state was true."""
        position = velocity = None
        if pose is not None and pad is not None:
            position = subtract(pose.position_ned_m, pad.position_ned_m)
            velocity = subtract(pose.velocity_ned_m_s, pad.velocity_ned_m_s)
        state_age_s = None if state_ns is None else (t_ns - state_ns) / 1e9
        self._weigh_touchdown(t_ns, pose, position, velocity, pad, state_age_s, dt_s)
        zones = self.zones()
        status, start = self.status, self.flight_start_ned_m
        home = start if status is None or status.home_position_ned_m is None else status.home_position_ned_m
        away = (0.0, 0.0, 0.0) if start is None or pose is None else subtract(pose.position_ned_m, start)
        in_s = None if position is None or velocity is None else self._foreseen_contact_s(position, velocity)
        self._foresee_bend(t_ns, position, velocity)
        return Facts(
            t_ns=t_ns,
            status=status,
            mode_age_s=None if status is None else (t_ns - status.t_ns) / 1e9,
            state_age_s=state_age_s,
            distance_from_start_m=horizontal_norm(away),
            height_above_start_m=-away[2],
            tilt_rad=0.0 if pose is None else tilt_rad(pose),
            pad=pad,
            relative_position_m=position,
            relative_velocity_m_s=velocity,
            touchdown=self._evidence,
            no_plan_reason=self.no_plan,
            plan_to_go_s=self.plan_to_go_s,
            operator=self.operator,
            refused=self.refused,
            frame_age_s=None if self._frame_ns is None else (t_ns - self._frame_ns) / 1e9,
            tick_gap_s=dt_s,
            distance_from_home_m=None if home is None or pose is None else _away(pose.position_ned_m, home),
            no_fly_zone=None if pose is None else _no_fly(zones, pose),
            no_land_zone=None if pad is None else self._no_land(t_ns, zones, pad, in_s),
            unplaced_zones=zones.unplaced,
            half_deck_m=0.5 * min(self._config.pad.length_m, self._config.pad.width_m),
            contact=self._contact(t_ns, position, velocity, pad, in_s),
            pad_is_bent=self._is_bent,
            sight_age_s=self._sight_age_s(t_ns, pad),
        )

    def _sight_age_s(self, t_ns: int, pad: PadEstimate | None) -> float | None:
        """Since the newest sight came in; what was already older than MAX_SIGHT_DELAY_S then is that much older."""
        if pad is None or pad.vision_age_s is None:
            return None
        captured_ns = t_ns - round(pad.vision_age_s * 1e9)
        if self._sight is None or captured_ns > self._sight[0] + SAME_SIGHT_NS:
            self._sight = (captured_ns, t_ns)
        return max((t_ns - self._sight[1]) / 1e9, pad.vision_age_s - MAX_SIGHT_DELAY_S)

    def zones(self) -> Zones:
        """Placed anew only when the home has moved."""
        status = self.status
        home = (None, None) if status is None else (status.home_position_deg, status.home_position_ned_m)
        if self._placed is None or self._placed[0] != home:
            self._placed = (home, place_zones(self._config.safety.zones, status))
        return self._placed[1]

    def is_allowed(self, point_m: Vec2) -> bool:
        """Inside the fence and outside the no-fly zones."""
        start = self.flight_start_ned_m
        fenced = start is None or math.dist(point_m, start[:2]) < self._config.safety.geofence_radius_m
        return fenced and inside(self.zones().no_fly, point_m) is None

    def _foreseen_contact_s(self, position: Vec3, velocity: Vec3) -> float | None:
        """Until the feet meet the deck; None higher up."""
        return None if -position[2] > CONTACT_FORESEEN_BELOW_M else self._contact_s(position, velocity)

    def _contact_s(self, position: Vec3, velocity: Vec3) -> float:
        return min(time_to_contact_s(-position[2], velocity[2], self._config.mission), MAX_CONTACT_S)

    def _no_land(self, t_ns: int, zones: Zones, pad: PadEstimate, in_s: float | None) -> str | None:
        """Of the zone in which the pad will be at contact."""
        if not zones.no_land:
            return None
        then = None if in_s is None else self._prediction.motion(t_ns + round(in_s * 1e9))
        return inside(zones.no_land, (pad if then is None else then).position_ned_m[:2])

    def _contact(
        self, t_ns: int, position: Vec3 | None, velocity: Vec3 | None, pad: PadEstimate | None, in_s: float | None
    ) -> Contact | None:
        if position is None or velocity is None or pad is None:
            return None
        then = None if in_s is None else self._prediction.deck(t_ns + round(in_s * 1e9))
        deck = then or DeckMotion(pad.velocity_ned_m_s[2], pad.roll_rad, pad.pitch_rad)
        return contact(self._contact_s(position, velocity), position, velocity, deck)

    def _foresee_bend(self, t_ns: int, position: Vec3 | None, velocity: Vec3 | None) -> None:
        if position is None or velocity is None:
            self._is_bent = False
            return
        ahead_s = min(self._contact_s(position, velocity), FORESEEN_S)
        motion = self._prediction.motion(t_ns + round(ahead_s * 1e9))
        acceleration = ZERO if motion is None else motion.acceleration_ned_m_s2
        self._is_bent = is_bent(acceleration, self._config.mission, before=self._is_bent)

    def _weigh_touchdown(
        self,
        t_ns: int,
        pose: VehiclePose | None,
        position: Vec3 | None,
        velocity: Vec3 | None,
        pad: PadEstimate | None,
        state_age_s: float | None,
        dt_s: float,
    ) -> None:
        """Stale news is no evidence: without a fresh vehicle state or thrust nothing is proven."""
        thrust = self._fresh_thrust(t_ns)
        height = None if position is None else -position[2]
        flying_free = height is not None and height > FREE_HEIGHT_M and velocity is not None and abs(velocity[2]) < 1.5
        if thrust is not None and flying_free:
            self._touchdown.learn_hover_thrust(thrust, dt_s=dt_s)
        known = state_age_s is not None and state_age_s <= MAX_STATE_AGE_S
        pad_down = 0.0 if pad is None else pad.velocity_ned_m_s[2]
        signs = TouchdownSigns(
            height_m=height if known else None,
            range_m=self._fresh_range(t_ns, pose),
            sink_rate_m_s=velocity[2] if known and velocity is not None else None,
            relative_speed_m_s=horizontal_norm(velocity) if known and velocity is not None else None,
            commanded_sink_m_s=0.0 if self.commanded_down_m_s is None else self.commanded_down_m_s - pad_down,
            thrust_normalized=thrust,
            pad_speed_m_s=0.0 if pad is None else horizontal_norm(pad.velocity_ned_m_s),
            pad_velocity_sigma_m_s=0.0 if pad is None else pad.velocity_sigma_m_s,
            lean_rad=None if pose is None else _lean_rad(pose, pad),
        )
        self._evidence = self._touchdown.update(signs, dt_s=dt_s)

    def _fresh_thrust(self, t_ns: int) -> float | None:
        if self._thrust is None or (t_ns - self._thrust.t_ns) / 1e9 > MAX_THRUST_AGE_S:
            return None
        return self._thrust.thrust_normalized

    def _fresh_range(self, t_ns: int, pose: VehiclePose | None) -> float | None:
        """Vertical distance to what is below, m."""
        measured = self._range
        if measured is None or measured.distance_m is None or pose is None:
            return None
        if (t_ns - measured.t_ns) / 1e9 > MAX_RANGE_AGE_S:
            return None
        return measured.distance_m * math.cos(tilt_rad(pose))


def tilt_rad(pose: VehiclePose) -> float:
    """Angle between body down and true down."""
    return _off_rad(pose, DOWN)


def _lean_rad(pose: VehiclePose, pad: PadEstimate | None) -> float:
    """Angle between body down and the deck's; the deck is level where nothing is known of it."""
    if pad is None:
        return tilt_rad(pose)
    return _off_rad(pose, rotate(quaternion_from_euler(pad.roll_rad, pad.pitch_rad, pad.yaw_rad), DOWN))


def _off_rad(pose: VehiclePose, direction_ned: Vec3) -> float:
    """Angle between body down and a unit vector."""
    return math.acos(max(-1.0, min(1.0, dot(rotate(pose.q_ned_frd, DOWN), direction_ned))))


def _away(position_m: Vec3, home_m: Vec3) -> float:
    return math.dist(position_m[:2], home_m[:2])


def _no_fly(zones: Zones, pose: VehiclePose) -> str | None:
    """Of the zone that holds the vehicle, or the place where it can stop."""
    north, east, _ = pose.position_ned_m
    vn, ve, _ = pose.velocity_ned_m_s
    stretch_s = math.hypot(vn, ve) / (2.0 * BRAKING_M_S2)
    return inside(zones.no_fly, (north, east)) or inside(zones.no_fly, (north + vn * stretch_s, east + ve * stretch_s))
