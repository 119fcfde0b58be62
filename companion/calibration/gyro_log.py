"""Body rates out of a telemetry log, on the clock of the frames they are compared with.

ATTITUDE and ODOMETRY carry them with the autopilot's boot time. Frames on another clock are met through the log's own stamps:
the message that travelled fastest says how far the two clocks are apart, to within the shortest transport delay (a millisecond
or so on a wire). PX4 sends its rates behind a low pass of second order (IMU_GYRO_CUTOFF), which delays what it lets through: the
record's times are those at which the vehicle turned so, not those at which the filter said it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from companion.io.cameras.frame import CaptureClock
from companion.io.tlog_columns import MessageColumns, TlogColumns

Array = npt.NDArray[np.float64]
BOOT_US: dict[str, tuple[str, float]] = {
    "ODOMETRY": ("time_usec", 1.0),
    "ATTITUDE": ("time_boot_ms", 1000.0),
    "ATTITUDE_QUATERNION": ("time_boot_ms", 1000.0),
}
"""Messages with body rates, and where their time stands, in microseconds times this."""

GYRO_CUTOFF_HZ = 40.0
"""PX4's default of IMU_GYRO_CUTOFF."""
RATES = ("rollspeed", "pitchspeed", "yawspeed")


@dataclass(frozen=True, slots=True, eq=False)
class GyroRecord:
    """(M,) seconds, rising, and (M, 3) rad/s about B's axes."""

    t_s: Array
    rates_rad_s: Array
    message: str


def filter_lag_s(cutoff_hz: float) -> float:
    """Group delay of a Butterworth low pass of second order, well below its cutoff; 0 Hz stands for no filter."""
    return math.sqrt(2.0) / (2.0 * math.pi * cutoff_hz) if cutoff_hz > 0.0 else 0.0


def gyro_record(
    log: TlogColumns, clock: CaptureClock, system: int = 1, *, cutoff_hz: float = GYRO_CUTOFF_HZ
) -> GyroRecord:
    """The message with the most samples. ValueError where the log has none, or the frames' clock is not in it."""
    if clock is CaptureClock.MEDIA:
        raise ValueError(
            "the frames' times are a clock of their own; a delay needs times in capture_boot_us or t_unix_ns"
        )
    lag_s = filter_lag_s(cutoff_hz)
    found = [_record(log[name], name, clock, system, lag_s) for name in BOOT_US if name in log]
    usable = [record for record in found if len(record.t_s) >= 2]
    if not usable:
        raise ValueError(f"the log has no body rates of system {system}: none of {', '.join(BOOT_US)}")
    return max(usable, key=lambda record: len(record.t_s))


def _record(columns: MessageColumns, name: str, clock: CaptureClock, system: int, lag_s: float) -> GyroRecord:
    key, to_us = BOOT_US[name]
    own = columns.system == system
    boot_us = columns[key][own].astype(np.float64) * to_us
    rates = np.stack([columns[axis][own].astype(np.float64) for axis in RATES], axis=1)
    if not len(boot_us):
        return GyroRecord(boot_us, rates, name)
    offset_us = 0.0 if clock is CaptureClock.AUTOPILOT else float(np.min(columns.t_us[own] - boot_us))
    t_s = (boot_us + offset_us) / 1e6 - lag_s
    order = np.unique(t_s, return_index=True)[1]
    usable = order[np.isfinite(rates[order]).all(axis=1)]
    return GyroRecord(t_s[usable], rates[usable], name)
