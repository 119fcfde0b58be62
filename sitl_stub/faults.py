"""Faults of a scenario: what goes wrong, and when.

A fault is active in windows of `duration_s` that begin at `start_s`, or when the vehicle first comes lower than
`when_below_m` over the pad, or at random with `mean_interval_s` between (seeded). World asks the schedule every 20 ms and
lets `fault_effects` apply what has begun and take back what has ended.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

import numpy as np
from msgspec import Meta

from sitl_stub.section import Fraction, NonNegative, Positive, Section

Direction = Literal["to_vehicle", "from_vehicle", "both"]
MotorNumber = Annotated[int, Meta(ge=1, le=8)]


class _Window(Section, frozen=True):
    """When a fault is active. Without any of the first three it is active from the start."""

    start_s: NonNegative | None = None
    when_below_m: Positive | None = None
    mean_interval_s: Positive | None = None
    duration_s: Positive = math.inf


class DatagramLoss(_Window, frozen=True, tag_field="kind", tag="datagram_loss"):
    """That fraction of datagrams never arrives; 1 cuts the link."""

    fraction: Fraction = 1.0
    direction: Direction = "both"


class DatagramDelay(_Window, frozen=True, tag_field="kind", tag="datagram_delay"):
    """Datagrams arrive late; a jitter larger than their spacing reorders them."""

    delay_s: NonNegative = 0.1
    jitter_s: NonNegative = 0.0
    direction: Direction = "both"


class DatagramReorder(_Window, frozen=True, tag_field="kind", tag="datagram_reorder"):
    """That fraction is held back until `hold_s` later, so that others overtake it."""

    fraction: Fraction = 0.1
    hold_s: Positive = 0.03
    direction: Direction = "both"


class DatagramDuplicate(_Window, frozen=True, tag_field="kind", tag="datagram_duplicate"):
    """That fraction arrives twice."""

    fraction: Fraction = 0.1
    direction: Direction = "both"


class DatagramCorruption(_Window, frozen=True, tag_field="kind", tag="datagram_corruption"):
    """In that fraction one byte is wrong."""

    fraction: Fraction = 0.01
    direction: Direction = "both"


class CameraFreeze(_Window, frozen=True, tag_field="kind", tag="camera_freeze"):
    """The camera goes on handing out its last picture with new times. `camera` absent: all."""

    camera: str | None = None


class CameraStop(_Window, frozen=True, tag_field="kind", tag="camera_stop"):
    """No frames at all."""

    camera: str | None = None


class CameraBlackout(_Window, frozen=True, tag_field="kind", tag="camera_blackout"):
    """Black pictures."""

    camera: str | None = None


class MarkerCovered(_Window, frozen=True, tag_field="kind", tag="marker_covered"):
    """A sheet over the markers: the deck is there, the markers are not. `ids` empty: all."""

    ids: tuple[int, ...] = ()


class BeaconLost(_Window, frozen=True, tag_field="kind", tag="beacon_lost"):
    """The pad's second MAVLink system is silent."""


class BeaconJump(_Window, frozen=True, tag_field="kind", tag="beacon_jump"):
    """The beacon's position is off by this much."""

    north_m: float = 0.0
    east_m: float = 0.0


class RangeStuck(_Window, frozen=True, tag_field="kind", tag="range_stuck"):
    """The range sensor repeats its last value."""


class RangeLost(_Window, frozen=True, tag_field="kind", tag="range_lost"):
    """The range sensor gives nothing."""


class MotorWeak(_Window, frozen=True, tag_field="kind", tag="motor_weak"):
    """One motor gives only that part of its thrust."""

    motor: MotorNumber = 1
    efficiency: Fraction = 0.8


class GpsLoss(_Window, frozen=True, tag_field="kind", tag="gps_loss"):
    """The vehicle's GNSS gives nothing; the autopilot goes on by dead reckoning."""


class GpsJump(_Window, frozen=True, tag_field="kind", tag="gps_jump"):
    """The vehicle's estimate of its position is off by this much while the fault lasts."""

    north_m: float = 0.0
    east_m: float = 0.0


class EstimatorReset(_Window, frozen=True, tag_field="kind", tag="estimator_reset"):
    """The estimate jumps at once and the reset counters count; it stays where it is when the fault ends."""

    north_m: float = 0.0
    east_m: float = 0.0
    down_m: float = 0.0
    yaw_deg: float = 0.0


class BatteryLow(_Window, frozen=True, tag_field="kind", tag="battery_low"):
    """The battery shows this remaining charge."""

    remaining: Fraction = 0.1


class PilotInput(_Window, frozen=True, tag_field="kind", tag="pilot_input"):
    """A radio with a pilot: sticks (-1 to 1), and the mode switch if `mode` is given (hold, position, land, return)."""

    mode: str | None = None
    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0
    throttle: float = 0.0
    kill: bool = False


Fault = (
    DatagramLoss
    | DatagramDelay
    | DatagramReorder
    | DatagramDuplicate
    | DatagramCorruption
    | CameraFreeze
    | CameraStop
    | CameraBlackout
    | MarkerCovered
    | BeaconLost
    | BeaconJump
    | RangeStuck
    | RangeLost
    | MotorWeak
    | GpsLoss
    | GpsJump
    | EstimatorReset
    | BatteryLow
    | PilotInput
)

FAULTS: dict[str, type[Section]] = {
    "datagram_loss": DatagramLoss,
    "datagram_delay": DatagramDelay,
    "datagram_reorder": DatagramReorder,
    "datagram_duplicate": DatagramDuplicate,
    "datagram_corruption": DatagramCorruption,
    "camera_freeze": CameraFreeze,
    "camera_stop": CameraStop,
    "camera_blackout": CameraBlackout,
    "marker_covered": MarkerCovered,
    "beacon_lost": BeaconLost,
    "beacon_jump": BeaconJump,
    "range_stuck": RangeStuck,
    "range_lost": RangeLost,
    "motor_weak": MotorWeak,
    "gps_loss": GpsLoss,
    "gps_jump": GpsJump,
    "estimator_reset": EstimatorReset,
    "battery_low": BatteryLow,
    "pilot_input": PilotInput,
}


class FaultWindow:
    """The times of one fault."""

    __slots__ = ("_ends_s", "_rng", "_starts_s", "active", "fault")

    def __init__(self, fault: Fault, rng: np.random.Generator) -> None:
        self.fault = fault
        self.active = False
        self._rng = rng
        self._ends_s = math.inf
        self._starts_s = self._first_start()

    def _first_start(self) -> float:
        f = self.fault
        if f.mean_interval_s is not None:
            return float(self._rng.exponential(f.mean_interval_s))
        if f.when_below_m is not None:
            return math.inf
        return f.start_s or 0.0

    def update(self, t_s: float, height_above_pad_m: float) -> bool:
        """Advance to `t_s`; True where the fault has just begun or ended."""
        if self.active:
            return self._end_if_due(t_s)
        f = self.fault
        if f.when_below_m is not None and self._starts_s == math.inf and height_above_pad_m < f.when_below_m:
            self._starts_s = max(t_s, f.start_s or 0.0)
        if t_s < self._starts_s:
            return False
        self.active = True
        self._ends_s = t_s + f.duration_s
        return True

    def _end_if_due(self, t_s: float) -> bool:
        if t_s < self._ends_s:
            return False
        self.active = False
        again = self.fault.mean_interval_s
        # A fault that came once does not come again: its next start is out of reach.
        self._starts_s = t_s + float(self._rng.exponential(again)) if again is not None else 1e18
        return True


class FaultSchedule:
    """All faults of a scenario."""

    def __init__(self, faults: tuple[Fault, ...], rng: np.random.Generator) -> None:
        self._windows = [FaultWindow(fault, rng) for fault in faults]

    def __bool__(self) -> bool:
        return bool(self._windows)

    def update(self, t_s: float, height_above_pad_m: float) -> list[FaultWindow]:
        """The windows that have opened or closed since the last call."""
        return [window for window in self._windows if window.update(t_s, height_above_pad_m)]

    def active(self) -> list[Fault]:
        """The faults that are active now."""
        return [window.fault for window in self._windows if window.active]
