"""PX4's simulated battery: drains while armed from 100 % to SIM_BAT_MIN_PCT, is full again after disarming.

A scenario may set the charge itself to fly PX4's low-battery actions. Called by the autopilot; shown in SYS_STATUS and BATTERY_STATUS.
"""

from __future__ import annotations

from math import nan
from typing import NamedTuple

from sitl_stub.autopilot.parameters import Parameters
from sitl_stub.compiled import used_by_kernels

_FULL_CELL_V = 4.05
_EMPTY_CELL_V = 3.6
_CELLS = 4


class Drain(NamedTuple):
    """How the charge falls: time from full to nothing (0: never), the lowest charge, and the one set from outside (NaN: none)."""

    drain_s: float
    floor: float
    forced: float


@used_by_kernels
def charge_after(armed_us: float, drain: Drain) -> float:
    """Charge, 0 to 1, after so long armed."""
    if drain.forced == drain.forced:
        return drain.forced
    return 1.0 if drain.drain_s <= 0.0 else max(1.0 - armed_us * 1e-6 / drain.drain_s, drain.floor)


@used_by_kernels
def voltage_of(charge: float) -> float:
    return _CELLS * (_EMPTY_CELL_V + (_FULL_CELL_V - _EMPTY_CELL_V) * charge)


class Battery:
    """Charge from 0 to 1."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._armed_us = 0
        self._forced: float | None = None

    def step(self, dt_s: float, armed: bool) -> None:
        """Drain or refill."""
        self._armed_us = self._armed_us + round(dt_s * 1e6) if armed else 0

    def force_charge(self, charge: float | None) -> None:
        """Fault of a scenario: the charge to report, or None for PX4's own drain again."""
        self._forced = charge

    @property
    def is_settled(self) -> bool:
        """The warning level cannot change by itself: a charge set from outside, or a drain that ends above the lowest level."""
        get = self._parameters.get
        return (
            self._forced is not None
            or get("SIM_BAT_MIN_PCT") / 100.0 >= get("BAT_LOW_THR")
            or get("SIM_BAT_DRAIN") <= 0.0
        )

    @property
    def drain(self) -> Drain:
        get = self._parameters.get
        forced = nan if self._forced is None else self._forced
        return Drain(get("SIM_BAT_DRAIN"), get("SIM_BAT_MIN_PCT") / 100.0, forced)

    @property
    def armed_us(self) -> int:
        return self._armed_us

    @property
    def charge(self) -> float:
        return charge_after(self._armed_us, self.drain)

    @property
    def voltage_v(self) -> float:
        return voltage_of(self.charge)

    def warning(self) -> str | None:
        """PX4's warning level: low, critical, emergency or None."""
        charge = self.charge
        for level, name in (("EMERGEN", "emergency"), ("CRIT", "critical"), ("LOW", "low")):
            if charge < self._parameters.get(f"BAT_{level}_THR"):
                return name
        return None
