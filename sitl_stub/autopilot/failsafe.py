"""PX4's failsafe: which action a lost signal, position or battery calls for, and the delay before it.

The user's intention is not touched: when the cause is gone (one setpoint is enough) the vehicle goes back to the mode the user chose.
Loss of the ground station or the sticks in an automatic mode holds for COM_FAIL_ACT_T first. A user who commands another mode during a
delayable failsafe has overridden that cause until it clears.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from sitl_stub.autopilot.arming import Health
from sitl_stub.autopilot.modes import MODES, NavState
from sitl_stub.autopilot.parameters import Parameters


class Action(IntEnum):
    """PX4's failsafe action; the numbers appear in events. A greater number wins."""

    NONE = 0
    WARN = 1
    POSITION = 2
    ALTITUDE = 3
    STABILIZE = 4
    HOLD = 5
    RETURN = 6
    LAND = 7
    DESCEND = 8
    DISARM = 9
    TERMINATE = 10


class Cause(IntEnum):
    """PX4's failsafe cause; the numbers appear in events."""

    GENERIC = 0
    MANUAL_CONTROL_LOST = 1
    GROUND_STATION_LOST = 2
    BATTERY_LOW = 3
    BATTERY_CRITICAL = 4
    BATTERY_EMERGENCY = 5


ACTION_MODES = {
    Action.POSITION: NavState.POSCTL,
    Action.ALTITUDE: NavState.ALTCTL,
    Action.STABILIZE: NavState.STABILIZED,
    Action.HOLD: NavState.AUTO_LOITER,
    Action.RETURN: NavState.AUTO_RTL,
    Action.LAND: NavState.AUTO_LAND,
    Action.DESCEND: NavState.DESCEND,
    Action.TERMINATE: NavState.TERMINATION,
}

_OFFBOARD_LOSS = {
    0: Action.POSITION,
    1: Action.ALTITUDE,
    2: Action.STABILIZE,
    3: Action.RETURN,
    4: Action.LAND,
    5: Action.HOLD,
    6: Action.TERMINATE,
    7: Action.DISARM,
}
_LINK_LOSS = {
    0: Action.NONE,
    1: Action.HOLD,
    2: Action.RETURN,
    3: Action.LAND,
    5: Action.TERMINATE,
    6: Action.DISARM,
}
_RCL_EXCEPT_BITS = {NavState.AUTO_MISSION: 1, NavState.AUTO_LOITER: 2, NavState.OFFBOARD: 4}


@dataclass(frozen=True, slots=True)
class FailsafeInput:
    """What the failsafe looks at."""

    user_mode: NavState
    health: Health
    sticks_lost: bool
    ground_station_lost: bool
    battery_warning: str | None


@dataclass(frozen=True, slots=True)
class FailsafeState:
    """Action to fly now; `final` is what a hold is the delay of."""

    action: Action = Action.NONE
    cause: Cause = Cause.GENERIC
    final: Action = Action.NONE

    @property
    def is_delayed(self) -> bool:
        return self.action is Action.HOLD and self.final > Action.HOLD


_NOTHING = FailsafeState()


class Failsafe:
    """Remembers when each delayable cause began and what the user has overridden."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._began_us: dict[Cause, int] = {}
        self._overridden: set[Cause] = set()
        self.state = _NOTHING

    @property
    def is_idle(self) -> bool:
        """No cause is present and nothing is done."""
        return self.state.action is Action.NONE and not self._began_us

    def reset(self) -> None:
        """Forget everything (on disarming)."""
        self._began_us.clear()
        self._overridden.clear()
        self.state = _NOTHING

    def override(self) -> None:
        """The user commanded a mode: the present causes no longer count until they clear."""
        self._overridden |= set(self._began_us)

    def update(self, seen: FailsafeInput, t_us: int) -> FailsafeState:
        """Action for this moment."""
        candidates = [self._mode_action(seen), *self._delayed_actions(seen, t_us)]
        self.state = max(candidates, key=lambda candidate: candidate.action)
        return self.state

    def _mode_action(self, seen: FailsafeInput) -> FailsafeState:
        mode, health = MODES[seen.user_mode], seen.health
        if mode.needs_position and not health.has_position:
            return self._available(Action.ALTITUDE, health)
        if mode.needs_offboard and not health.has_offboard:
            wanted = _OFFBOARD_LOSS.get(self._parameters.get_int("COM_OBL_RC_ACT"), Action.RETURN)
            return self._available(wanted, health)
        if mode.needs_sticks and not health.has_sticks:
            return self._available(self._stick_loss(), health, Cause.MANUAL_CONTROL_LOST)
        return _NOTHING

    def _stick_loss(self) -> Action:
        return _LINK_LOSS.get(self._parameters.get_int("NAV_RCL_ACT"), Action.RETURN)

    def _available(self, wanted: Action, health: Health, cause: Cause = Cause.GENERIC) -> FailsafeState:
        if wanted in (Action.POSITION, Action.ALTITUDE, Action.STABILIZE) and not health.has_sticks:
            wanted = self._stick_loss()
        if wanted in (Action.HOLD, Action.RETURN, Action.LAND) and not health.has_position:
            wanted = Action.DESCEND
        return FailsafeState(wanted, cause, wanted)

    def _delayed_actions(self, seen: FailsafeInput, t_us: int) -> list[FailsafeState]:
        get = self._parameters.get_int
        present: dict[Cause, Action] = {}
        if seen.ground_station_lost:
            present[Cause.GROUND_STATION_LOST] = _LINK_LOSS.get(get("NAV_DLL_ACT"), Action.RETURN)
        excepted = get("COM_RCL_EXCEPT") & _RCL_EXCEPT_BITS.get(seen.user_mode, 0)
        if seen.sticks_lost and not excepted:
            present[Cause.MANUAL_CONTROL_LOST] = self._stick_loss()
        if seen.battery_warning is not None:
            cause, action = self._battery(seen.battery_warning)
            present[cause] = action
        self._forget_cleared(present)
        return [
            self._with_delay(cause, action, seen.health, t_us)
            for cause, action in present.items()
            if action > Action.WARN and cause not in self._overridden
        ]

    def _battery(self, warning: str) -> tuple[Cause, Action]:
        setting = self._parameters.get_int("COM_LOW_BAT_ACT")
        if warning == "emergency" and setting in (2, 3):
            return Cause.BATTERY_EMERGENCY, Action.LAND
        if warning in ("critical", "emergency"):
            return Cause.BATTERY_CRITICAL, {2: Action.LAND, 3: Action.RETURN}.get(setting, Action.WARN)
        return Cause.BATTERY_LOW, Action.WARN

    def _forget_cleared(self, present: dict[Cause, Action]) -> None:
        for cause in [cause for cause in self._began_us if cause not in present]:
            del self._began_us[cause]
            self._overridden.discard(cause)

    def _with_delay(self, cause: Cause, action: Action, health: Health, t_us: int) -> FailsafeState:
        began = self._began_us.setdefault(cause, t_us)
        final = self._available(action, health, cause)
        held = t_us - began < self._parameters.get("COM_FAIL_ACT_T") * 1e6
        if held and Action.HOLD < final.action <= Action.LAND and health.has_position:
            return FailsafeState(Action.HOLD, cause, final.action)
        return final
