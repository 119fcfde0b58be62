"""PX4's multicopter land detector: ground contact, maybe landed, landed, each after a third of LNDMC_TRIG_TIME.

It looks at absolute motion: a deck that moves faster than LNDMC_XY_VEL_MAX, or heaves, never counts as ground. Ground contact needs low
thrust, or a commanded descent (vz setpoint >= 1.1 LNDMC_Z_VEL_MAX) that brings no vertical movement; maybe landed needs thrust near the
minimum and no rotation. Each stage takes three times as long when a range sensor has ever been valid. While disarmed all is "landed",
whatever moves. NED, metres, radians; called by the commander each step.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, radians

from sitl_stub.autopilot.hysteresis import Hysteresis
from sitl_stub.autopilot.parameters import Parameters

_LOW_THRUST_FRACTION = 0.3
_MINIMUM_THRUST_FRACTION = 0.1
_DESCENT_FACTOR = 1.1
_WIDE_THRESHOLD_FACTOR = 2.5
_WIDE_THRESHOLD_AFTER_LANDING_US = 2_000_000
CLOSE_TO_GROUND_M = 1.0
_STAGES = 3
_RANGE_SENSOR_SLOWER = 3


@dataclass(frozen=True, slots=True)
class LandDetectorInput:
    """What the detector sees, all of it estimate or setpoint, never truth."""

    velocity_ned_m_s: tuple[float, float, float]
    angular_rate_xy_rad_s: tuple[float, float]
    descent_setpoint_m_s: float | None
    thrust_command: float
    height_above_ground_m: float | None
    has_velocity: bool = True


class LandDetector:
    """State of the detector; `landed` is what EXTENDED_SYS_STATE calls ON_GROUND."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._contact = Hysteresis()
        self._maybe = Hysteresis()
        self._landed = Hysteresis()
        for stage in (self._contact, self._maybe, self._landed):
            stage.reset(True)
        self._last_landed_us = 0
        self._has_range_sensor = False
        self.refresh()

    def refresh(self) -> None:
        """Read the parameters again."""
        get = self._parameters.get
        self._trigger_us = get("LNDMC_TRIG_TIME") * 1e6 / _STAGES
        self._vz_max_m_s = min(get("LNDMC_Z_VEL_MAX"), 0.5 * 0.9 * max(get("MPC_LAND_SPEED"), 0.1))
        self._descent_m_s = _DESCENT_FACTOR * get("LNDMC_Z_VEL_MAX")
        self._vxy_max_m_s = get("LNDMC_XY_VEL_MAX")
        self._rotation_max_rad_s = radians(get("LNDMC_ROT_MAX"))
        minimum, hover = get("MPC_THR_MIN"), get("MPC_THR_HOVER")
        self._low_thrust = minimum + (hover - minimum) * _LOW_THRUST_FRACTION
        self._minimum_thrust = minimum + (hover - minimum) * _MINIMUM_THRUST_FRACTION

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
        """Thrust, vertical and horizontal speed (m/s) above which nothing is ground contact, long after the last landing."""
        return self._low_thrust, self._vz_max_m_s, self._vxy_max_m_s

    def is_idle(self, t_us: int) -> bool:
        """Sees nothing like a landing, and has not for so long that its thresholds are the narrow ones."""
        seen = self._contact.state or self._maybe.state or self._landed.state or self._contact.is_pending
        return not seen and t_us - self._last_landed_us >= _WIDE_THRESHOLD_AFTER_LANDING_US

    def descends(self, setpoint_m_s: float | None) -> bool:
        """The setpoint is a commanded descent."""
        return setpoint_m_s is not None and setpoint_m_s >= self._descent_m_s

    def begin_in_air(self, t_us: int) -> None:
        """Start of a scenario in flight."""
        for stage in (self._contact, self._maybe, self._landed):
            stage.reset(False)
        self._last_landed_us = t_us - _WIDE_THRESHOLD_AFTER_LANDING_US

    def update(self, t_us: int, armed: bool, seen: LandDetectorInput) -> bool:
        """Advance to t_us; True while landed."""
        if not armed:
            for stage in (self._contact, self._maybe, self._landed):
                stage.reset(True)
            self._last_landed_us = t_us
            return True
        if seen.height_above_ground_m is not None:
            self._has_range_sensor = True
        delay_us = self._trigger_us * (_RANGE_SENSOR_SLOWER if self._has_range_sensor else 1)
        was_landed = self._landed.state
        contact = self._contact.update(self._has_ground_contact(t_us, seen), delay_us, t_us)
        maybe = self._maybe.update(contact and self._is_maybe_landed(t_us, seen), delay_us, t_us)
        landed = self._landed.update(maybe, delay_us, t_us)
        if landed or was_landed:
            self._last_landed_us = t_us
        return landed

    def _threshold_factor(self, t_us: int) -> float:
        recently = self._landed.state or t_us - self._last_landed_us < _WIDE_THRESHOLD_AFTER_LANDING_US
        return _WIDE_THRESHOLD_FACTOR if recently else 1.0

    def _has_ground_contact(self, t_us: int, seen: LandDetectorInput) -> bool:
        low_thrust = seen.thrust_command <= self._low_thrust
        if not seen.has_velocity:
            return low_thrust
        vx, vy, vz = seen.velocity_ned_m_s
        moves_vertically = abs(vz) > self._vz_max_m_s * self._threshold_factor(t_us)
        moves_sideways = hypot(vx, vy) > self._vxy_max_m_s
        descends = seen.descent_setpoint_m_s is not None and seen.descent_setpoint_m_s >= self._descent_m_s
        near = seen.height_above_ground_m is None or seen.height_above_ground_m < CLOSE_TO_GROUND_M
        return near and (low_thrust or descends) and not moves_sideways and not moves_vertically

    def _is_maybe_landed(self, t_us: int, seen: LandDetectorInput) -> bool:
        p, q = seen.angular_rate_xy_rad_s
        limit_rad_s = self._rotation_max_rad_s * self._threshold_factor(t_us)
        return seen.thrust_command <= self._minimum_thrust and hypot(p, q) <= limit_rad_s
