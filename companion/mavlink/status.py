"""What the autopilot is doing, gathered from five messages into one VehicleStatus.

HEARTBEAT comes once a second and not on change; CURRENT_MODE follows a change within about 20 ms and also says what the
user intended, EXTENDED_SYS_STATE what the land detector believes. An armed vehicle in another mode than intended is in a
failsafe: that shows up to a second before HEARTBEAT's CRITICAL. Armed is only in HEARTBEAT, so an accepted arm or disarm
command counts at once and older heartbeats still under way cannot take it back.
"""

from __future__ import annotations

import dataclasses
import operator
from dataclasses import dataclass

from companion.mavlink.codec import finite
from companion.mavlink.dialect import BatteryStatus, CurrentMode, ExtendedSysState, Heartbeat, HomePosition, SysStatus
from companion.mavlink.modes import mode_from_custom
from companion.messages import AutopilotMode, LandedState, Vec2, Vec3, VehicleStatus

ARMED_FLAG = 0x80
PREARM_CHECK_BIT = 0x10000000
CRITICAL = 5
ARM_ANSWER_HOLD_NS = 200_000_000
_LANDED = (
    LandedState.UNDEFINED,
    LandedState.ON_GROUND,
    LandedState.IN_AIR,
    LandedState.TAKEOFF,
    LandedState.LANDING,
)

_AGE_FIELDS = ("t_ns", "link_age_s")
_BUT_AGE = operator.attrgetter(*(f.name for f in dataclasses.fields(VehicleStatus) if f.name not in _AGE_FIELDS))


@dataclass(slots=True)
class StatusTracker:
    """The latest of everything; `report` makes a VehicleStatus of it."""

    armed: bool = False
    mode: AutopilotMode = AutopilotMode.OTHER
    intended_mode: AutopilotMode | None = None
    landed_state: LandedState = LandedState.UNDEFINED
    system_status: int = 0
    ready_to_arm: bool | None = None
    battery_fraction: float | None = None
    home_position_ned_m: Vec3 | None = None
    home_position_deg: Vec2 | None = None
    mode_heard_ns: int = 0
    _armed_held_until_ns: int = 0
    _battery_is_detailed: bool = False

    def heartbeat(self, message: Heartbeat, now_ns: int) -> None:
        self.mode_heard_ns = now_ns
        mode = mode_from_custom(message.custom_mode)
        if mode is not self.mode:
            self.intended_mode = None  # what was intended before says nothing about this mode
        self.mode = mode
        self.system_status = message.system_status
        if now_ns >= self._armed_held_until_ns:
            self.armed = bool(message.base_mode & ARMED_FLAG)

    def current_mode(self, message: CurrentMode, now_ns: int) -> None:
        self.mode_heard_ns = now_ns
        self.mode = mode_from_custom(message.custom_mode)
        intended = message.intended_custom_mode
        self.intended_mode = mode_from_custom(intended) if intended else None

    def arm_answered(self, *, armed: bool, now_ns: int) -> None:
        """The autopilot has accepted to arm or disarm."""
        self.armed = armed
        self._armed_held_until_ns = now_ns + ARM_ANSWER_HOLD_NS

    def extended_state(self, message: ExtendedSysState) -> None:
        number = message.landed_state
        self.landed_state = _LANDED[number] if number < len(_LANDED) else LandedState.UNDEFINED

    def system_state(self, message: SysStatus) -> None:
        self.ready_to_arm = bool(message.onboard_control_sensors_health & PREARM_CHECK_BIT)
        if not self._battery_is_detailed:
            self.battery_fraction = _fraction(message.battery_remaining)

    def battery(self, message: BatteryStatus) -> None:
        """The first battery speaks for the vehicle."""
        if message.id == 0:
            self._battery_is_detailed = True
            self.battery_fraction = _fraction(message.battery_remaining)

    def home(self, message: HomePosition) -> None:
        """PX4's first HOME_POSITION, before its estimator is ready, is all zero: not a home."""
        position = (message.x, message.y, message.z)
        is_placeholder = position == (0.0, 0.0, 0.0) and not (self.ready_to_arm or self.armed)
        if finite(*position) and not is_placeholder:
            self.home_position_ned_m = position
            self.home_position_deg = (message.latitude * 1e-7, message.longitude * 1e-7)

    @property
    def failsafe(self) -> bool:
        overridden = self.armed and self.intended_mode is not None and self.intended_mode is not self.mode
        return self.system_status >= CRITICAL or overridden

    def report(self, *, connected: bool, link_age_s: float) -> VehicleStatus:
        """`t_ns` is when the mode was last reported, so that its age says how old this knowledge is."""
        return VehicleStatus(
            t_ns=self.mode_heard_ns,
            connected=connected,
            armed=self.armed,
            mode=self.mode,
            intended_mode=self.intended_mode,
            landed_state=self.landed_state,
            failsafe=self.failsafe,
            ready_to_arm=self.ready_to_arm,
            battery_fraction=self.battery_fraction,
            home_position_ned_m=self.home_position_ned_m,
            link_age_s=link_age_s,
            home_position_deg=self.home_position_deg,
        )


def same_but_for_age(a: VehicleStatus, b: VehicleStatus) -> bool:
    """True where only time has passed between the two. Asked with every datagram, so without making anything."""
    return bool(_BUT_AGE(a) == _BUT_AGE(b))


def _fraction(percent: int) -> float | None:
    """-1 is MAVLink's unknown."""
    return percent / 100.0 if 0 <= percent <= 100 else None
