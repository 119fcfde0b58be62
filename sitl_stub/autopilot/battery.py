"""PX4's simulated battery: drains while armed from 100 % to SIM_BAT_MIN_PCT, is full again after disarming.

A scenario may set the charge itself to fly PX4's low-battery actions. Called by the autopilot; shown in SYS_STATUS and BATTERY_STATUS.
"""

from __future__ import annotations

from sitl_stub.autopilot.parameters import Parameters

_FULL_CELL_V = 4.05
_EMPTY_CELL_V = 3.6
_CELLS = 4


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
    def charge(self) -> float:
        if self._forced is not None:
            return self._forced
        drain_s = self._parameters.get("SIM_BAT_DRAIN")
        floor = self._parameters.get("SIM_BAT_MIN_PCT") / 100.0
        if drain_s <= 0.0:
            return 1.0
        return max(1.0 - self._armed_us * 1e-6 / drain_s, floor)

    @property
    def voltage_v(self) -> float:
        return _CELLS * (_EMPTY_CELL_V + (_FULL_CELL_V - _EMPTY_CELL_V) * self.charge)

    def warning(self) -> str | None:
        """PX4's warning level: low, critical, emergency or None."""
        charge = self.charge
        for level, name in (("EMERGEN", "emergency"), ("CRIT", "critical"), ("LOW", "low")):
            if charge < self._parameters.get(f"BAT_{level}_THR"):
                return name
        return None
