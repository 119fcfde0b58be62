"""Pipeline.handle(message) -> outputs: the fixed order of the stages, and the only place where they meet.

A deterministic function of timestamped messages: no clock, no input or output. Live, replay and campaign call the same
`handle`. Sensor messages update what is known; a `Tick` decides:

    facts -> mission (phase, requests) -> goal -> plan (relative to the pad) -> control -> setpoint
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from companion.config import Config, Marker
from companion.control import CONTROLLERS, YAW_LAWS, ControlInput, Reference, YawInput
from companion.control.limits import clipped, limited_length, limited_velocity, slewed
from companion.detour import cylinders
from companion.estimation import PadMotion, VehiclePose, make_tracker
from companion.estimation.range_watch import RangeWatch
from companion.geometry import (
    ZERO,
    Transform,
    quaternion_conjugate,
    quaternion_from_euler,
    rotate,
    subtract,
    yaw_of,
)
from companion.guidance import Guidance
from companion.messages import (
    CommandResult,
    Health,
    Input,
    MissionView,
    OperatorCommand,
    Output,
    PadBeacon,
    PadBearing,
    PadEstimate,
    PadNotSeen,
    PadObservation,
    Phase,
    PlanMade,
    RangeMeasurement,
    ThrustReport,
    Tick,
    Vec3,
    VehicleState,
    VehicleStatus,
    VelocitySetpoint,
)
from companion.mission.facts import Facts
from companion.mission.goals import Goal, goal_of
from companion.mission.machine import Machine
from companion.mission.preflight import MAX_MODE_AGE_S, MAX_STATE_AGE_S
from companion.mission.search_area import SearchArea
from companion.mount import mounted
from companion.planning import FOLLOWERS, PLANNERS
from companion.planning.follower import FollowRequest
from companion.planning.obstacle import Cylinder
from companion.situation import Situation
from companion.vision.detector import DetectionHint
from companion.vision.field_of_view import half_field_rad, may_be_in_view
from companion.vision.lens import from_config

SURE_SIGMAS = 3.0
"""Of the pad's position: what is further outside the picture than this is not looked for in every frame."""

NO_PLAN_PATIENCE_NS = 1_000_000_000

PAD_IN_VIEW_AGE_S = 0.15


@dataclass(frozen=True, slots=True)
class _Target:
    """What the goal is relative to: the predicted pad, or the point where the search began. W."""

    position_m: Vec3
    velocity_m_s: Vec3
    velocity_ahead_m_s: Vec3
    acceleration_ahead_m_s2: Vec3


def _centre(marker: Marker) -> Vec3:
    """Of a marker, in P."""
    return (*marker.position_m, -marker.height_m)


def _seen_yaw_rad(pad: PadEstimate | None) -> float | None:
    return None if pad is None or pad.vision_age_s is None else pad.yaw_rad


class Pipeline:
    """All state that decides: vehicle history, pad estimate, mission, plan, control."""

    def __init__(self, config: Config) -> None:
        self._config = config
        self._tracker = make_tracker(config.estimation, config.pad, config.cameras)
        self._machine = Machine(config.mission, config.safety)
        planner = PLANNERS[config.planning.planner](config.planning)
        self._follower = FOLLOWERS[config.planning.follower](planner, config.planning)
        self._controller = CONTROLLERS[config.control.controller](config.control)
        self._half_fields_rad = {name: half_field_rad(from_config(camera)) for name, camera in config.cameras.items()}
        self._closest_m = {name: 0.95 * c.fy_px / c.height_px for name, c in config.cameras.items()}
        self._pad_radius_m = 0.5 * math.hypot(config.pad.length_m, config.pad.width_m)
        self._mounts = {name: mounted(camera) for name, camera in config.cameras.items()}
        self._situation = Situation(config, self._tracker)
        self._range_watch = RangeWatch()
        self._guidance = None if config.guidance.form == "off" else Guidance(config.guidance)
        self._no_plan_since_ns: int | None = None
        self._told_no_plan = False
        self._start: VehiclePose | None = None
        self._start_yaw_rad = 0.0
        self._search: SearchArea | None = None
        self._setpoint: VelocitySetpoint | None = None
        self._last_tick_ns: int | None = None

    @property
    def phase(self) -> Phase:
        return self._machine.phase

    @property
    def note(self) -> str:
        """Why the mission is where it is."""
        return self._machine.note if self._guidance is None else self._guidance.note

    @property
    def go_arounds(self) -> int:
        return self._machine.go_arounds

    # ---------------------------------------------------------------------------------------------------------- inputs

    def handle(self, message: Input) -> list[Output]:
        """One message in, what follows from it out. Never raises on content."""
        match message:
            case Tick():
                return self._on_tick(message.t_ns)
            case VehicleState():
                self._tracker.add_vehicle_state(message)
                return [*self._tracker.observe_waiting()]
            case RangeMeasurement():
                message = self._believed(message)
                self._situation.add_range(message)
                return self._observe(message)
            case PadObservation() | PadBearing():
                self._situation.add_frame(message.t_ns)
                return self._observe(message)
            case PadNotSeen():
                self._situation.add_frame(message.t_ns)
            case PadBeacon():
                return self._observe(message)
            case VehicleStatus():
                self._situation.status = message
            case ThrustReport():
                self._situation.add_thrust(message)
            case CommandResult():
                self._situation.add_command_result(message)
            case OperatorCommand():
                if self._guidance is not None:
                    return [self._guidance.answer(message)]
                self._situation.operator = message.action
            case _:
                pass
        return []

    def _believed(self, message: RangeMeasurement) -> RangeMeasurement:
        """Without its distance where the sensor is stuck."""
        pose = self._tracker.history.at(message.t_ns)
        if pose is None or not self._range_watch.is_stuck(message.distance_m, pose.position_o_m[2]):
            return message
        return replace(message, distance_m=None)

    def _observe(self, message: PadObservation | PadBearing | PadBeacon | RangeMeasurement) -> list[Output]:
        verdict = self._tracker.observe(message)
        return [] if verdict is None else [verdict]

    def hint(self, camera: str, t_ns: int) -> DetectionHint | None:
        """What a frame taken at t_ns should show: a pure question, asked by the shell before the detector runs."""
        pose, mount = self._tracker.history.at(t_ns), self._mounts.get(camera)
        if pose is None or mount is None:
            return None
        X_WC = Transform(pose.q_ned_frd, pose.position_ned_m) @ mount
        down_camera = rotate(quaternion_conjugate(X_WC.q), (0.0, 0.0, 1.0))
        pad = self._tracker.estimate(t_ns)
        if pad is None:
            return DetectionHint(down_camera=down_camera)
        if pad.vision_age_s is None:
            p_CP = X_WC.inverse().point(pad.position_ned_m)
            spread_m = self._pad_radius_m + SURE_SIGMAS * pad.position_sigma_m
            is_expected = may_be_in_view(p_CP, spread_m, self._half_fields_rad[camera])
            return DetectionHint(down_camera=down_camera, is_expected=is_expected)
        X_WP = Transform(quaternion_from_euler(pad.roll_rad, pad.pitch_rad, pad.yaw_rad), pad.position_ned_m)
        X_CP = X_WC.inverse() @ X_WP
        is_expected = any(
            X_CP.point(_centre(marker))[2] > marker.size_m * self._closest_m[camera]
            for marker in self._config.pad.markers
        )
        return DetectionHint(X_CP, pad.position_sigma_m, down_camera, is_expected)

    # ------------------------------------------------------------------------------------------------------------ tick

    def _on_tick(self, t_ns: int) -> list[Output]:
        dt_s = 1.0 / self._config.control.rate_hz if self._last_tick_ns is None else (t_ns - self._last_tick_ns) / 1e9
        self._last_tick_ns = t_ns
        pose = self._tracker.history.at(t_ns)
        pad = self._tracker.estimate_now(t_ns)
        self._situation.commanded_down_m_s = None if self._setpoint is None else self._setpoint.velocity_ned_m_s[2]
        facts = self._situation.facts(t_ns, pose, self._state_ns(), pad, dt_s=dt_s)
        if self._guidance is not None:
            return self._guide(self._guidance, facts, pad)
        step = self._machine.step(facts, dt_s=dt_s)
        self._situation.operator = None
        outputs: list[Output] = [*step.changes, *step.health]
        if dt_s > self._config.safety.stall_hold_s:
            self._follower.reset()  # after a pause: hold the place relative to the pad, then plan from there
        if step.changes:
            self._on_phase(step.changes[0].before, step.phase, pose, pad)
        if step.commands:
            self._situation.refused = None
            outputs += step.commands
        outputs += self._fly(step.phase, facts, pose, pad, dt_s)
        if pad is not None:
            outputs.append(pad)
        outputs.append(self._view(facts, step.phase))
        return outputs

    def _guide(self, guidance: Guidance, facts: Facts, pad: PadEstimate | None) -> list[Output]:
        """The autopilot lands by itself: no mission, no setpoint, no request."""
        told = guidance.report(facts.t_ns, pad)
        outputs: tuple[Output | None, ...] = (told, pad, self._view(facts, self.phase))
        return [output for output in outputs if output is not None]

    def _state_ns(self) -> int | None:
        latest = self._tracker.history.latest
        return None if latest is None else latest.t_ns

    def _on_phase(self, before: Phase, phase: Phase, pose: VehiclePose | None, pad: PadEstimate | None) -> None:
        self._situation.refused = None
        self._situation.no_plan, self._no_plan_since_ns = None, None
        if phase in (Phase.ENGAGE, Phase.TAKEOFF) and pose is not None:
            self._start = pose
            self._start_yaw_rad = yaw_of(pose.q_ned_frd)
            self._controller.reset()
            self._follower.reset()
            self._setpoint = None
            if before is not Phase.TAKEOFF and not self._machine.resumes:
                self._situation.flight_start_ned_m = pose.position_ned_m
        if phase is Phase.SEARCH:
            self._begin_search(pose, pad, is_first=before is Phase.ENGAGE)
        if before is Phase.SEARCH:
            self._follower.reset()

    def _begin_search(self, pose: VehiclePose | None, pad: PadEstimate | None, *, is_first: bool) -> None:
        """Around the place where the pad was last known, and high enough to see more; else by the waypoints around the last
        of them; else around the vehicle."""
        self._start = pose or self._start
        if self._start is None:
            return
        here, mission = self._start.position_ned_m, self._config.mission
        centre, drift = here, (0.0, 0.0)
        waypoints = mission.approach_waypoints_m if is_first and pad is None else ()
        if waypoints:
            centre = (*waypoints[-1], here[2])
        if pad is not None:
            north, east, down = pad.position_ned_m
            centre = (north, east, min(here[2], down - mission.search_height_m))
            drift = (pad.velocity_ned_m_s[0], pad.velocity_ned_m_s[1])
        self._search = SearchArea(
            mission,
            t_ns=self._last_tick_ns or 0,
            here_ned_m=here,
            centre_ned_m=centre,
            drift_m_s=drift,
            allowed=self._situation.is_allowed,
            by_ned_m=waypoints[:-1],
        )

    # ------------------------------------------------------------------------------------------------------------- fly

    def _fly(
        self, phase: Phase, facts: Facts, pose: VehiclePose | None, pad: PadEstimate | None, dt_s: float
    ) -> list[Output]:
        goal = goal_of(phase, facts, self._config.mission, phase_age_s=self._machine.age_s(facts.t_ns))
        if goal is None or pose is None or not self._may_send(facts):
            self._setpoint = None
            return []
        target = self._target(goal, facts.t_ns, pad)
        if target is None:
            goal = Goal("start", "stay")
            target = self._target(goal, facts.t_ns, pad)
        if target is None:
            return []
        outputs: list[Output] = []
        now, ahead = self._reference(goal, target, pose, facts.t_ns, outputs)
        command = self._controller.update(
            ControlInput(
                dt_s=dt_s,
                relative_position_m=subtract(pose.position_ned_m, target.position_m),
                relative_velocity_m_s=subtract(pose.velocity_ned_m_s, target.velocity_m_s),
                reference=now,
                reference_ahead=ahead,
                pad_velocity_ahead_m_s=target.velocity_ahead_m_s,
                pad_acceleration_ahead_m_s2=target.acceleration_ahead_m_s2,
                feedback=goal.style != "press",
                velocity_ned_m_s=pose.velocity_ned_m_s,
                position_ned_m=pose.position_ned_m,
                q_ned_frd=pose.q_ned_frd,
                goal_position_m=None if goal.style == "pattern" else goal.position_m,
                pad_yaw_rad=_seen_yaw_rad(pad),
            )
        )
        self._setpoint = self._limited(command.velocity_ned_m_s, command.acceleration_ned_m_s2, pose, pad, facts, dt_s)
        return [*outputs, self._setpoint]

    def _may_send(self, facts: Facts) -> bool:
        state_fresh = facts.state_age_s is not None and facts.state_age_s <= MAX_STATE_AGE_S
        mode_fresh = facts.mode_age_s is not None and facts.mode_age_s <= MAX_MODE_AGE_S
        # PX4 takes OFFBOARD back by itself at the first setpoint after a failsafe: none before the mode is known afresh.
        return state_fresh and mode_fresh and facts.status is not None and facts.status.connected

    def _target(self, goal: Goal, t_ns: int, pad: PadEstimate | None) -> _Target | None:
        if goal.frame == "start":
            return None if self._start is None else _Target(self._start.position_ned_m, ZERO, ZERO, ZERO)
        if pad is None:
            return None
        control = self._config.control
        ahead = self._foreseen(t_ns, control.lead_s, pad)
        preview = ahead
        if control.acceleration_preview_s != control.lead_s:
            preview = self._foreseen(t_ns, control.acceleration_preview_s, pad)
        heave = ahead
        if control.vertical_lead_s != control.lead_s:
            heave = self._foreseen(t_ns, control.vertical_lead_s, pad)
        acceleration = (*preview.acceleration_ned_m_s2[:2], heave.acceleration_ned_m_s2[2])
        return _Target(
            position_m=pad.position_ned_m,
            velocity_m_s=pad.velocity_ned_m_s,
            velocity_ahead_m_s=(*ahead.velocity_ned_m_s[:2], heave.velocity_ned_m_s[2]),
            acceleration_ahead_m_s2=acceleration if control.acceleration_feedforward else ZERO,
        )

    def _foreseen(self, t_ns: int, ahead_s: float, pad: PadEstimate) -> PadMotion | PadEstimate:
        return self._tracker.motion(t_ns + round(ahead_s * 1e9)) or pad

    def _reference(
        self, goal: Goal, target: _Target, pose: VehiclePose, t_ns: int, outputs: list[Output]
    ) -> tuple[Reference, Reference]:
        if goal.style == "stay":
            still = Reference(ZERO, ZERO, ZERO)
            return still, still
        if goal.style == "press":
            pressing = Reference(ZERO, goal.velocity_m_s, goal.acceleration_m_s2)
            return pressing, pressing
        if goal.style == "pattern":
            return self._pattern(t_ns)
        followed = self._follower.follow(
            FollowRequest(
                t_ns=t_ns,
                lead_s=self._config.control.lead_s,
                style=goal.style,
                position_m=subtract(pose.position_ned_m, target.position_m),
                velocity_m_s=subtract(pose.velocity_ned_m_s, target.velocity_m_s),
                goal_position_m=goal.position_m,
                goal_velocity_m_s=goal.velocity_m_s,
                pad_velocity_m_s=target.velocity_m_s,
                pad_acceleration_m_s2=target.acceleration_ahead_m_s2,
                max_descent_m_s=goal.max_descent_m_s,
                pad_position_m=target.position_m,
                obstacles=self._obstacles(goal, target, pose),
            )
        )
        self._situation.plan_to_go_s = self._follower.to_go_s(t_ns)
        if followed.plan is not None:
            outputs += [followed.plan, *self._note_plan(followed.plan)]
        return Reference(*followed.now), Reference(*followed.ahead)

    def _obstacles(self, goal: Goal, target: _Target, pose: VehiclePose) -> tuple[Cylinder, ...]:
        zones = self._situation.zones().no_fly
        if not zones:
            return ()
        vehicle, pad = pose.position_ned_m, target.position_m
        return cylinders(zones, vehicle_ned_m=vehicle, pad_ned_m=pad, goal_m=goal.position_m)

    def _note_plan(self, plan: PlanMade) -> tuple[Health, ...]:
        """A planner that finds nothing for a moment is waited for; the reference holds meanwhile. Then everybody is told why."""
        if plan.found:
            was_told, self._told_no_plan = self._told_no_plan, False
            self._situation.no_plan, self._no_plan_since_ns = None, None
            return (Health(plan.t_ns, "plan", 0, "a plan again"),) if was_told else ()
        if self._no_plan_since_ns is None:
            self._no_plan_since_ns = plan.t_ns
        if plan.t_ns - self._no_plan_since_ns < NO_PLAN_PATIENCE_NS:
            return ()
        self._situation.no_plan = plan.reason
        was_told, self._told_no_plan = self._told_no_plan, True
        return () if was_told else (Health(plan.t_ns, "plan", 1, f"holds its place against the pad: {plan.reason}"),)

    def _pattern(self, t_ns: int) -> tuple[Reference, Reference]:
        """The search: a point that moves along its path, relative to where it began."""
        if self._search is None or self._start is None:
            still = Reference(ZERO, ZERO, ZERO)
            return still, still
        here = self._search.step(t_ns)
        ahead = self._search.ahead(t_ns + round(self._config.control.lead_s * 1e9))
        origin = self._start.position_ned_m
        return (
            Reference(subtract(here.position_ned_m, origin), here.velocity_ned_m_s, ZERO),
            Reference(subtract(ahead.position_ned_m, origin), ahead.velocity_ned_m_s, ZERO),
        )

    def _limited(
        self,
        velocity: Vec3,
        acceleration: Vec3,
        pose: VehiclePose,
        pad: PadEstimate | None,
        facts: Facts,
        dt_s: float,
    ) -> VelocitySetpoint:
        control = self._config.control
        limited = limited_velocity(
            velocity,
            max_speed_m_s=control.max_speed_m_s,
            max_climb_m_s=control.max_climb_m_s,
            max_descent_m_s=control.max_descent_m_s,
        )
        before = pose.velocity_ned_m_s if self._setpoint is None else self._setpoint.velocity_ned_m_s
        limited = slewed(before, limited, max_rate=control.max_slew_m_s2, dt_s=dt_s)
        return VelocitySetpoint(
            t_ns=facts.t_ns,
            valid_until_ns=facts.t_ns + round(control.setpoint_valid_s * 1e9),
            velocity_ned_m_s=limited,
            yaw_rate_rad_s=self._yaw_rate(pose, pad, limited, facts.relative_position_m),
            acceleration_ned_m_s2=limited_length(acceleration, control.max_acceleration_m_s2)
            if control.acceleration_feedforward
            else None,
        )

    def _yaw_rate(
        self, pose: VehiclePose, pad: PadEstimate | None, commanded_m_s: Vec3, relative_m: Vec3 | None
    ) -> float:
        control = self._config.control
        error = YAW_LAWS[control.yaw](
            YawInput(
                yaw_rad=yaw_of(pose.q_ned_frd),
                initial_yaw_rad=self._start_yaw_rad,
                pad_yaw_rad=_seen_yaw_rad(pad),
                velocity_ned_m_s=pose.velocity_ned_m_s,
                yaw_rate_rad_s=pose.angular_velocity_frd_rad_s[2],
                commanded_velocity_ned_m_s=commanded_m_s,
                relative_position_m=relative_m,
                announced_yaw_rad=pad.yaw_rad if pad is not None and pad.beacon_age_s is not None else None,
            )
        )
        limit = math.radians(control.max_yaw_rate_deg_s)
        return clipped(control.yaw_gain_hz * error, limit)

    def _view(self, facts: Facts, phase: Phase) -> MissionView:
        pad = facts.pad
        seen = pad is not None and pad.vision_age_s is not None and pad.vision_age_s < PAD_IN_VIEW_AGE_S
        return MissionView(
            t_ns=facts.t_ns,
            phase=phase,
            relative_position_ned_m=facts.relative_position_m,
            relative_velocity_ned_m_s=facts.relative_velocity_m_s,
            height_above_pad_m=facts.height_above_pad_m,
            pad_seen=seen,
            note=self.note,
            go_arounds=self._machine.go_arounds,
        )
