"""PX4's commander: mode, arming, auto-disarm, failsafe, home and flight termination.

The user's intention and the executed mode are two things: a failsafe changes only the second, and the vehicle goes back by itself when
the cause is gone. Refusals are TEMPORARILY_REJECTED. While disarmed every mode is taken; only arming is refused. Texts and events go
through `tell`. Runs in the autopilot's step; all times are the boot clock in microseconds.
"""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite, isnan
from typing import NamedTuple

from sitl_stub.autopilot import events
from sitl_stub.autopilot.arming import Health, can_arm, can_fly, prevents_arming, report
from sitl_stub.autopilot.commands import FORCE_MAGIC, Command, CommandId, Result
from sitl_stub.autopilot.events import Notice
from sitl_stub.autopilot.failsafe import ACTION_MODES, Action, Failsafe, FailsafeInput, FailsafeState
from sitl_stub.autopilot.modes import MAV_MODE_ARMED, MAV_MODE_CUSTOM, MODES, NavState, mode_from_custom
from sitl_stub.autopilot.parameters import Parameters

HEALTH_PERIOD_US = 100_000
_REPORT_PERIOD_US = 2_000_000
_NEVER_US = 1 << 62

_STATUS_UNINIT = 0
_STATUS_STANDBY = 3
_STATUS_ACTIVE = 4
_STATUS_CRITICAL = 5
_STATUS_TERMINATED = 8


class Conditions(NamedTuple):
    """What the commander is told each step."""

    t_us: int
    health: Health
    landed: bool
    sticks_lost: bool = False
    ground_station_lost: bool = False
    battery_warning: str | None = None
    pilot_takes_over: bool = False
    kill: bool = False


class Commander:
    """State of the vehicle as its operator sees it."""

    def __init__(self, parameters: Parameters, tell: Callable[[Notice], None]) -> None:
        self._parameters = parameters
        self._tell = tell
        self._failsafe = Failsafe(parameters)
        self._health = Health()
        self._landed = True
        self._t_us = 0
        self._next_health_us = 0
        self._next_report_us = 0
        self._reported: tuple[NavState, Health, bool, bool] | None = None
        self._announced = FailsafeState()
        self.armed = False
        self.armed_since_us = 0
        self.user_mode = NavState.AUTO_LOITER
        self.nav_state = NavState.AUTO_LOITER
        self._mode_after_disarm = NavState.AUTO_LOITER
        self.terminated = False
        self.killed = False
        self._killed_since_us = 0
        self._has_flown = False
        self._had_offboard = False
        self._landed_since_us: int | None = None
        self.takeoff_altitude_amsl_m: float | None = None
        self.mode_changes = 0
        self.armings = 0

    # What MAVLink shows -------------------------------------------------------------------------------------------

    @property
    def custom_mode(self) -> int:
        return MODES[self.nav_state].custom_mode

    @property
    def intended_custom_mode(self) -> int:
        return MODES[self.user_mode].custom_mode

    @property
    def in_failsafe(self) -> bool:
        return self._failsafe.state.action > Action.WARN

    @property
    def can_arm_now(self) -> bool:
        """The prearm bit of SYS_STATUS."""
        return can_arm(self.nav_state, self._health)

    @property
    def health(self) -> Health:
        return self._health

    @property
    def base_mode(self) -> int:
        """HEARTBEAT.base_mode."""
        flags = MODES[self.nav_state].base_flags
        if self.nav_state is NavState.OFFBOARD and not self.armed and not self._had_offboard:
            flags = MAV_MODE_CUSTOM
        return flags | (MAV_MODE_ARMED if self.armed else 0)

    @property
    def system_status(self) -> int:
        """HEARTBEAT.system_status: 0 whenever the present mode can't be armed in."""
        if self.terminated:
            return _STATUS_TERMINATED
        if self.armed:
            return _STATUS_CRITICAL if self.in_failsafe else _STATUS_ACTIVE
        return _STATUS_STANDBY if self.can_arm_now else _STATUS_UNINIT

    # Commands -----------------------------------------------------------------------------------------------------

    def handle(self, command: Command) -> Result | None:
        """Result to acknowledge with; None for no answer at all."""
        handler = _HANDLERS.get(command.id)
        return Result.UNSUPPORTED if handler is None else handler(self, command)

    def _arm_disarm(self, command: Command) -> Result | None:
        wish = command.parameters[0]
        # Recorded: 0.7 is taken as 0, a disarm; the fraction is cut off, not rounded.
        if not isfinite(wish) or int(wish) not in (0, 1):
            self._tell(events.unsupported_arm_parameter(wish))
            return None
        forced = round(command.parameters[1]) == FORCE_MAGIC if isfinite(command.parameters[1]) else False
        return self._arm() if int(wish) == 1 else self._disarm_by_command(forced)

    def _arm(self) -> Result:
        if self.armed:
            return Result.ACCEPTED
        if not can_arm(self.nav_state, self._health):
            self._tell(events.arm_denied())
            return Result.TEMPORARILY_REJECTED
        self.armed = True
        self.armings += 1
        self.armed_since_us = self._t_us
        self._has_flown = False
        self._landed_since_us = None
        self._tell(events.armed())
        return Result.ACCEPTED

    def _disarm_by_command(self, forced: bool) -> Result:
        if not self.armed:
            return Result.ACCEPTED
        if not forced and (not self._landed or self.terminated):
            self._tell(events.disarm_denied())
            return Result.TEMPORARILY_REJECTED
        self._disarm(events.BY_EXTERNAL_COMMAND)
        return Result.ACCEPTED

    def _disarm(self, reason: int) -> None:
        self.armed = False
        self._failsafe.reset()
        self._announced = FailsafeState()
        self._tell(events.disarmed(reason))
        if not self.terminated:
            self._set_user_mode(self._mode_after_disarm)

    def _set_mode(self, command: Command) -> Result:
        flags, main, sub = command.parameters[:3]
        if not int(flags) & MAV_MODE_CUSTOM:
            return Result.ACCEPTED
        try:
            wanted = mode_from_custom(int(main), int(sub))
        except ValueError:
            self._tell(events.unsupported_auto_mode())
            return Result.TEMPORARILY_REJECTED
        if wanted is None:
            return Result.ACCEPTED
        if wanted is NavState.AUTO_TAKEOFF:
            self.takeoff_altitude_amsl_m = None
        return self.request_mode(wanted)

    def request_mode(self, wanted: NavState) -> Result:
        """The user asks for a mode, by command or switch."""
        if self.terminated or (self.armed and not can_fly(wanted, self._health)):
            return Result.TEMPORARILY_REJECTED
        self._set_user_mode(wanted)
        return Result.ACCEPTED

    def _set_user_mode(self, wanted: NavState) -> None:
        self.user_mode = wanted
        if not self.armed:
            self.nav_state = wanted
        self.mode_changes += 1
        self._failsafe.override()
        if wanted is not NavState.AUTO_TAKEOFF and not prevents_arming(wanted, self._health):
            self._mode_after_disarm = wanted
        elif wanted is NavState.AUTO_TAKEOFF:
            self._mode_after_disarm = NavState.AUTO_LOITER

    def _takeoff(self, command: Command) -> Result:
        altitude = command.parameters[6]
        self.takeoff_altitude_amsl_m = None if isnan(altitude) else altitude
        return self.request_mode(NavState.AUTO_TAKEOFF)

    def _land(self, command: Command) -> Result:
        result = self.request_mode(NavState.AUTO_LAND)
        if result is Result.ACCEPTED:
            self._tell(events.landing_at_current_position())
        return result

    def _precland(self, command: Command) -> Result:
        result = self.request_mode(NavState.AUTO_PRECLAND)
        if result is Result.ACCEPTED:
            self._tell(events.precision_landing())
        return result

    def _return(self, command: Command) -> Result:
        return self.request_mode(NavState.AUTO_RTL)

    def _terminate(self, command: Command) -> Result:
        if not self.armed or not command.parameters[0] > 0.5:
            return Result.DENIED
        self._enter_termination()
        return Result.ACCEPTED

    def _enter_termination(self) -> None:
        self._tell(events.failsafe(MODES[NavState.TERMINATION].custom_mode, Action.TERMINATE))
        self.terminated = True
        self.user_mode = NavState.TERMINATION
        self.nav_state = NavState.TERMINATION

    def _accept(self, command: Command) -> Result:
        return Result.ACCEPTED

    # Time ---------------------------------------------------------------------------------------------------------

    def begin_in_air(self, t_us: int) -> None:
        """Start of a scenario: armed and flying in AUTO.LOITER."""
        self.armed = True
        self.armings += 1
        self.armed_since_us = t_us
        self._has_flown = True
        self._landed = False

    def learn_health(self, health: Health) -> None:
        """Health that holds before the next step: a start in flight, a radio that has just been switched on."""
        self._health = health

    def note_gain(self, health: Health) -> None:
        """A setpoint came since the last step; a loss is noticed only by the periodic check."""
        if self._changes_at_once(health):
            self._health = health

    def step(self, now: Conditions) -> None:
        """Advance to now: landing, auto-disarm, failsafe, mode."""
        self._t_us = now.t_us
        if now.t_us >= self._next_health_us or self._changes_at_once(now.health):
            self._next_health_us = now.t_us + HEALTH_PERIOD_US
            self._health = now.health
            self._had_offboard |= now.health.has_offboard
        self._note_landing(now)
        self._kill(now)
        if self.armed:
            self._auto_disarm(now)
        if self.armed and now.pilot_takes_over and can_fly(NavState.POSCTL, self._health):
            self._tell(events.pilot_took_over())
            self.request_mode(NavState.POSCTL)
        self._choose_mode(now)
        self._report(now.t_us)

    def pass_over(self, t_us: int, period_us: int) -> None:
        """Steps before t_us, a period apart, were left out: their health checks would have found what the last one found."""
        while self._next_health_us <= t_us - period_us:
            self._next_health_us += (t_us - self._next_health_us) % period_us + HEALTH_PERIOD_US

    def quiet_until_us(self, health: Health) -> int:
        """Until then `step` does nothing new while this health and all else stay as they are; 0 where that cannot be said."""
        is_plain = self.armed and self._has_flown and not (self.terminated or self.killed or self._landed)
        reported = self._reported == (self.nav_state, self._health, self.armed, self._landed)
        if not (is_plain and self._failsafe.is_idle and self.nav_state is self.user_mode):
            return 0
        checked_us = _NEVER_US if health == self._health else self._next_health_us
        return checked_us if reported else min(checked_us, self._next_report_us)

    def finish_takeoff(self) -> None:
        """The take-off altitude is reached: PX4 goes on to loiter."""
        if self.user_mode is NavState.AUTO_TAKEOFF:
            self._set_user_mode(NavState.AUTO_LOITER)
            self.nav_state = self.user_mode

    def _changes_at_once(self, health: Health) -> bool:
        gained = health.has_offboard and not self._health.has_offboard
        return self.user_mode is not NavState.OFFBOARD and gained

    def _note_landing(self, now: Conditions) -> None:
        if self.armed and self._landed and not now.landed:
            self._has_flown = True
            self._tell(events.takeoff_detected())
        elif self.armed and not self._landed and now.landed:
            self._tell(events.landing_detected())
        self._landed = now.landed
        if not now.landed:
            self._landed_since_us = None
        elif self._landed_since_us is None:
            self._landed_since_us = now.t_us

    def _auto_disarm(self, now: Conditions) -> None:
        get = self._parameters.get
        if self.terminated:
            return
        if self._has_flown:
            wait_s = get("COM_DISARM_LAND")
            since = self._landed_since_us
            if wait_s > 0.0 and since is not None and now.t_us - since >= wait_s * 1e6:
                self._disarm(events.BY_LANDING)
        else:
            wait_s = get("COM_DISARM_PRFLT")
            if wait_s > 0.0 and now.t_us - self.armed_since_us >= (wait_s + get("COM_SPOOLUP_TIME")) * 1e6:
                self._disarm(events.BY_PREFLIGHT_TIMEOUT)

    def _kill(self, now: Conditions) -> None:
        if now.kill and not self.killed:
            self._killed_since_us = now.t_us
        self.killed = now.kill
        wait_us = self._parameters.get("COM_KILL_DISARM") * 1e6
        if self.killed and self.armed and now.t_us - self._killed_since_us >= wait_us:
            self._disarm(events.BY_KILL)

    def _choose_mode(self, now: Conditions) -> None:
        if self.terminated:
            return
        state = FailsafeState()
        if self.armed:
            seen = FailsafeInput(
                self.user_mode, self._health, now.sticks_lost, now.ground_station_lost, now.battery_warning
            )
            state = self._failsafe.update(seen, now.t_us)
            self._announce(state)
        if state.action is Action.DISARM:
            self._disarm(events.BY_FAILSAFE)
        elif state.action is Action.TERMINATE:
            self._enter_termination()
            return
        self.nav_state = ACTION_MODES.get(state.action, self.user_mode) if self.armed else self.user_mode

    def _announce(self, state: FailsafeState) -> None:
        before, self._announced = self._announced, state
        if state.action <= Action.WARN or (state.action, state.final) == (before.action, before.final):
            return
        custom_mode = MODES[self.user_mode].custom_mode
        if state.is_delayed:
            delay_s = round(self._parameters.get("COM_FAIL_ACT_T"))
            self._tell(events.failsafe_hold(custom_mode, state.final, delay_s, state.cause))
        elif before.is_delayed or state.cause:
            self._tell(events.failsafe_for_cause(custom_mode, state.action, state.cause))
        elif state.action in (Action.DESCEND, Action.ALTITUDE):
            self._tell(events.failsafe_disengaged(custom_mode, Action.ALTITUDE))
        else:
            self._tell(events.failsafe(custom_mode, state.action))

    def _report(self, t_us: int) -> None:
        present = (self.nav_state, self._health, self.armed, self._landed)
        if present == self._reported or t_us < self._next_report_us:
            return
        self._reported = present
        self._next_report_us = t_us + _REPORT_PERIOD_US
        for notice in report(self.nav_state, self._health):
            self._tell(notice)


_HANDLERS: dict[int, Callable[[Commander, Command], Result | None]] = {
    CommandId.COMPONENT_ARM_DISARM: Commander._arm_disarm,
    CommandId.DO_SET_MODE: Commander._set_mode,
    CommandId.NAV_TAKEOFF: Commander._takeoff,
    CommandId.NAV_LAND: Commander._land,
    CommandId.NAV_PRECLAND: Commander._precland,
    CommandId.NAV_RETURN_TO_LAUNCH: Commander._return,
    CommandId.DO_FLIGHTTERMINATION: Commander._terminate,
    CommandId.DO_CHANGE_SPEED: Commander._accept,
    CommandId.DO_SET_HOME: Commander._accept,
}
