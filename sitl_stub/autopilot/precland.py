"""AUTO.PRECLAND: PX4's own precision landing on a LANDING_TARGET in local NED.

Start: stay, and search after 2 s without a target. Approach at the present height until the target was inside PLD_HACC_RAD on both axes at two
samples 2 s apart, then sink over it; the raw measurement is the position setpoint, without velocity or filter, hence the lag on a moving pad.
In the approach it is also drawn through limits of speed (MPC_XY_CRUISE), acceleration (MPC_ACC_HOR) and braking: another lag, which grows
with the pad's speed. A target out of sight is believed for PLD_BTOUT; in the approach the vehicle flies to where it was last seen however
long that takes. Then it starts again from where it is, at most PLD_MAX_SRCH times, and lands there after that. Searching is climbing to
PLD_SRCH_ALT and waiting PLD_SRCH_TOUT. Below PLD_FAPPR_ALT a target not seen for 0.5 s is landed on where it was. All at 20 Hz, as PX4's navigator.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from enum import Enum, auto
from math import hypot, sqrt

from sitl_stub.autopilot.navigation import NavigationTarget, Situation, TargetKind


class PreclandState(Enum):
    """PX4's states, by its names."""

    START = auto()
    HORIZONTAL_APPROACH = auto()
    DESCEND_ABOVE_TARGET = auto()
    FINAL_APPROACH = auto()
    SEARCH = auto()
    FALLBACK = auto()


_PERIOD_US = 50_000
_PERIOD_S = 0.05
_SEARCH_AFTER_US = 2_000_000
_INSIDE_US = 2_000_000
_ACQUIRED_US = 1_000_000
_UNSEEN_NEAR_GROUND_US = 500_000
_STOP_CLIMB_MARGIN_M = 1.0


class LandingTarget:
    """Last LANDING_TARGET with frame LOCAL_NED and position_valid."""

    def __init__(self) -> None:
        self.x_m = 0.0
        self.y_m = 0.0
        self.z_m = 0.0
        self.t_us: int | None = None
        """When it came; None before the first one."""

    def receive(self, x_m: float, y_m: float, z_m: float, t_us: int) -> None:
        """A new measurement, local NED."""
        self.x_m, self.y_m, self.z_m, self.t_us = x_m, y_m, z_m, t_us


class SlewedPoint:
    """The approach's setpoint: follows the measurement within limits, so that it could stop there."""

    def __init__(self, x_m: float, y_m: float, vx_m_s: float, vy_m_s: float) -> None:
        self.x_m, self.y_m = x_m, y_m
        self._step_x_m, self._step_y_m = vx_m_s * _PERIOD_S, vy_m_s * _PERIOD_S

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
        self.state = PreclandState.START
        self._starts = 0
        self._due_us = self._since_us = 0
        self._seen_us: int | None = None
        self._is_new = False
        self._reached_us: int | None = None
        self._acquired_us: int | None = None
        self._slewed: SlewedPoint | None = None
        self._slewed_us = 0

    def enter(self, situation: Situation, previous: NavigationTarget | None) -> None:
        self._starts = 0
        self._slewed = None
        self._due_us = situation.t_us
        self._hold = _here(situation) if previous is None else replace(previous, kind=TargetKind.POSITION)
        self._start(situation)

    def update(self, situation: Situation) -> NavigationTarget:
        if situation.t_us >= self._due_us:
            self._due_us = situation.t_us + _PERIOD_US
            self._is_new, self._seen_us = self._target.t_us != self._seen_us, self._target.t_us
            if not situation.landed:
                _RUN[self.state](self, situation)
        return self._hold

    # States ---------------------------------------------------------------------------------------------------------

    def _run_start(self, situation: Situation) -> None:
        if self._approach(situation):
            return
        if _distance_m(self._hold, situation) < situation.parameters.get("NAV_ACC_RAD"):
            if self._reached_us is None:
                self._reached_us = situation.t_us
            if situation.parameters.get("PLD_SRCH_TOUT") <= 0.0:
                self._fall_back(situation)
            elif situation.t_us - self._reached_us > _SEARCH_AFTER_US:
                self._search(situation)

    def _run_approach(self, situation: Situation) -> None:
        if self._is_inside(situation) and not self._is_valid(situation):
            self._start_again(situation)
            return
        if self._is_new and self._is_inside(situation):
            if self._reached_us is None:
                self._reached_us = situation.t_us
            if situation.t_us - self._reached_us > _INSIDE_US:
                self._change(PreclandState.DESCEND_ABOVE_TARGET, situation)
                return
        x, y = self._slew(situation)
        self._hold = replace(self._hold, kind=TargetKind.POSITION, x_m=x, y_m=y)

    def _run_descent(self, situation: Situation) -> None:
        if not self._keeps_descending(situation):
            if self._is_low(situation):
                self._change(PreclandState.FINAL_APPROACH, situation)
            else:
                self._start_again(situation)
            return
        self._hold = NavigationTarget(TargetKind.LAND, self._target.x_m, self._target.y_m, self._hold.z_m)

    def _run_search(self, situation: Situation) -> None:
        if self._is_new and self._is_valid(situation) and self._acquired_us is None:
            self._acquired_us = situation.t_us
            z = max(self._hold.z_m, situation.position_ned_m[2] - _STOP_CLIMB_MARGIN_M)
            self._hold = replace(self._hold, z_m=z)
        has_settled = self._acquired_us is not None and situation.t_us - self._acquired_us > _ACQUIRED_US
        if has_settled and self._approach(situation):
            return
        if situation.t_us - self._since_us > situation.parameters.get("PLD_SRCH_TOUT") * 1e6:
            self._fall_back(situation)

    def _run_landing(self, situation: Situation) -> None:
        """Nothing to decide any more."""

    # Changes --------------------------------------------------------------------------------------------------------

    def _change(self, state: PreclandState, situation: Situation) -> None:
        self.state, self._since_us = state, situation.t_us

    def _start(self, situation: Situation) -> None:
        self._starts += 1
        self._reached_us = None
        self._change(PreclandState.START, situation)

    def _start_again(self, situation: Situation) -> None:
        """The target is lost: stay here and wait for it, or land when that has happened too often."""
        self._hold = _here(situation)
        if self._starts <= situation.parameters.get("PLD_MAX_SRCH"):
            self._start(situation)
        else:
            self._fall_back(situation)

    def _approach(self, situation: Situation) -> bool:
        if not (self._is_new and self._is_valid(situation)):
            return False
        self._hold = replace(self._hold, z_m=situation.position_ned_m[2])
        self._reached_us = None
        self._change(PreclandState.HORIZONTAL_APPROACH, situation)
        return True

    def _search(self, situation: Situation) -> None:
        self._hold = replace(self._hold, z_m=-situation.parameters.get("PLD_SRCH_ALT"))
        self._acquired_us = None
        self._change(PreclandState.SEARCH, situation)

    def _fall_back(self, situation: Situation) -> None:
        self._hold = replace(_here(situation), kind=TargetKind.LAND)
        self._change(PreclandState.FALLBACK, situation)

    # Conditions -----------------------------------------------------------------------------------------------------

    def _is_younger(self, situation: Situation, age_us: float) -> bool:
        return self._seen_us is not None and situation.t_us - self._seen_us <= age_us

    def _is_valid(self, situation: Situation) -> bool:
        return self._is_younger(situation, situation.parameters.get("PLD_BTOUT") * 1e6)

    def _is_inside(self, situation: Situation) -> bool:
        radius = situation.parameters.get("PLD_HACC_RAD")
        x, y, _ = situation.position_ned_m
        return abs(self._target.x_m - x) < radius and abs(self._target.y_m - y) < radius

    def _is_low(self, situation: Situation) -> bool:
        height_m = self._target.z_m - situation.position_ned_m[2]
        return self._is_valid(situation) and height_m < situation.parameters.get("PLD_FAPPR_ALT")

    def _keeps_descending(self, situation: Situation) -> bool:
        if self._is_low(situation):
            return self._is_younger(situation, _UNSEEN_NEAR_GROUND_US)
        return self._is_valid(situation)

    def _slew(self, situation: Situation) -> tuple[float, float]:
        """The measurement within the limits; they are remembered from one approach to the next, as PX4 does."""
        get, dt_s = situation.parameters.get, (situation.t_us - self._slewed_us) * 1e-6
        if self._slewed is None:
            vx, vy, _ = situation.velocity_ned_m_s
            self._slewed, dt_s = SlewedPoint(self._hold.x_m, self._hold.y_m, vx, vy), _PERIOD_S
        self._slewed_us = situation.t_us
        self._slewed.advance(self._target.x_m, self._target.y_m, dt_s, get("MPC_XY_CRUISE"), get("MPC_ACC_HOR"))
        return self._slewed.x_m, self._slewed.y_m


def _here(situation: Situation) -> NavigationTarget:
    return NavigationTarget(TargetKind.POSITION, *situation.position_ned_m)


def _distance_m(target: NavigationTarget, situation: Situation) -> float:
    x, y, _ = situation.position_ned_m
    return hypot(target.x_m - x, target.y_m - y)


_RUN: dict[PreclandState, Callable[[Precland, Situation], None]] = {
    PreclandState.START: Precland._run_start,
    PreclandState.HORIZONTAL_APPROACH: Precland._run_approach,
    PreclandState.DESCEND_ABOVE_TARGET: Precland._run_descent,
    PreclandState.FINAL_APPROACH: Precland._run_landing,
    PreclandState.SEARCH: Precland._run_search,
    PreclandState.FALLBACK: Precland._run_landing,
}
