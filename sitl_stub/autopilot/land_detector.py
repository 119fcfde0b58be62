"""PX4's multicopter land detector: ground contact, maybe landed, landed, each after a third of LNDMC_TRIG_TIME.

It looks at absolute motion: a deck that moves faster than LNDMC_XY_VEL_MAX, or heaves, never counts as ground. Ground contact needs
low thrust, a commanded descent (vz setpoint >= 1.1 LNDMC_Z_VEL_MAX) and no vertical movement, by the velocity or by the derivative of
height; thrust falls by the integrator, so a slow descent takes long to be noticed. Maybe landed needs thrust near the minimum and no
rotation. Each stage takes three times as long where there is a range sensor that sees nothing (PX4's own in simulation, on the ground).
While disarmed all is "landed", whatever moves. NED, metres, radians; called by the autopilot at each decision.
"""

from __future__ import annotations

from math import hypot, radians
from typing import NamedTuple

from sitl_stub.autopilot.hysteresis import Hysteresis
from sitl_stub.autopilot.parameters import Parameters
from sitl_stub.compiled import used_by_kernels

_LOW_THRUST_FRACTION = 0.3
_LOW_THRUST_FRACTION_OF_KNOWN_HOVER = 0.6
_MINIMUM_THRUST_FRACTION = 0.1
_MANUAL_THRUST_MARGIN = 0.01
_HOVER_MAX = 0.9
_DESCENT_FACTOR = 1.1
_LANDED_THRESHOLD_FACTOR = 2.5
CLOSE_TO_GROUND_M = 1.0
_STAGES = 3
_WITHOUT_RANGE_SLOWER = 3


@used_by_kernels
def follow_hover(hover: float, knows_hover: bool, value: float, is_valid: bool, descends: bool) -> tuple[float, bool]:
    """The hover thrust to go by: an estimate that was valid when the descent began stays in use."""
    if is_valid:
        return value, True
    return hover, knows_hover and descends


class LandDetectorInput(NamedTuple):
    """What the detector sees, all of it estimate or setpoint, never truth."""

    velocity_ned_m_s: tuple[float, float, float]
    angular_rate_xy_rad_s: tuple[float, float]
    descent_setpoint_m_s: float | None
    thrust_command: float
    height_above_ground_m: float | None
    has_horizontal_velocity: bool = True
    height_rate_m_s: float | None = None
    """Derivative of the height's estimate, downwards; None takes the velocity's."""
    hover_thrust: float | None = None
    """The hover thrust estimate while it is valid."""
    controls_climb: bool = True
    """The mode commands a vertical motion, not a thrust."""


class LandDetector:
    """State of the detector; `landed` is what EXTENDED_SYS_STATE calls ON_GROUND."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._contact = Hysteresis()
        self._maybe = Hysteresis()
        self._landed = Hysteresis()
        for stage in (self._contact, self._maybe, self._landed):
            stage.reset(True)
        self._has_range_sensor = False
        self._knows_hover = False
        self._hover = parameters.get("MPC_THR_HOVER")
        self.refresh()

    def refresh(self) -> None:
        """Read the parameters again."""
        get = self._parameters.get
        self._trigger_us = get("LNDMC_TRIG_TIME") * 1e6 / _STAGES
        self._vz_max_m_s = get("LNDMC_Z_VEL_MAX")
        self._descent_m_s = _DESCENT_FACTOR * self._vz_max_m_s
        self._vxy_max_m_s = get("LNDMC_XY_VEL_MAX")
        self._rotation_max_rad_s = radians(get("LNDMC_ROT_MAX"))
        self._thrust_min, self._manual_thrust_min = get("MPC_THR_MIN"), get("MPC_MANTHR_MIN")

    @property
    def landed(self) -> bool:
        return self._landed.state

    @property
    def ground_contact(self) -> bool:
        return self._contact.state

    @property
    def maybe_landed(self) -> bool:
        return self._maybe.state

    def contact_limits(self) -> tuple[float, float, float]:
        """Thrust, vertical and horizontal speed (m/s) above which nothing is ground contact, whatever the hover thrust."""
        get = self._parameters.get
        hover = min(get("MPC_THR_HOVER") + get("HTE_THR_RANGE"), _HOVER_MAX)
        low_thrust = self._thrust_min + (hover - self._thrust_min) * _LOW_THRUST_FRACTION_OF_KNOWN_HOVER
        return low_thrust, self._vz_max_m_s, self._vxy_max_m_s

    @property
    def hover(self) -> tuple[float, bool]:
        """The hover thrust it goes by, and whether that is known."""
        return self._hover, self._knows_hover

    def take_hover(self, hover: float, knows_hover: bool) -> None:
        """As if it had followed the estimate until then (`follow_hover`)."""
        self._hover, self._knows_hover = hover, knows_hover

    def is_idle(self, t_us: int) -> bool:
        """Sees nothing like a landing."""
        return not (self._contact.state or self._maybe.state or self._landed.state or self._contact.is_pending)

    def descends(self, setpoint_m_s: float | None) -> bool:
        """The setpoint is a commanded descent."""
        return setpoint_m_s is not None and setpoint_m_s >= self._descent_m_s

    def begin_in_air(self, t_us: int) -> None:
        """Start of a scenario in flight."""
        for stage in (self._contact, self._maybe, self._landed):
            stage.reset(False)

    def update(self, t_us: int, armed: bool, seen: LandDetectorInput) -> bool:
        """Advance to t_us; True while landed."""
        if not armed:
            for stage in (self._contact, self._maybe, self._landed):
                stage.reset(True)
            return True
        sees_ground = seen.height_above_ground_m is not None
        self._has_range_sensor = self._has_range_sensor or sees_ground
        delay_us = self._trigger_us * (_WITHOUT_RANGE_SLOWER if self._has_range_sensor and not sees_ground else 1)
        self._follow_hover_thrust(seen)
        contact = self._contact.update(self._has_ground_contact(seen), delay_us, t_us)
        maybe = self._maybe.update(contact and self._is_maybe_landed(seen), delay_us, t_us)
        return self._landed.update(maybe, delay_us, t_us)

    def _follow_hover_thrust(self, seen: LandDetectorInput) -> None:
        is_valid = seen.hover_thrust is not None
        value = self._hover if seen.hover_thrust is None else seen.hover_thrust
        descends = self.descends(seen.descent_setpoint_m_s)
        self._hover, self._knows_hover = follow_hover(self._hover, self._knows_hover, value, is_valid, descends)

    @property
    def _threshold_factor(self) -> float:
        return _LANDED_THRESHOLD_FACTOR if self._landed.state else 1.0

    def _has_ground_contact(self, seen: LandDetectorInput) -> bool:
        fraction = _LOW_THRUST_FRACTION_OF_KNOWN_HOVER if self._knows_hover else _LOW_THRUST_FRACTION
        if seen.thrust_command > self._thrust_min + (self._hover - self._thrust_min) * fraction:
            return False
        # A descent must be commanded until the vehicle may have landed.
        must_descend = seen.controls_climb and not (self._maybe.state or self._landed.state)
        if must_descend and not self.descends(seen.descent_setpoint_m_s):
            return False
        height_m = seen.height_above_ground_m
        near = height_m is None or height_m < CLOSE_TO_GROUND_M
        return near and not self._moves_sideways(seen) and not self._moves_vertically(seen)

    def _moves_sideways(self, seen: LandDetectorInput) -> bool:
        return seen.has_horizontal_velocity and hypot(*seen.velocity_ned_m_s[:2]) > self._vxy_max_m_s

    def _moves_vertically(self, seen: LandDetectorInput) -> bool:
        limit_m_s = self._vz_max_m_s * self._threshold_factor
        vz = seen.velocity_ned_m_s[2]
        height_rate = vz if seen.height_rate_m_s is None else seen.height_rate_m_s
        return abs(vz) > limit_m_s and abs(height_rate) > limit_m_s

    def _is_maybe_landed(self, seen: LandDetectorInput) -> bool:
        p, q = seen.angular_rate_xy_rad_s
        least = self._thrust_min + (self._hover - self._thrust_min) * _MINIMUM_THRUST_FRACTION
        if not seen.controls_climb:
            least = self._manual_thrust_min + _MANUAL_THRUST_MARGIN
        return seen.thrust_command <= least and hypot(p, q) <= self._rotation_max_rad_s * self._threshold_factor
