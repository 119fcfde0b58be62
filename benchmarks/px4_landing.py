"""Recorded take-offs and landings of a real PX4, flown again by the simulator's whole autopilot over SIH's flat ground.

The command is in the file's name: `offland_0.5_rng` (OFFBOARD, sinking 0.5 m/s through touchdown, with range sensor), `autoland_norng`,
`takeoff_offboard_vel_-1`, `takeoff_offboard_pos_-5`, `takeoff_auto`, `takeoff_arm_first`, `gps_loss_offboard`, `land_auto_flight`. At t = 0 it is given: the
descent, AUTO.LAND, arming, or the loss of GNSS. No noise, no estimate error. PX4 steers by its estimate, so the flight starts at the
estimated z, and the ground lies at the z that PX4 believed at touchdown. In automatic modes the recorded horizontal estimate is an input:
PX4's trajectory, the height's too, runs the slower the further the vehicle is behind it horizontally, and its estimate wanders by
decimetres, also where the vehicle stands and waits for its take-off; `--own-horizontal` of px4_fidelity.py leaves it out. `--recorded-error` gives the vehicle the recording's vertical error as well,
and the horizontal estimate in every mode, and compares estimate with estimate: what is left then is not the estimator's. NED, seconds since the command. Read by px4_fidelity.py.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum, auto
from math import isfinite, nan
from pathlib import Path

import numpy as np
from px4_recording import Array
from sih_ground import SihGround

from sitl_stub.airframe import Airframe
from sitl_stub.autopilot.autopilot import Autopilot, AutopilotOptions
from sitl_stub.autopilot.commands import Command
from sitl_stub.autopilot.estimate import NO_ERRORS, Estimator
from sitl_stub.autopilot.modes import NavState
from sitl_stub.autopilot.offboard import LocalTarget
from sitl_stub.autopilot.vehicle_estimate import VehicleEstimate
from sitl_stub.multirotor import Multirotor, VehicleTruth

GROUND_ALTITUDE_M = 489.4
_STEP_US, _RANGE_US, _STREAM_US, _BEFORE_US = 4_000, 20_000, 50_000, 2_000_000
_RANGE_LEAST_M, _RANGE_MAX_M = 0.05, 100.0
_RANGE_WRAP_M = 655.36
"""The message counts unsigned centimetres; SIH's vehicle sinks a little below its ground."""
_SLOPE_S, _RANGE_AGE_S = 0.25, 0.1
_SMOOTH_STEPS = 25
_LOCAL_NED = 1
_ONLY_VELOCITY, _ONLY_POSITION = 0b0101_1100_0111, 0b1001_1111_1000
_ARM, _TAKEOFF = 400, 22
_APP = (1, 191)
_NAME = re.compile(
    r"(?P<kind>offland|autoland|takeoff|gps_loss|land_auto)(_(?P<what>offboard_vel|offboard_pos|auto|arm_first|flight|offboard))?(_(?P<value>-?[\d.]+))?(_(?P<range>rng|norng))?"
)


@dataclass(frozen=True, slots=True, eq=False)
class Flight:
    """One recording or its simulation. Heights are true, NaN where a row has none; `landed` and `armed` are NaN, 0 or 1."""

    t_s: Array
    z_m: Array
    vz_m_s: Array
    true_vz_m_s: Array
    height_m: Array
    landed: Array
    armed: Array
    range_m: Array
    """Of the range sensor; 0 where it reports that on the ground, NaN where it sees nothing."""
    horizontal: Array
    """Estimated x, y, vx, vy, shape (rows, 4)."""


@dataclass(frozen=True, slots=True)
class Order:
    """What was commanded."""

    kind: str
    what: str
    value: float
    has_range_sensor: bool

    @property
    def starts_on_ground(self) -> bool:
        return self.kind == "takeoff"

    @property
    def is_automatic(self) -> bool:
        """PX4's trajectory is flown, not a stream."""
        return self.is_landing_mode or self.what in ("auto", "arm_first")

    def steers_by_horizontal(self, given: Given) -> bool:
        """The recorded horizontal estimate is an input: it moves PX4's trajectory; with the whole error given, it tilts the vehicle, too."""
        if given is Given.ERROR:
            return self.kind != "gps_loss"
        return self.is_automatic and given is Given.HORIZONTAL

    @property
    def is_landing_mode(self) -> bool:
        return self.kind in ("autoland", "land_auto")


def is_flight_recording(path: Path) -> bool:
    """Has the columns of the take-off and landing campaign, and a name that says what was commanded."""
    with path.open(encoding="ascii") as file:
        header = file.readline()
    return "true_alt_m" in header and "landed_state" in header and _NAME.fullmatch(path.stem) is not None


def order_of(name: str) -> Order:
    """Read the command from the file's name; ValueError for an unknown one."""
    match = _NAME.fullmatch(name)
    if match is None:
        raise ValueError(f"{name}: the name does not say what was commanded")
    value = float(match["value"]) if match["value"] else nan
    return Order(match["kind"], match["what"] or "", value, match["range"] != "norng")


def read_flight(path: Path) -> Flight:
    """One file."""
    with path.open(encoding="ascii", newline="") as file:
        rows = list(csv.DictReader(file))

    def column(name: str) -> Array:
        return np.array([float(row[name]) if row.get(name) else np.nan for row in rows])

    t_s, height_m, true_vz_m_s = column("t_s"), column("true_alt_m") - GROUND_ALTITUDE_M, column("true_vz")
    range_m = column("range_m")
    if np.isnan(true_vz_m_s).all():
        height_m = np.where(range_m > _RANGE_MAX_M, range_m - _RANGE_WRAP_M, range_m)
        true_vz_m_s = _descent_by_range(t_s, height_m)
    range_m[range_m > _RANGE_MAX_M] = nan
    landed = np.array([nan if not row["landed_state"] else float(row["landed_state"] == "ON_GROUND") for row in rows])
    return Flight(
        t_s,
        column("z"),
        column("vz"),
        true_vz_m_s,
        height_m,
        landed,
        column("armed"),
        range_m,
        np.stack([column(name) for name in ("x", "y", "vx", "vy")], axis=1),
    )


def _descent_by_range(t_s: Array, height_m: Array) -> Array:
    """True vertical speed where no truth was recorded: SIH's range sensor has no error over its flat ground.

    Slope of the readings within _SLOPE_S, which are _RANGE_AGE_S old: for the two recordings whose truth is in a log this is within
    0.03 m/s (rms) of it.
    """
    seen = np.flatnonzero(~np.isnan(height_m))
    t_seen_s, height_m = t_s[seen], height_m[seen]
    slope = np.zeros(len(seen))
    for row, t in enumerate(t_seen_s):
        near = np.abs(t_seen_s - t) <= _SLOPE_S
        age_s = t_seen_s[near] - t_seen_s[near].mean()
        slope[row] = age_s @ height_m[near] / max(float(age_s @ age_s), 1e-9)
    speed = np.full(len(t_s), np.nan)
    if len(seen):
        speed[seen] = -np.interp(t_seen_s, t_seen_s - _RANGE_AGE_S, slope)
    return speed


class Given(Enum):
    """What of the recorded estimate the simulated vehicle is given."""

    NOTHING = auto()
    HORIZONTAL = auto()
    """Horizontal position and velocity, in the automatic modes."""
    ERROR = auto()
    """That in all modes (as long as there is GNSS), and the vertical error."""


class RecordedHorizontal(Estimator):
    """An estimator without error whose horizontal position and velocity are the recording's, where it has them."""

    def __init__(self, parameters: Mapping[str, float | int], flight: Flight) -> None:
        super().__init__(parameters, np.random.default_rng(0), NO_ERRORS)
        self._flight = flight

    def step(self, t_us: int, truth: VehicleTruth, dt_s: float) -> VehicleEstimate:
        estimate = super().step(t_us, truth, dt_s)
        t_s = (t_us - _BEFORE_US) * 1e-6
        x, y, vx, vy = (float(np.interp(t_s, self._flight.t_s, values)) for values in self._flight.horizontal.T)
        if isfinite(x + y + vx + vy):
            estimate.position_ned_m = (x, y, estimate.position_ned_m[2])
            estimate.velocity_ned_m_s = (vx, vy, estimate.velocity_ned_m_s[2])
        return estimate


class RecordedError(RecordedHorizontal):
    """As that, and height and vertical speed are wrong by what the recording's were wrong by at that time."""

    def __init__(self, parameters: Mapping[str, float | int], flight: Flight) -> None:
        super().__init__(parameters, flight)
        self._t_s = np.arange(flight.t_s[0], flight.t_s[-1], _STEP_US * 1e-6)
        z, vz, height, true_vz = (
            np.interp(self._t_s, flight.t_s[~np.isnan(values)], values[~np.isnan(values)])
            for values in (flight.z_m, flight.vz_m_s, flight.height_m, flight.true_vz_m_s)
        )
        self._z_m, self._vz_m_s = z + height, vz - true_vz
        padded = np.pad(self._z_m, _SMOOTH_STEPS, "edge")
        smooth = np.convolve(padded, np.full(2 * _SMOOTH_STEPS + 1, 1.0 / (2 * _SMOOTH_STEPS + 1)), "valid")
        self._rate_m_s = np.gradient(smooth, self._t_s)
        self.vz_error_m_s = 0.0

    def step(self, t_us: int, truth: VehicleTruth, dt_s: float) -> VehicleEstimate:
        estimate = super().step(t_us, truth, dt_s)
        row = int(np.clip(np.searchsorted(self._t_s, (t_us - _BEFORE_US) * 1e-6), 0, len(self._t_s) - 1))
        self.vz_error_m_s = float(self._vz_m_s[row])
        (x, y, z), (vx, vy, vz) = estimate.position_ned_m, estimate.velocity_ned_m_s
        estimate.position_ned_m = (x, y, z + float(self._z_m[row]))
        estimate.velocity_ned_m_s = (vx, vy, vz + self.vz_error_m_s)
        estimate.height_rate_ned_m_s += float(self._rate_m_s[row])
        return estimate


class FlightReplay:
    """The simulator under the same command."""

    def __init__(
        self,
        order: Order,
        airframe: Airframe,
        start_z_m: float,
        ground_z_m: float,
        recorded: Flight,
        given: Given = Given.HORIZONTAL,
    ) -> None:
        options = AutopilotOptions(
            errors=NO_ERRORS,
            home_error_scale=0.0,
            imu_noise_scale=0.0,
            cold_boot=False,
            has_range_sensor=order.has_range_sensor,
            ground_link=False,
        )
        self._order = order
        self._autopilot = Autopilot(airframe, None, np.random.default_rng(0), options)
        if not order.steers_by_horizontal(given):
            recorded = replace(recorded, horizontal=np.full((len(recorded.t_s), 4), nan))
        kind = RecordedError if given is Given.ERROR else RecordedHorizontal
        self._autopilot.estimator = kind(self._autopilot.parameters.as_mapping(), recorded)
        signal = 0.0 if order.starts_on_ground else airframe.hover_signal
        self._ground_z_m = ground_z_m
        self._body = Multirotor(airframe, (0.0, 0.0, start_z_m), motors=(signal, signal, signal, signal))
        self._body.on_surface = order.starts_on_ground
        self._ground = SihGround(self._body, ground_z_m)
        self._ordered = False
        if not order.starts_on_ground:
            self._autopilot.begin_in_air(self._body.truth())

    def run(self, seconds: float) -> Flight:
        """Fly two seconds of holding, give the order at t = 0 and fly on."""
        rows = []
        for t_us in range(0, _BEFORE_US + round(seconds * 1e6), _STEP_US):
            self._pilot(t_us)
            height_m = self._ground_z_m - self._body.state.z
            range_m = height_m if self._order.has_range_sensor and height_m > 0.0 else None
            if t_us % _RANGE_US == 0:
                self._autopilot.see_range(t_us, range_m)
            motors = self._autopilot.step(t_us, self._body.truth(), range_m, _STEP_US * 1e-6)
            self._autopilot.datagrams()
            self._body.step(_STEP_US * 1e-6, motors)
            self._ground.stop(_STEP_US)
            s, autopilot = self._body.state, self._autopilot
            rows.append(
                (
                    (t_us - _BEFORE_US) * 1e-6,
                    s.z,
                    s.vz,
                    float(autopilot.land_detector.landed),
                    float(autopilot.is_armed),
                    self._vz_error_m_s,
                )
            )
        t_s, z, vz, landed, armed, error = np.array(rows).T
        height, horizontal = self._ground_z_m - z, np.zeros((len(t_s), 4))
        return Flight(t_s, z, vz + error, vz, height, landed, armed, height, horizontal)

    @property
    def _vz_error_m_s(self) -> float:
        estimator = self._autopilot.estimator
        return estimator.vz_error_m_s if isinstance(estimator, RecordedError) else 0.0

    def _pilot(self, t_us: int) -> None:
        autopilot, order = self._autopilot, self._order
        streams = order.what in ("offboard_vel", "offboard_pos") or not order.starts_on_ground
        after = t_us >= _BEFORE_US
        if streams and t_us % _STREAM_US == 0 and not (after and order.is_landing_mode):
            autopilot.receive_local_target(self._target(after))
        if streams and t_us == 2 * _STREAM_US:
            autopilot.commander.request_mode(NavState.OFFBOARD)
        if after and not self._ordered:
            self._ordered = True
            self._give_order()

    def _give_order(self) -> None:
        autopilot, order = self._autopilot, self._order
        if order.is_landing_mode:
            autopilot.commander.request_mode(NavState.AUTO_LAND)
        elif order.kind == "gps_loss":
            autopilot.estimator.gnss_available = False
        elif order.starts_on_ground:
            if order.what in ("auto", "arm_first"):
                autopilot.handle_command(Command(_TAKEOFF, (0.0, 0.0, 0.0, nan, nan, nan, nan), "onboard", _APP))
            autopilot.handle_command(Command(_ARM, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), "onboard", _APP))

    def _target(self, after: bool) -> LocalTarget:
        order = self._order
        vz = order.value if order.what == "offboard_vel" or (after and order.kind == "offland") else 0.0
        if order.what == "offboard_pos":
            return LocalTarget(_LOCAL_NED, _ONLY_POSITION, (0.0, 0.0, order.value), (0.0,) * 3, (0.0,) * 3, 0.0, 0.0)
        return LocalTarget(_LOCAL_NED, _ONLY_VELOCITY, (0.0,) * 3, (0.0, 0.0, vz), (0.0,) * 3, 0.0, 0.0)


def start_and_ground_z_m(order: Order, flight: Flight, given: Given = Given.HORIZONTAL) -> tuple[float, float]:
    """Estimated z when the command was given, and where PX4 believed the ground.

    That is its z at touchdown; where no truth tells when, its z plus what the range sensor read (the median); else zero. With the error
    given both are true: z over the ground, and zero.
    """
    if order.starts_on_ground:
        return 0.0, 0.0
    if given is Given.ERROR:
        known = ~np.isnan(flight.height_m)
        return -float(np.interp(0.0, flight.t_s[known], flight.height_m[known])), 0.0
    down_s, seen = touchdown_s(flight), np.flatnonzero(flight.range_m > _RANGE_LEAST_M)
    ground_z_m = 0.0
    if down_s is not None:
        ground_z_m = float(np.interp(down_s, flight.t_s, flight.z_m))
    elif len(seen):
        ground_z_m = float(np.median(flight.z_m[seen] + flight.range_m[seen]))
    return float(np.interp(0.0, flight.t_s, flight.z_m)), ground_z_m


def touchdown_s(flight: Flight) -> float | None:
    """When the true vertical motion ended for good after a descent."""
    known = ~np.isnan(flight.true_vz_m_s) & (flight.t_s > 0.0)
    moving = np.flatnonzero(np.abs(flight.true_vz_m_s[known]) > 0.02)
    t_s = flight.t_s[known]
    return float(t_s[moving[-1]]) if len(moving) and moving[-1] + 5 < len(t_s) else None


def first_time(t_s: Array, flags: Array, value: float) -> float | None:
    """First time after the command at which a flag has the value."""
    found = np.flatnonzero((flags == value) & (t_s > 0.0))
    return float(t_s[found[0]]) if len(found) else None
