"""PX4's own precision landing and simple companion laws over moving virtual pads: which pads each lands on, recorded and simulated.

    python benchmarks/landing_laws.py [--seeds N] [--law NAME] [--markdown | --json]

The recorded runs are a real PX4's (tests/data/px4/landing_laws.csv). Here the simulated autopilot flies `sih_quadx` over SIH's flat ground
with its estimate errors on, from 10 m above a pad at ground height that starts 2 m away in a random direction. A camera under the vehicle
measures the pad with noise of 2 cm + 1 % of range at 20 Hz, 60 ms late, within 45 degrees and above 0.05 m. Pads faster than 2.5 m/s are
joined on their true state first. "lag" is the median of the along-track error in the approach over the pad's speed. Writes the table of
docs/landing-laws.md with --markdown. NED, metres, seconds.
"""

from __future__ import annotations

import argparse
import csv
import json
import statistics
import sys
from collections import deque
from dataclasses import asdict, dataclass
from math import cos, hypot, pi, sin, sqrt
from pathlib import Path

import numpy as np

from sitl_stub.airframe import read_airframe
from sitl_stub.autopilot.autopilot import Autopilot, AutopilotOptions
from sitl_stub.autopilot.modes import NavState
from sitl_stub.autopilot.navigation import TargetKind
from sitl_stub.autopilot.offboard import LocalTarget
from sitl_stub.autopilot.precland import Precland, PreclandState
from sitl_stub.multirotor import Multirotor

ROOT = Path(__file__).parent.parent
RECORDED = ROOT / "tests" / "data" / "px4" / "landing_laws.csv"
STEP_US, RANGE_US, LOOK_US, DELAY_US, SETTLE_US = 4_000, 20_000, 50_000, 60_000, 3_000_000
HEIGHT_M, OFFSET_M, LIMIT_S, JOIN_S = 10.0, 2.0, 60.0, 40.0
JOIN_FROM_M_S = 2.5
LEAST_HEIGHT_M, DISARM_HEIGHT_M, BLIND_BELOW_M = 0.05, 0.15, 0.7
_DRAG_PER_S = 1.0
"""Of the recorded vehicle (1 N per m/s on 1 kg), given to the law that feeds acceleration forward."""
_LOCAL_NED = 1
_VELOCITY, _VELOCITY_AND_ACCELERATION = 0b0101_1100_0111, 0b0100_0000_0111
_LAG_FROM_S, _LAG_TO_S = 10.0, 40.0
_OVER_THE_PAD = (PreclandState.DESCEND_ABOVE_TARGET, PreclandState.FINAL_APPROACH)


class Pad:
    """Position and velocity of the pad's centre at any time; `name` as in the recorded table."""

    def __init__(self, name: str, rng: np.random.Generator) -> None:
        self.speed_m_s = float(name.split("_")[-1] if name.startswith("fig8") else name.lstrip("linecr"))
        self.kind = name.rstrip("0123456789._")
        heading, bearing = rng.uniform(-pi, pi, 2)
        self.along = (cos(heading), sin(heading))
        self._start = (OFFSET_M * cos(bearing), OFFSET_M * sin(bearing))

    def at(self, t_s: float) -> tuple[float, float]:
        """North and east."""
        forward, left = self._path(t_s)
        c, s = self.along
        return self._start[0] + c * forward - s * left, self._start[1] + s * forward + c * left

    def velocity(self, t_s: float) -> tuple[float, float]:
        """By difference."""
        (x0, y0), (x1, y1) = self.at(t_s - 0.01), self.at(t_s + 0.01)
        return (x1 - x0) / 0.02, (y1 - y0) / 0.02

    def _path(self, t_s: float) -> tuple[float, float]:
        if self.kind == "line":
            return self.speed_m_s * t_s, 0.0
        if self.kind == "circle":
            angle = self.speed_m_s * t_s / 10.0
            return 10.0 * sin(angle), 10.0 * (1.0 - cos(angle))
        # Gerono's figure, 20 x 10 m, fastest where it crosses itself.
        angle = self.speed_m_s * t_s / (10.0 * sqrt(2.0))
        return 10.0 * sin(angle), 5.0 * sin(2.0 * angle)


class Tracker:
    """Kalman filter of one axis of the pad's position in PX4's local frame, constant velocity or acceleration."""

    def __init__(self, accelerates: bool) -> None:
        self._q = 4.0 if accelerates else 1.0
        self._n = 3 if accelerates else 2
        self.x = np.zeros(3)
        self._p = np.diag([0.1, 4.0, 2.0 if accelerates else 0.0])
        self.t_s: float | None = None

    def update(self, measured_m: float, t_s: float, sigma_m: float) -> None:
        """A position measured at t_s."""
        if self.t_s is None:
            self.x[0], self.t_s = measured_m, t_s
            return
        f, dt = self._transition(t_s - self.t_s), t_s - self.t_s
        noise = np.zeros(3)
        noise[self._n - 1] = self._q * dt
        self.x, self._p, self.t_s = f @ self.x, f @ self._p @ f.T + np.diag(noise), t_s
        gain = self._p[:, 0] / (self._p[0, 0] + sigma_m**2)
        self.x = self.x + gain * (measured_m - self.x[0])
        self._p = self._p - np.outer(gain, self._p[0])

    def at(self, t_s: float) -> tuple[float, float, float]:
        """Position, velocity, acceleration predicted to t_s."""
        position, velocity, acceleration = self._transition(t_s - (self.t_s or 0.0)) @ self.x
        return float(position), float(velocity), float(acceleration)

    @staticmethod
    def _transition(dt: float) -> np.ndarray:
        return np.array([[1.0, dt, 0.5 * dt * dt], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])


@dataclass(frozen=True, slots=True)
class Run:
    """One flight. `landed`: on the ground in time, PRECLAND in its descent over the pad. Lag in seconds of pad motion."""

    landed: bool
    miss_m: float
    descent_s: float | None
    lag_s: float | None


class Flight:
    """One law over one pad."""

    def __init__(self, law: str, pad_name: str, seed: int) -> None:
        airframe = read_airframe(ROOT / "configs" / "airframes" / "sih_quadx.toml")
        self._rng, self._z_rng = np.random.default_rng([seed, 77]), np.random.default_rng([seed, 78])
        options = AutopilotOptions(cold_boot=False, ground_link=False, imu_noise_scale=0.0)
        radius = float(law.split()[-1]) if law.startswith("precland") else 0.2
        parameters = {"PLD_HACC_RAD": radius}
        self._autopilot = Autopilot(airframe, parameters, np.random.default_rng([seed, 5]), options)
        signal = airframe.hover_signal
        self._body = Multirotor(airframe, (0.0, 0.0, -HEIGHT_M), motors=(signal, signal, signal, signal))
        self._autopilot.begin_in_air(self._body.truth())
        self._pad = Pad(pad_name, np.random.default_rng([seed, 3]))
        self._law = law
        self._trackers = [Tracker(law == "good with acceleration") for _ in range(2)]
        self._waiting: deque[tuple[int, float, tuple[float, float, float], float]] = deque()
        self._error: tuple[float, float] | None = None
        self._seen_us = -10_000_000
        self._start_us = SETTLE_US
        self._joined_us = 0
        self._descent_s: float | None = None
        self._lags: list[float] = []

    def run(self) -> Run:
        """Fly until the ground or the limit."""
        joins = self._pad.speed_m_s > JOIN_FROM_M_S
        t_us = 0
        while t_us < SETTLE_US + round((LIMIT_S + (JOIN_S if joins else 0.0)) * 1e6):
            self._pilot(t_us)
            s = self._body.state
            range_m = -s.z if s.z < 0.0 else None
            if t_us % RANGE_US == 0:
                self._autopilot.see_range(t_us, range_m)
            motors = self._autopilot.step(t_us, self._body.truth(), range_m, STEP_US * 1e-6)
            self._autopilot.datagrams()
            self._body.step(STEP_US * 1e-6, motors)
            t_us += STEP_US
            if self._body.state.z >= -DISARM_HEIGHT_M and not self._law.startswith("precland"):
                return self._result(t_us, True)
            if self._body.state.z >= 0.0:
                return self._result(t_us, self._autopilot._target is not None and self._descends)
        return self._result(t_us, False)

    @property
    def _descends(self) -> bool:
        route = self._autopilot._route
        return isinstance(route, Precland) and route.state in _OVER_THE_PAD

    def _t_s(self, t_us: int) -> float:
        return (t_us - SETTLE_US) * 1e-6

    def _result(self, t_us: int, landed: bool) -> Run:
        x, y = self._pad.at(self._t_s(t_us))
        miss = hypot(x - self._body.state.x, y - self._body.state.y)
        lag = statistics.median(self._lags) if self._lags else None
        return Run(landed, miss, self._descent_s, lag)

    # Camera --------------------------------------------------------------------------------------------------------

    def _look(self, t_us: int) -> None:
        s, t_s = self._body.state, self._t_s(t_us)
        px, py = self._pad.at(t_s)
        dx, dy, height = px - s.x, py - s.y, -s.z
        if height < LEAST_HEIGHT_M or hypot(dx, dy) > height:
            return
        sigma = 0.02 + 0.01 * sqrt(dx * dx + dy * dy + height * height)
        noise, z_noise = self._rng.normal(0.0, sigma, 2), float(self._z_rng.normal(0.0, sigma))
        x, y, z = self._autopilot.estimator.estimate.position_ned_m
        seen = (x + dx + float(noise[0]), y + dy + float(noise[1]), z + height + z_noise)
        self._waiting.append((t_us + DELAY_US, t_us * 1e-6, seen, sigma))

    def _receive(self, t_us: int) -> bool:
        fresh = False
        while self._waiting and self._waiting[0][0] <= t_us:
            _, captured_s, (x, y, z), sigma = self._waiting.popleft()
            if self._law.startswith("precland"):
                self._autopilot.receive_landing_target(x, y, z)
            else:
                for tracker, value in zip(self._trackers, (x, y), strict=True):
                    tracker.update(value, captured_s, sigma)
            at = self._autopilot.estimator.estimate.position_ned_m
            self._error, self._seen_us, fresh = (x - at[0], y - at[1]), t_us, True
        return fresh

    # Laws ----------------------------------------------------------------------------------------------------------

    def _pilot(self, t_us: int) -> None:
        if t_us < SETTLE_US:
            return
        looks = t_us % LOOK_US == 0
        is_joining = self._pad.speed_m_s > JOIN_FROM_M_S and not self._joined_us
        if looks:
            self._look(t_us)
            self._note_lag(t_us)
        self._receive(t_us)
        if self._law.startswith("precland"):
            if t_us == SETTLE_US + 200_000:
                self._autopilot.commander.request_mode(NavState.AUTO_PRECLAND)
            target = self._autopilot._target
            if self._descent_s is None and target is not None and target.kind is TargetKind.LAND:
                self._descent_s = self._t_s(t_us)
        elif looks:
            self._command(*(self._join(t_us) if is_joining else self._follow(t_us)))
            if t_us == SETTLE_US + 2 * LOOK_US:
                self._autopilot.commander.request_mode(NavState.OFFBOARD)

    def _join(self, t_us: int) -> tuple[float, float, float, tuple[float, float]]:
        """On the pad's true state, at 10 m, until it has been within 2 m for 3 s."""
        t_s, s = self._t_s(t_us), self._body.state
        (px, py), (vx, vy) = self._pad.at(t_s), self._pad.velocity(t_s)
        ex, ey = px - s.x, py - s.y
        if hypot(ex, ey) > 2.0:
            self._start_us = t_us
        elif t_us - self._start_us > 3_000_000:
            self._joined_us = t_us
        (ax0, ay0), (ax1, ay1) = self._pad.velocity(t_s - 0.05), self._pad.velocity(t_s + 0.05)
        return vx + 0.8 * ex, vy + 0.8 * ey, 0.0, ((ax1 - ax0) * 10.0 + vx, (ay1 - ay0) * 10.0 + vy)

    def _follow(self, t_us: int) -> tuple[float, float, float, tuple[float, float]]:
        height, lost_us = -self._body.state.z, t_us - self._seen_us
        if self._law == "naive":
            if lost_us > 500_000 or self._error is None:
                return 0.0, 0.0, -0.5 if lost_us > 2_000_000 else 0.0, (0.0, 0.0)
            ex, ey = self._error
            scale = min(1.0, 3.0 / max(hypot(ex, ey), 1e-6))
            inside = hypot(ex, ey) < 0.3 + 0.1 * height
            return scale * ex, scale * ey, 0.5 if inside else 0.0, (0.0, 0.0)
        if self._trackers[0].t_s is None or (lost_us > 1_000_000 and height > BLIND_BELOW_M):
            return 0.0, 0.0, 0.0, (0.0, 0.0)
        x, y, _ = self._autopilot.estimator.estimate.position_ned_m
        (px, vx, ax), (py, vy, ay) = (tracker.at(t_us * 1e-6) for tracker in self._trackers)
        ex, ey = px - x, py - y
        sinks = hypot(ex, ey) < 0.3 + 0.1 * height or height < BLIND_BELOW_M
        feed = (ax + _DRAG_PER_S * vx, ay + _DRAG_PER_S * vy)
        return vx + 0.8 * ex, vy + 0.8 * ey, (0.7 if height > 1.0 else 0.5) if sinks else 0.0, feed

    def _command(self, vx: float, vy: float, vz: float, feed: tuple[float, float]) -> None:
        feeds = self._law == "good with acceleration"
        mask = _VELOCITY_AND_ACCELERATION if feeds else _VELOCITY
        acceleration = (*feed, 0.0) if feeds else (0.0, 0.0, 0.0)
        target = LocalTarget(_LOCAL_NED, mask, (0.0, 0.0, 0.0), (vx, vy, vz), acceleration, 0.0, 0.0)
        self._autopilot.receive_local_target(target)

    def _note_lag(self, t_us: int) -> None:
        t_s = self._t_s(t_us)
        if self._pad.kind != "line" or self._pad.speed_m_s < 0.3 or not _LAG_FROM_S < t_s < _LAG_TO_S:
            return
        if -self._body.state.z < 8.0 or hypot(*self._miss(t_s)) > HEIGHT_M:
            return
        dx, dy = self._miss(t_s)
        self._lags.append((dx * self._pad.along[0] + dy * self._pad.along[1]) / self._pad.speed_m_s)

    def _miss(self, t_s: float) -> tuple[float, float]:
        x, y = self._pad.at(t_s)
        return x - self._body.state.x, y - self._body.state.y


@dataclass(frozen=True, slots=True)
class Row:
    """A law over a pad, recorded and simulated."""

    law: str
    pad: str
    recorded_runs: int
    recorded_landed: int
    recorded_miss_m: float | None
    runs: int
    landed: int
    miss_m: float | None
    lag_s: float | None


def fly(law: str, pad: str, seeds: int) -> list[Run]:
    """So many flights, seeds from 1."""
    return [Flight(law, pad, seed).run() for seed in range(1, seeds + 1)]


def rows(seeds: int, only: str | None = None) -> list[Row]:
    """All rows of the recorded table."""
    table = []
    with RECORDED.open(encoding="ascii", newline="") as file:
        recorded = [row for row in csv.DictReader(file) if only is None or row["law"] == only]
    for row in recorded:
        runs = fly(row["law"], row["pad"], seeds)
        misses = [run.miss_m for run in runs if run.landed]
        lags = [run.lag_s for run in runs if run.lag_s is not None]
        table.append(
            Row(
                row["law"],
                row["pad"],
                int(row["runs"]),
                int(row["landed"]),
                float(row["miss_m"]) if row["miss_m"] else None,
                seeds,
                sum(run.landed for run in runs),
                statistics.median(misses) if misses else None,
                statistics.median(lags) if lags else None,
            )
        )
    return table


def _number(value: float | None, digits: int = 2) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def markdown(table: list[Row]) -> str:
    """The table of docs/landing-laws.md."""
    lines = [
        "| law | pad | recorded landed | simulated landed | recorded miss (m) | simulated miss (m) | simulated lag (s) |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    lines += [
        f"| {r.law} | {r.pad} | {r.recorded_landed} of {r.recorded_runs} | {r.landed} of {r.runs} | "
        f"{_number(r.recorded_miss_m)} | {_number(r.miss_m)} | {_number(r.lag_s, 1)} |"
        for r in table
    ]
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--law")
    parser.add_argument("--markdown", action="store_true")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    table = rows(options.seeds, options.law)
    print(json.dumps([asdict(row) for row in table], indent=1) if options.json else markdown(table))
    return 0


if __name__ == "__main__":
    sys.exit(main())
