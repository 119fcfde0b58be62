"""PX4's take-off handling: spool-up with zero thrust, then a ramp of the allowed climb rate, then flight.

The ramp starts at the climb rate that asks for zero thrust (-g / MPC_Z_VEL_P_ACC) and ends after MPC_TKO_RAMP_T at MPC_Z_VEL_MAX_UP: in
OFFBOARD the vehicle leaves the ground 3 s after arming, in AUTO.TAKEOFF, which asks for less, about 1 s later. Called by the autopilot
each control step.
"""

from __future__ import annotations

from enum import IntEnum

from sitl_stub.autopilot.hysteresis import Hysteresis
from sitl_stub.autopilot.parameters import Parameters

_GRAVITY_M_S2 = 9.80665


class TakeoffState(IntEnum):
    """Order matters: everything below RAMP_UP stands on the ground without thrust."""

    DISARMED = 0
    SPOOL_UP = 1
    READY = 2
    RAMP_UP = 3
    FLIGHT = 4


class TakeoffRamp:
    """State of the take-off and the climb rate it allows."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._spool_up = Hysteresis()
        self.state = TakeoffState.DISARMED
        self._progress = 0.0

    def update(self, t_us: int, armed: bool, landed: bool, wants_takeoff: bool, *, skip: bool = False) -> TakeoffState:
        """Advance the state; `wants_takeoff` is the flight task's wish to leave the ground, `skip` goes straight to flight."""
        spool_up_us = self._parameters.get("COM_SPOOLUP_TIME") * 1e6
        spooled_up = self._spool_up.update(armed, spool_up_us, t_us)
        if not armed:
            self.state = TakeoffState.DISARMED
        elif self.state <= TakeoffState.SPOOL_UP:
            self.state = TakeoffState.READY if spooled_up else TakeoffState.SPOOL_UP
        if self.state == TakeoffState.READY and wants_takeoff:
            self.state = TakeoffState.RAMP_UP
            self._progress = 0.0
        elif self.state == TakeoffState.RAMP_UP and self._progress >= 1.0:
            self.state = TakeoffState.FLIGHT
        elif self.state == TakeoffState.FLIGHT and landed:
            self.state = TakeoffState.READY
        if armed and skip:
            self.state = TakeoffState.FLIGHT
        return self.state

    def climb_limit_m_s(self, dt_s: float, climb_max_m_s: float) -> float:
        """Upward speed the position controller may ask for (negative: less than hover thrust)."""
        start_m_s = -_GRAVITY_M_S2 / max(self._parameters.get("MPC_Z_VEL_P_ACC"), 0.01)
        if self.state < TakeoffState.RAMP_UP:
            return start_m_s
        if self.state > TakeoffState.RAMP_UP:
            return climb_max_m_s
        ramp_s = self._parameters.get("MPC_TKO_RAMP_T")
        self._progress += dt_s / ramp_s if ramp_s > dt_s else 1.0
        if self._progress >= 1.0:
            return climb_max_m_s
        return start_m_s + self._progress * (climb_max_m_s - start_m_s)
