"""One simulated PX4: takes MAVLink bytes and the truth, gives motor commands and MAVLink bytes.

Order of a step: estimate, commander (mode, arming, failsafe), flight task of the mode, take-off ramp, control cascade, land detector,
messages. `step` is to be called every 4 ms with the boot clock; nothing here knows another clock. W local NED, B FRD. World drives it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import isfinite, nan
from typing import Any

import numpy as np

from sitl_stub.airframe import Airframe
from sitl_stub.autopilot import events
from sitl_stub.autopilot.arming import Health
from sitl_stub.autopilot.auto_flight import AutoFlight
from sitl_stub.autopilot.battery import Battery
from sitl_stub.autopilot.cascade import Cascade, FlightConstraints
from sitl_stub.autopilot.commander import Commander, Conditions
from sitl_stub.autopilot.commands import Command, Result
from sitl_stub.autopilot.estimate import EstimateErrors, Estimator
from sitl_stub.autopilot.home import Home
from sitl_stub.autopilot.land import Land
from sitl_stub.autopilot.land_detector import CLOSE_TO_GROUND_M, LandDetector, LandDetectorInput
from sitl_stub.autopilot.loiter import Loiter
from sitl_stub.autopilot.manual_control import ManualControl, Sticks
from sitl_stub.autopilot.mixer import Motors
from sitl_stub.autopilot.modes import NavState
from sitl_stub.autopilot.navigation import NavigationTarget, Route, Situation, TargetKind
from sitl_stub.autopilot.noise import NormalTape
from sitl_stub.autopilot.offboard import LocalTarget, OffboardStream
from sitl_stub.autopilot.parameters import Parameters
from sitl_stub.autopilot.pilot_flight import PilotFlight
from sitl_stub.autopilot.precland import LandingTarget, Precland
from sitl_stub.autopilot.rtl import Rtl
from sitl_stub.autopilot.setpoint import AttitudeSetpoint, RatesSetpoint, Setpoint, TrajectorySetpoint
from sitl_stub.autopilot.steady_control import Asked
from sitl_stub.autopilot.takeoff import TakeoffRamp, TakeoffState
from sitl_stub.autopilot.takeoff_route import TakeoffRoute
from sitl_stub.geodesy import Origin
from sitl_stub.mavlink_endpoint import MavlinkEndpoint
from sitl_stub.multirotor import VehicleTruth
from sitl_stub.telemetry import IN_AIR, LANDING, ON_GROUND, TAKEOFF, Telemetry

DECISION_PERIOD_US = 8_000
"""Mode, flight task and land detector run when PX4's estimator publishes a position, every second step."""
_AUTOMATIC_MARGIN = 1.2
_STOPPED: Motors = (0.0, 0.0, 0.0, 0.0)
_FLIGHT = TakeoffState.FLIGHT
_NEVER_US = 1 << 62
_CAN_ARM_AFTER_US = 4_000_000
_POSITION_VALID_WITHOUT_GPS_US = 5_000_000
_GROUND_STATION_NOTICE_US = 1_000_000
_IGNORE_RATES = 0x07
_IGNORE_ATTITUDE = 0x80

_THRUST_MODES = frozenset({NavState.MANUAL, NavState.ACRO, NavState.STABILIZED})
_PILOT_MODES = frozenset({NavState.MANUAL, NavState.ALTCTL, NavState.POSCTL, NavState.ACRO, NavState.STABILIZED})
_SWITCH_MODES = {
    "hold": NavState.AUTO_LOITER,
    "position": NavState.POSCTL,
    "altitude": NavState.ALTCTL,
    "manual": NavState.STABILIZED,
    "land": NavState.AUTO_LAND,
    "return": NavState.AUTO_RTL,
    "offboard": NavState.OFFBOARD,
}


def _default_origin() -> Origin:
    return Origin(47.397742, 8.545594, 489.4)


@dataclass(frozen=True, slots=True)
class AutopilotOptions:
    """How this PX4 differs from the recorded one."""

    origin: Origin = field(default_factory=_default_origin)
    """Where W's origin lies."""
    errors: EstimateErrors = field(default_factory=EstimateErrors)
    home_error_scale: float = 1.0
    """Wandering of the home altitude (relative_alt); 0 switches it off."""
    imu_noise_scale: float = 1.0
    ground_link: bool = True
    """PX4 sends on its ground link even when nobody listens; False saves the time."""
    cold_boot: bool = True
    """Boot as the real one does (ready 4 s after power-on); False: ready at once."""
    has_range_sensor: bool = True
    unix_start_us: int = 1_795_360_881_000_000
    """Wall-clock time at boot, as GNSS would tell it."""


class Autopilot:
    """The flight controller of one multirotor.

    `parameters` override the airframe's, which override PX4's defaults; an unknown name raises KeyError.
    """

    def __init__(
        self,
        airframe: Airframe,
        parameters: Mapping[str, float | int] | None = None,
        rng: np.random.Generator | None = None,
        options: AutopilotOptions = AutopilotOptions(),
    ) -> None:
        rng = np.random.default_rng(0) if rng is None else rng
        estimate_rng, home_rng, imu_rng = rng.spawn(3)
        self.options = options
        self.parameters = Parameters({**airframe.parameters, **(parameters or {})})
        self._hover_signal = airframe.hover_signal
        values = self.parameters.as_mapping()
        self.estimator = Estimator(values, estimate_rng, options.errors)
        self.estimator.begin_at_rest()
        self.cascade = Cascade(values)
        self.battery = Battery(self.parameters)
        self.manual_control = ManualControl(self.parameters)
        self.offboard = OffboardStream()
        self.land_detector = LandDetector(self.parameters)
        self.takeoff = TakeoffRamp(self.parameters)
        self.home = Home(options.origin.altitude_m, NormalTape(home_rng), options.home_error_scale)
        self.commander = Commander(self.parameters, self._tell)
        self.landing_target = LandingTarget()
        self._auto_flight = AutoFlight(self.parameters)
        self._pilot_flight = PilotFlight(self.parameters)
        self._constraints = FlightConstraints()
        self._pilot_sticks: Sticks | None = None
        self._offboard_attitude: AttitudeSetpoint | RatesSetpoint | None = None
        self._route: Route | None = None
        self._flown: tuple[NavState, int] | None = None
        self._target: NavigationTarget | None = None
        self._setpoint: Setpoint | None = None
        self._t_us = 0
        self._without_gps_us: int | None = None
        self._position_is_valid = False
        self._armings_seen = 0
        self._resets_seen = (0, 0)
        self._ground_station_lost = False
        self._descent_m_s: float | None = None
        self._parameter_changes = 0
        self._drained_us = -DECISION_PERIOD_US - 4_000
        self.since_decision_us = DECISION_PERIOD_US
        self.telemetry = Telemetry(
            self.estimator.estimate,
            self.commander,
            self.battery,
            self.home,
            options.origin,
            NormalTape(imu_rng),
            options.imu_noise_scale,
            options.unix_start_us,
            has_range_sensor=options.has_range_sensor,
        )
        self.endpoint = MavlinkEndpoint(
            self.telemetry,
            self.parameters,
            self,
            ground_link=options.ground_link,
            cold_boot=options.cold_boot,
        )
        self._refresh_limits()
        self.parameters.on_change(self._refresh)

    # World's side -------------------------------------------------------------------------------------------------

    @property
    def is_armed(self) -> bool:
        return self.commander.armed

    @property
    def mode_name(self) -> str:
        """PX4's name of the mode that is executed, such as OFFBOARD or AUTO_LOITER."""
        return self.commander.nav_state.name

    def receive(self, link: str, data: bytes, t_us: int) -> None:
        """Bytes that came on a link ("onboard" or "ground") at t_us."""
        self._t_us = self.telemetry.t_us = max(t_us, self._t_us)
        self.endpoint.receive(link, data)

    def datagrams(self) -> list[tuple[str, bytes]]:
        """Datagrams to send since the last call, each with its link."""
        return self.endpoint.drain()

    def begin_in_air(self, truth: VehicleTruth, t_us: int = 0) -> None:
        """Start of a scenario in flight: armed, AUTO.LOITER, hovering where the vehicle is."""
        self._t_us = t_us
        self.estimator.settle(truth)
        estimate = self.estimator.step(t_us, truth, 0.004)
        x, y, _ = estimate.position_ned_m
        self.home.set_here((x, y, 0.0), estimate.yaw_rad, t_us)
        hover = self._hover_signal
        self.cascade.start_in_flight(hover, estimate.q_ned_frd, hover, estimate.velocity_ned_m_s)
        self.commander.begin_in_air(t_us)
        self.commander.learn_health(self._refresh_health(t_us))
        self._armings_seen = self.commander.armings
        self.land_detector.begin_in_air(t_us)
        self.takeoff.update(t_us, True, False, True, skip=True)

    def see_range(self, t_us: int, range_m: float | None) -> None:
        """A new reading of the range sensor; None where it measures nothing."""
        self.estimator.see_range(t_us, range_m)

    def set_pilot(self, sticks: Sticks | None, *, mode: str | None = None, kill: bool = False) -> None:
        """A radio with a pilot: sticks from now on (None: radio off), mode switch if given, kill switch.

        `mode` is hold, position, altitude, manual, land, return or offboard; ValueError for anything else.
        """
        self._pilot_sticks = sticks
        self.manual_control.kill = kill
        if sticks is not None:
            self.manual_control.receive(sticks, self._t_us)
        if mode is None:
            return
        if mode not in _SWITCH_MODES:
            raise ValueError(f"pilot mode {mode!r}: must be one of {', '.join(_SWITCH_MODES)}")
        self.manual_control.note_rest()
        self.commander.learn_health(self._refresh_health(self._t_us))
        self.commander.request_mode(_SWITCH_MODES[mode])

    def step(self, t_us: int, truth: VehicleTruth, range_m: float | None, dt_s: float) -> Motors:
        """Advance to t_us and return the motor commands, 0 to 1; `range_m` is what DISTANCE_SENSOR says."""
        self._t_us = self.telemetry.t_us = t_us
        self.estimator.motors_run = self.commander.armed
        self.estimator.step(t_us, truth, dt_s)
        self.since_decision_us += round(dt_s * 1e6)
        if self.since_decision_us >= DECISION_PERIOD_US:
            decided_dt_s = self.since_decision_us * 1e-6
            self.since_decision_us = 0
            self.decide(t_us, decided_dt_s)
        return self.finish_step(t_us, truth, range_m, dt_s)

    def finish_step(self, t_us: int, truth: VehicleTruth, range_m: float | None, dt_s: float) -> Motors:
        """What follows estimate and decision: the cascade and the messages."""
        motors = self.cascade.step(dt_s, self.estimator.estimate, self._setpoint, self._constraints)
        if self.commander.terminated or self.commander.killed:
            motors = _STOPPED
        if self.endpoint.is_due(t_us):
            self.send(t_us, truth, range_m, motors)
        return motors

    def send(self, t_us: int, truth: VehicleTruth, range_m: float | None, motors: Motors) -> None:
        """Send the messages that are due."""
        self.fill_telemetry(truth, range_m, motors)
        self.endpoint.step(t_us)

    def decide(self, t_us: int, dt_s: float) -> None:
        """All that PX4 does when the estimator publishes a position: mode, flight task, take-off ramp, land detector."""
        self.drain_battery(t_us)
        if self._pilot_sticks is not None:
            self.manual_control.receive(self._pilot_sticks, t_us)
        self._follow_jumps()
        self.commander.pass_over(t_us, DECISION_PERIOD_US)
        self.commander.step(self._conditions(t_us))
        self._set_home(t_us)
        self._setpoint = self._fly(t_us, dt_s)
        self._constrain(t_us, dt_s)
        self._detect_landing(t_us)

    # Steady flight ------------------------------------------------------------------------------------------------

    def is_steady(self) -> bool:
        """Only estimate, cascade and rigid body move between decisions (steady_flight.py)."""
        commander, estimate = self.commander, self.estimator.estimate
        if commander.terminated or commander.killed or not self.estimator.gnss_available:
            return False
        if not (estimate.has_position and estimate.has_velocity and estimate.has_altitude):
            return False
        return self.cascade.is_steady(self._setpoint, self._constraints)

    def disturbances(self) -> tuple[object, ...]:
        """Changes when a command or a parameter has done more than a setpoint may."""
        c = self.commander
        return (
            c.armed,
            c.terminated,
            c.killed,
            self.manual_control.kill,
            self._parameter_changes,
            self.estimator.gnss_available,
            self._is_automatic,
        )

    def asked(self) -> Asked:
        """What the cascade flies until the next decision."""
        assert isinstance(self._setpoint, TrajectorySetpoint)
        height_m = self.estimator.estimate.height_above_bottom_m
        return self._asked_by(self._setpoint, is_near_ground=height_m is None or height_m < CLOSE_TO_GROUND_M)

    def asked_next(self, *, is_near_ground: bool) -> Asked | None:
        """What the next decision in OFFBOARD will have flown, if it can only be the newest setpoint; None where it must be made."""
        setpoint = self.offboard.setpoint
        if setpoint is None or self._offboard_attitude is not None or self.commander.nav_state is not NavState.OFFBOARD:
            return None
        if not self.cascade.is_steady(setpoint, self._constraints):
            return None
        return self._asked_by(setpoint, is_near_ground=is_near_ground)

    def take_next(self) -> None:
        """The decision that `asked_next` told of has been made."""
        self._setpoint = self._fly_offboard()

    def _asked_by(self, setpoint: TrajectorySetpoint, *, is_near_ground: bool) -> Asked:
        yaw_rate = setpoint.yaw_rate_rad_s
        return Asked(
            self.cascade.motion_asked(setpoint),
            setpoint.yaw_rad if isfinite(setpoint.yaw_rad) else nan,
            yaw_rate if isfinite(yaw_rate) else 0.0,
            self.land_detector.descends(setpoint.velocity_ned_m_s[2]),
            is_near_ground,
        )

    def calm_until_us(self, t_us: int) -> int:
        """Until then only the flight task has anything to decide while nothing is received; 0 where that cannot be said."""
        if self.manual_control.was_seen or self._pilot_sticks or self.takeoff.state is not _FLIGHT:
            return 0
        if not self.land_detector.is_idle(t_us) or not self.battery.is_settled:
            return 0
        health = self._refresh_health(t_us)
        health_us = self._health_holds_until_us(health)
        return int(min(self.commander.quiet_until_us(health), health_us, self.home.next_change_us))

    def _health_holds_until_us(self, health: Health) -> float:
        """Until when health stays like this while nothing is received and GNSS is there."""
        seen, ends_us = self.endpoint.ground_station_seen_us, float(_NEVER_US)
        if seen is not None and not self._ground_station_lost:
            ends_us = self._ground_station_lost_us(seen)
        if health.has_offboard:
            ends_us = min(ends_us, self.offboard.dies_us(self._offboard_timeout_s))
        return ends_us if health.is_ready else min(ends_us, _CAN_ARM_AFTER_US)

    @property
    def task_waits(self) -> bool:
        """The flight task does nothing between setpoints received."""
        return self.commander.nav_state is NavState.OFFBOARD

    def reasons_to_decide(self) -> tuple[object, ...]:
        """Changes when something received is more than a setpoint."""
        c, has_offboard = self.commander, self.offboard.is_alive(self._t_us, self._offboard_timeout_s)
        return (
            c.mode_changes,
            c.health,
            has_offboard,
            self.manual_control.was_seen,
            self.endpoint.ground_station_seen_us,
        )

    def stays_calm(self, reasons: object, t_us: int) -> bool:
        """The flight task has changed nothing but its setpoint, and nothing looks like a landing."""
        return self.reasons_to_decide() == reasons and self.land_detector.is_idle(t_us)

    def decide_task(self, t_us: int, dt_s: float) -> None:
        """The part of `decide` that is left while all is calm."""
        self._setpoint = self._fly(t_us, dt_s)
        self._detect_landing(t_us)

    def drain_battery(self, t_us: int) -> None:
        """Bring the battery up to the time of the last decision, made or left out."""
        if t_us > self._drained_us:
            self.battery.step((t_us - self._drained_us) * 1e-6, self.commander.armed)
            self._drained_us = t_us

    def show(self, t_us: int, flat: Any) -> None:
        """Let the estimate be a flat state's, at t_us."""
        self._t_us = self.telemetry.t_us = t_us
        self.estimator.show(t_us, flat)

    def next_message_us(self) -> int:
        """When a message is due, at the earliest."""
        return self.endpoint.next_due_us

    # What the endpoint hands over ---------------------------------------------------------------------------------

    def handle_command(self, command: Command) -> Result | None:
        """The commander's answer; a stream that has just begun counts at once."""
        self.commander.note_gain(self._refresh_health(self._t_us))
        return self.commander.handle(command)

    def receive_local_target(self, target: LocalTarget) -> None:
        """SET_POSITION_TARGET_LOCAL_NED."""
        notice = self.offboard.receive(target, self.estimator.estimate.yaw_rad, self._t_us)
        if notice is not None:
            self._tell(notice)
        else:
            self._offboard_attitude = None

    def receive_attitude_target(
        self, q_ned_frd: tuple[float, float, float, float], rates: tuple[float, float, float], thrust: float, mask: int
    ) -> None:
        """SET_ATTITUDE_TARGET: attitude, or rates when the attitude is ignored."""
        if not isfinite(thrust):
            return
        if mask & _IGNORE_ATTITUDE:
            self._offboard_attitude = RatesSetpoint(rates, thrust)
        else:
            yaw_rate = 0.0 if mask & 4 or not isfinite(rates[2]) else rates[2]
            self._offboard_attitude = AttitudeSetpoint(q_ned_frd, thrust, yaw_rate)
        self.offboard.keep_alive(self._t_us)

    def receive_landing_target(self, x_m: float, y_m: float, z_m: float) -> None:
        """LANDING_TARGET in local NED."""
        self.landing_target.receive(x_m, y_m, z_m, self._t_us)

    def receive_sticks(self, sticks: Sticks) -> None:
        """MANUAL_CONTROL."""
        self.manual_control.receive(sticks, self._t_us)

    def _tell(self, notice: events.Notice) -> None:
        self.endpoint.tell(notice)

    def _refresh_limits(self) -> None:
        """Automatic modes leave the controller a fifth more than their own greatest speed of descent."""
        get = self.parameters.get
        self._climb_max_m_s = get("MPC_Z_VEL_MAX_UP")
        self._offboard_timeout_s = get("COM_OF_LOSS_T")
        self._descent_limits_m_s = get("MPC_Z_VEL_MAX_DN"), _AUTOMATIC_MARGIN * get("MPC_Z_V_AUTO_DN")

    def _refresh(self, name: str) -> None:
        self._parameter_changes += 1
        self._refresh_limits()
        self.cascade.refresh()
        self.estimator.refresh()
        self._auto_flight.refresh()
        self.land_detector.refresh()

    # Conditions ---------------------------------------------------------------------------------------------------

    def _refresh_health(self, t_us: int) -> Health:
        if self.estimator.gnss_available:
            self._without_gps_us = None
        elif self._without_gps_us is None:
            self._without_gps_us = t_us
        lost_for_us = 0 if self._without_gps_us is None else t_us - self._without_gps_us
        ready = not self.options.cold_boot or t_us >= _CAN_ARM_AFTER_US
        self._position_is_valid = ready and lost_for_us <= _POSITION_VALID_WITHOUT_GPS_US
        return Health(
            is_ready=ready,
            has_position=self._position_is_valid,
            has_offboard=self.offboard.is_alive(t_us, self._offboard_timeout_s),
            has_sticks=self.manual_control.is_alive(t_us),
            has_ground_station=self._has_ground_station(t_us),
            is_terminated=self.commander.terminated,
        )

    def _has_ground_station(self, t_us: int) -> bool:
        seen = self.endpoint.ground_station_seen_us
        return seen is not None and t_us <= self._ground_station_lost_us(seen)

    def _ground_station_lost_us(self, seen_us: int) -> float:
        return seen_us + self.parameters.get("COM_DL_LOSS_T") * 1e6 + _GROUND_STATION_NOTICE_US

    def _conditions(self, t_us: int) -> Conditions:
        health = self._refresh_health(t_us)
        nav_state = self.commander.nav_state
        lost = self.endpoint.ground_station_seen_us is not None and not health.has_ground_station
        if lost and not self._ground_station_lost:
            self._tell(events.ground_station_lost())
        self._ground_station_lost = lost
        takes_over = nav_state not in _PILOT_MODES and self.manual_control.takes_over(
            t_us, in_offboard=nav_state is NavState.OFFBOARD
        )
        if takes_over:
            self.manual_control.note_rest()
        return Conditions(
            t_us,
            health,
            self.land_detector.landed,
            sticks_lost=self.manual_control.was_seen and not health.has_sticks,
            ground_station_lost=lost,
            battery_warning=self.battery.warning(),
            pilot_takes_over=takes_over,
            kill=self.manual_control.kill,
        )

    def _set_home(self, t_us: int) -> None:
        estimate = self.estimator.estimate
        newly_armed = self.commander.armings != self._armings_seen
        if newly_armed or (not self.home.is_set and self.commander.health.is_ready):
            self._armings_seen = self.commander.armings
            self.home.set_here(estimate.position_ned_m, estimate.yaw_rad, t_us)
        self.home.step(t_us, self.commander.armed and not self.land_detector.landed)

    def _follow_jumps(self) -> None:
        estimate = self.estimator.estimate
        seen = (estimate.position_xy_resets, estimate.position_z_resets)
        if seen == self._resets_seen:
            return
        north, east = estimate.position_xy_jump_m if seen[0] != self._resets_seen[0] else (0.0, 0.0)
        down = estimate.position_z_jump_m if seen[1] != self._resets_seen[1] else 0.0
        self._auto_flight.shift((north, east, down))
        self._resets_seen = seen
        self.telemetry.estimate_resets = self.estimate_resets

    # Flight tasks -------------------------------------------------------------------------------------------------

    def _situation(self, t_us: int, dt_s: float) -> Situation:
        estimate = self.estimator.estimate
        return Situation(
            t_us,
            dt_s,
            estimate.position_ned_m,
            estimate.velocity_ned_m_s,
            estimate.yaw_rad,
            estimate.height_above_bottom_m,
            self.home.position_ned_m,
            self.home.altitude_amsl_m,
            self.land_detector.landed,
            self.parameters,
            self._tell,
        )

    def _fly(self, t_us: int, dt_s: float) -> Setpoint | None:
        commander = self.commander
        if not commander.armed:
            self._target = None
            self._flown = None
            return None
        mode = commander.nav_state
        if mode is NavState.OFFBOARD:
            self._leave_route(mode)
            return self._fly_offboard()
        if mode is NavState.TERMINATION:
            return None
        situation = self._situation(t_us, dt_s)
        if mode in _PILOT_MODES:
            return self._fly_by_hand(mode, situation)
        if mode is NavState.DESCEND:
            self._leave_route(mode)
            self._descent_m_s = self.parameters.get("MPC_LAND_SPEED")
            return TrajectorySetpoint((nan, nan, nan), (nan, nan, self._descent_m_s), (0.0, 0.0, nan), nan, nan)
        return self._fly_automatically(mode, situation)

    def _leave_route(self, mode: NavState) -> None:
        self._target = None
        self._flown = (mode, self.commander.mode_changes)

    def _fly_offboard(self) -> Setpoint | None:
        if self._offboard_attitude is not None:
            self._descent_m_s = None
            return self._offboard_attitude
        setpoint = self.offboard.setpoint
        vz = nan if setpoint is None else setpoint.velocity_ned_m_s[2]
        self._descent_m_s = vz if isfinite(vz) else None
        return setpoint

    def _fly_by_hand(self, mode: NavState, situation: Situation) -> Setpoint:
        key = (mode, self.commander.mode_changes)
        if self._flown is None or self._flown[0] is not mode:
            self._pilot_flight.start(situation)
        self._flown = key
        self._target = None
        sticks = self.manual_control.sticks
        setpoint = self._pilot_flight.update(mode, situation, sticks)
        vz = setpoint.velocity_ned_m_s[2] if isinstance(setpoint, TrajectorySetpoint) else nan
        self._descent_m_s = vz if isfinite(vz) else None
        return setpoint

    def _fly_automatically(self, mode: NavState, situation: Situation) -> Setpoint:
        self._enter_route(mode, situation)
        assert self._route is not None
        if self.takeoff.state < TakeoffState.RAMP_UP:
            # On the ground the task begins again each step, so that the climb starts with the ramp.
            self._auto_flight.wait(situation)
        self._target = self._route.update(situation)
        if self._route.done and mode is NavState.AUTO_TAKEOFF:
            self.commander.finish_takeoff()
        setpoint = self._auto_flight.update(situation, self._target)
        self._descent_m_s = setpoint.velocity_ned_m_s[2]
        return setpoint

    def _enter_route(self, mode: NavState, situation: Situation) -> None:
        again = (
            mode is NavState.AUTO_TAKEOFF and self._flown is not None and self._flown[1] != self.commander.mode_changes
        )
        if self._flown is not None and self._flown[0] is mode and not again:
            return
        was_automatic = self._target is not None
        if not was_automatic:
            self._auto_flight.start(situation)
        self._route = _ROUTES[mode](self)
        self._route.enter(situation, self._target)
        self._flown = (mode, self.commander.mode_changes)

    # Control ------------------------------------------------------------------------------------------------------

    @property
    def _task_wants_takeoff(self) -> bool:
        mode = self.commander.nav_state
        if mode is NavState.OFFBOARD:
            if self._offboard_attitude is not None:
                return self._offboard_attitude.thrust > 0.0
            return self.offboard.wants_takeoff(self.estimator.estimate.position_ned_m[2], self._t_us)
        if mode in _PILOT_MODES:
            return self._pilot_flight.wants_takeoff(self.manual_control.sticks)
        return self._target is not None and self._target.kind is TargetKind.TAKEOFF

    def _constrain(self, t_us: int, dt_s: float) -> None:
        """Tell the cascade what take-off ramp and land detector allow."""
        c, armed, landed = self._constraints, self.commander.armed, self.land_detector.landed
        is_automatic = self._is_automatic
        self.cascade.limit_descent(self._descent_limits_m_s[is_automatic])
        state = self.takeoff.update(t_us, armed, landed, armed and self._task_wants_takeoff, skip=self._skips_ramp)
        c.armed = armed
        c.landed = landed
        c.maybe_landed = self.land_detector.maybe_landed
        c.is_flying = state is TakeoffState.FLIGHT
        c.thrust_off = state < TakeoffState.RAMP_UP or (c.is_flying and self.land_detector.ground_contact)
        c.climb_limit_m_s = c.descent_limit_m_s = nan
        if state is TakeoffState.RAMP_UP:
            c.climb_limit_m_s = self.takeoff.climb_limit_m_s(dt_s, self._climb_max_m_s)
            # A negative climb limit of the ramp goes before the limit of descent.
            c.descent_limit_m_s = max(-c.climb_limit_m_s, self._descent_limits_m_s[is_automatic])

    @property
    def _is_automatic(self) -> bool:
        return self.commander.nav_state in _ROUTES

    @property
    def _skips_ramp(self) -> bool:
        """Modes that command thrust directly have no ramp."""
        return self.commander.nav_state in _THRUST_MODES and not self.land_detector.landed

    def _detect_landing(self, t_us: int) -> None:
        if self.commander.terminated and self.commander.armed:
            return
        estimate = self.estimator.estimate
        rates = estimate.angular_velocity_frd_rad_s
        seen = LandDetectorInput(
            estimate.velocity_ned_m_s,
            (rates[0], rates[1]),
            self._descent_m_s,
            self.cascade.thrust_setpoint,
            estimate.height_above_bottom_m,
            estimate.has_velocity,
            estimate.height_rate_ned_m_s,
            self.cascade.known_hover_thrust,
            self._controls_climb,
        )
        self.land_detector.update(t_us, self.commander.armed, seen)

    @property
    def _controls_climb(self) -> bool:
        if self.commander.nav_state is NavState.OFFBOARD:
            return self._offboard_attitude is None
        return self.commander.nav_state not in _THRUST_MODES

    # Telemetry ----------------------------------------------------------------------------------------------------

    @property
    def has_target(self) -> bool:
        """An automatic mode has somewhere to go."""
        return self._target is not None and self._target.kind is not TargetKind.IDLE

    @property
    def estimate_resets(self) -> int:
        return sum(self._resets_seen) + self.estimator.estimate.yaw_resets

    @property
    def battery_full_since_us(self) -> int:
        """While armed: when the drain began, as far as decisions have gone."""
        return self._drained_us - self.battery.armed_us

    @property
    def landed_state(self) -> int:
        """EXTENDED_SYS_STATE.landed_state."""
        if self.land_detector.landed:
            return ON_GROUND
        if self._target is None:
            return IN_AIR
        return {TargetKind.LAND: LANDING, TargetKind.TAKEOFF: TAKEOFF}.get(self._target.kind, IN_AIR)

    def fill_telemetry(self, truth: VehicleTruth, range_m: float | None, motors: Motors) -> None:
        """Let the messages say what is now."""
        t, cascade = self.telemetry, self.cascade
        t.pending = None
        t.truth = truth
        t.range_m = range_m
        t.motors = motors
        t.landed_state = self.landed_state
        t.attitude_setpoint = cascade.attitude_setpoint
        t.rates_setpoint = cascade.rates_setpoint_frd_rad_s
        t.thrust = cascade.thrust_setpoint
        t.position_setpoint = cascade.position_setpoint
        t.has_target = self.has_target
        t.has_gps = self.estimator.gnss_available
        t.estimate_resets = self.estimate_resets


_ROUTES: dict[NavState, Callable[[Autopilot], Route]] = {
    NavState.AUTO_LOITER: lambda autopilot: Loiter(),
    NavState.AUTO_FOLLOW: lambda autopilot: Loiter(),
    NavState.AUTO_MISSION: lambda autopilot: Loiter(),
    NavState.AUTO_TAKEOFF: lambda autopilot: TakeoffRoute(autopilot.commander.takeoff_altitude_amsl_m),
    NavState.AUTO_LAND: lambda autopilot: Land(),
    NavState.AUTO_RTL: lambda autopilot: Rtl(),
    NavState.AUTO_PRECLAND: lambda autopilot: Precland(autopilot.landing_target),
}
