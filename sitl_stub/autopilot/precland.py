"""AUTO.PRECLAND: PX4's own precision landing on a LANDING_TARGET in local NED.

Approach at the present height until the target was inside PLD_HACC_RAD on both axes at two samples 2 s apart, then sink over it; the raw
measurement is the position setpoint, without velocity or filter, hence the lag on a moving pad. In the approach it is also drawn through
limits of speed (MPC_XY_CRUISE), acceleration (MPC_ACC_HOR) and braking, 20 times a second: another lag, which grows with the pad's speed. Below
PLD_FAPPR_ALT the last point is kept. No measurement for PLD_BTOUT: climb to PLD_SRCH_ALT and wait PLD_SRCH_TOUT, up to PLD_MAX_SRCH times, then land where it is.
"""

from __future__ import annotations

from enum import Enum, auto
from math import hypot, sqrt

from sitl_stub.autopilot.navigation import NavigationTarget, Situation, TargetKind


class _State(Enum):
    APPROACH = auto()
    DESCEND = auto()
    FINAL = auto()
    SEARCH = auto()
    FALLBACK = auto()


_INSIDE_US = 2_000_000
_ACQUIRED_US = 1_000_000
_STOP_CLIMB_MARGIN_M = 1.0
_SLEW_PERIOD_S = 0.05
"""PX4's navigator runs at 20 Hz."""


class LandingTarget:
    """Last LANDING_TARGET with frame LOCAL_NED and position_valid."""

    def __init__(self) -> None:
        self.x_m = 0.0
        self.y_m = 0.0
        self.z_m = 0.0
        self._t_us: int | None = None

    def receive(self, x_m: float, y_m: float, z_m: float, t_us: int) -> None:
        """A new measurement, local NED."""
        self.x_m, self.y_m, self.z_m, self._t_us = x_m, y_m, z_m, t_us

    def is_fresh(self, t_us: int, timeout_s: float) -> bool:
        return self._t_us is not None and t_us - self._t_us <= timeout_s * 1e6


class SlewedPoint:
    """The approach's setpoint: follows the measurement within limits, so that it could stop there."""

    def __init__(self, x_m: float, y_m: float, vx_m_s: float, vy_m_s: float) -> None:
        self.x_m, self.y_m = x_m, y_m
        self._step_x_m, self._step_y_m = vx_m_s * _SLEW_PERIOD_S, vy_m_s * _SLEW_PERIOD_S

    def advance(self, x_m: float, y_m: float, dt_s: float, speed_max_m_s: float, acceleration_max_m_s2: float) -> None:
        """Go on towards the measurement for dt."""
        braking_m_s = sqrt(acceleration_max_m_s2 * hypot(x_m - self.x_m, y_m - self.y_m))
        step = _shortened((x_m - self.x_m, y_m - self.y_m), speed_max_m_s * dt_s)
        change = (step[0] - self._step_x_m, step[1] - self._step_y_m)
        change = _shortened(change, acceleration_max_m_s2 * dt_s * dt_s)
        step = _shortened((self._step_x_m + change[0], self._step_y_m + change[1]), braking_m_s * dt_s)
        self._step_x_m, self._step_y_m = step
        self.x_m, self.y_m = self.x_m + step[0], self.y_m + step[1]


def _shortened(vector: tuple[float, float], longest: float) -> tuple[float, float]:
    length = hypot(*vector)
    if length <= longest:
        return vector
    return vector[0] * longest / length, vector[1] * longest / length


class Precland:
    """State of the precision landing."""

    done = False

    def __init__(self, target: LandingTarget) -> None:
        self._target = target
        self._state = _State.SEARCH
        self._since_us = 0
        self._searches = 0
        self._hold: NavigationTarget | None = None
        self._slewed = SlewedPoint(0.0, 0.0, 0.0, 0.0)
        self._slewed_us = 0
        self._inside_us: int | None = None
        self._acquired_us: int | None = None

    def enter(self, situation: Situation, previous: NavigationTarget | None) -> None:
        self._searches = 0
        self._begin(_State.APPROACH if self._sees(situation) else _State.SEARCH, situation)

    def update(self, situation: Situation) -> NavigationTarget:
        match self._state:
            case _State.APPROACH:
                self._approach(situation)
            case _State.DESCEND:
                self._descend(situation)
            case _State.SEARCH:
                self._search(situation)
        assert self._hold is not None
        return self._hold

    def _sees(self, situation: Situation) -> bool:
        return self._target.is_fresh(situation.t_us, situation.parameters.get("PLD_BTOUT"))

    def _begin(self, state: _State, situation: Situation) -> None:
        if state is _State.SEARCH:
            self._searches += 1
            if self._searches > situation.parameters.get("PLD_MAX_SRCH"):
                state = _State.FALLBACK
        self._state = state
        self._since_us = situation.t_us
        self._inside_us = None
        self._acquired_us = None
        self._hold = self._first_target(state, situation)

    def _first_target(self, state: _State, situation: Situation) -> NavigationTarget:
        x, y, z = situation.position_ned_m
        if state is _State.APPROACH:
            vx, vy, _ = situation.velocity_ned_m_s
            self._slewed, self._slewed_us = SlewedPoint(x, y, vx, vy), situation.t_us
            return NavigationTarget(TargetKind.POSITION, x, y, z)
        if state is _State.SEARCH:
            search_z = situation.home_ned_m[2] - situation.parameters.get("PLD_SRCH_ALT")
            stop = situation.stop_point()
            return NavigationTarget(TargetKind.POSITION, stop.x_m, stop.y_m, search_z)
        if state is _State.FALLBACK:
            return NavigationTarget(TargetKind.LAND, x, y, z)
        return NavigationTarget(TargetKind.LAND, self._target.x_m, self._target.y_m, z)

    def _approach(self, situation: Situation) -> None:
        if not self._sees(situation):
            self._begin(_State.SEARCH, situation)
            return
        self._slew(situation)
        if self._is_inside(situation):
            if self._inside_us is None:
                self._inside_us = situation.t_us
            if situation.t_us - self._inside_us >= _INSIDE_US:
                self._begin(_State.DESCEND, situation)

    def _slew(self, situation: Situation) -> None:
        since_s = (situation.t_us - self._slewed_us) * 1e-6
        if since_s < _SLEW_PERIOD_S:
            return
        get = situation.parameters.get
        self._slewed_us = situation.t_us
        self._slewed.advance(self._target.x_m, self._target.y_m, since_s, get("MPC_XY_CRUISE"), get("MPC_ACC_HOR"))
        assert self._hold is not None
        self._hold = NavigationTarget(TargetKind.POSITION, self._slewed.x_m, self._slewed.y_m, self._hold.z_m)

    def _is_inside(self, situation: Situation) -> bool:
        radius = situation.parameters.get("PLD_HACC_RAD")
        x, y, _ = situation.position_ned_m
        return abs(self._target.x_m - x) < radius and abs(self._target.y_m - y) < radius

    def _descend(self, situation: Situation) -> None:
        if self._height_m(situation) < situation.parameters.get("PLD_FAPPR_ALT"):
            self._begin(_State.FINAL, situation)
            return
        if not self._sees(situation):
            self._begin(_State.SEARCH, situation)
            return
        self._hold = NavigationTarget(TargetKind.LAND, self._target.x_m, self._target.y_m, situation.position_ned_m[2])

    def _height_m(self, situation: Situation) -> float:
        if situation.height_above_ground_m is not None:
            return situation.height_above_ground_m
        return self._target.z_m - situation.position_ned_m[2]

    def _search(self, situation: Situation) -> None:
        if self._sees(situation) and self._acquired_us is None:
            self._acquired_us = situation.t_us
            assert self._hold is not None
            stop_z = max(self._hold.z_m, situation.position_ned_m[2] - _STOP_CLIMB_MARGIN_M)
            self._hold = NavigationTarget(TargetKind.POSITION, self._hold.x_m, self._hold.y_m, stop_z)
        if self._acquired_us is not None and situation.t_us - self._acquired_us > _ACQUIRED_US:
            self._begin(_State.APPROACH if self._sees(situation) else _State.SEARCH, situation)
        elif situation.t_us - self._since_us > situation.parameters.get("PLD_SRCH_TOUT") * 1e6:
            self._begin(_State.FALLBACK, situation)
