"""How far a pad is off, and how far the estimator says it may be, while it is out of sight and the autopilot's own estimate drifts.

    python benchmarks/frame_drift.py [--runs N]

The vehicle flies 6 m above the pad. Velocity and position of the autopilot are off as on the flights of a real PX4 in
tests/data/px4/steps and steps_lowdrag (those of 10 s and longer: estimate minus true velocity, and what the estimate of the position
gained beyond the integral of the true velocity), one flight a run, turned by a quarter for each further round through them; roll and
pitch wander by 0.7 degrees over 4 s (drawn: the recordings hold no true attitude). `steady`: no such error. The pad is seen at 30 Hz
with 3 cm noise and one frame in ten lost for 6 s, then not at all, while the vehicle's state goes on coming at 50 Hz. With `beacon` a
GNSS of the pad reports at 5 Hz all the time, its bias drawn and wandering as in benchmarks/estimators.py. Errors are those of pad
minus vehicle. The first line says also what a filter reaches that knows the path to be straight.
"""

from __future__ import annotations

import argparse
import csv
import math
from pathlib import Path

import numpy as np
import numpy.typing as npt
from estimators import LOST_FRAMES, PATHS, Path2

from companion.config import Camera, Estimation, Pad
from companion.estimation import VehicleHistory, make_tracker
from companion.geometry import Transform, Vec3, quaternion_from_euler
from companion.messages import PadBeacon, PadObservation, VehicleState
from companion.mount import mounted

Array = npt.NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[1]
STEP_S = 0.02
SEE_S = 6.0
AHEAD_S = (0.5, 1.0, 2.0, 4.0)
HEIGHT_M = 6.0
NOISE_M = 0.03
TILT_SIGMA_RAD, TILT_TIME_S = 0.0125, 4.0
CAMERA = Camera()
MOUNT = mounted(CAMERA)
STRAIGHT_PSD = 0.001
NEARER_S = 0.8
COUNT = round((SEE_S + AHEAD_S[-1]) / STEP_S) + 1


def recorded_errors() -> list[tuple[Array, Array]]:
    """Of each recorded flight that is long enough: errors of position and velocity, (2, COUNT), north and east."""
    flights = []
    for folder in ("steps", "steps_lowdrag"):
        for path in sorted((ROOT / "tests/data/px4" / folder).glob("*.csv")):
            if path.stem.startswith("summary"):
                continue
            with path.open() as file:
                flight = _errors([row for row in csv.DictReader(file) if all(row[key] for key in COLUMNS)])
            if flight is not None:
                flights.append(flight)
    return flights


COLUMNS = ("t_s", "x", "y", "vx", "vy", "true_vx", "true_vy")


def _errors(rows: list[dict[str, str]]) -> tuple[Array, Array] | None:
    table = np.array([[float(row[key]) for key in COLUMNS] for row in rows]).T
    t = table[0][0] + STEP_S * np.arange(COUNT)
    if t[-1] > table[0][-1]:
        return None
    position, velocity, true = (np.array([np.interp(t, table[0], table[i + k]) for k in range(2)]) for i in (1, 3, 5))
    flown = np.zeros_like(true)
    flown[:, 1:] = np.cumsum(0.5 * (true[:, 1:] + true[:, :-1]), axis=1) * STEP_S
    drift = position - flown
    return drift - drift[:, :1], velocity - true


def turned(pair: tuple[Array, Array], quarters: int) -> tuple[Array, Array]:
    c, s = ((1, 0), (0, 1), (-1, 0), (0, -1))[quarters % 4]
    R = np.array([[c, -s], [s, c]], dtype=float)
    return R @ pair[0], R @ pair[1]


def wander(sigma: float, time_s: float, rng: np.random.Generator) -> Array:
    """(COUNT,) stationary first-order Gauss-Markov process, one value each STEP_S."""
    keep = math.exp(-STEP_S / time_s)
    values = rng.normal(0.0, sigma * math.sqrt(1.0 - keep * keep), COUNT)
    values[0] = rng.normal(0.0, sigma)
    for k in range(1, COUNT):
        values[k] += keep * values[k - 1]
    return np.asarray(values)


def still(_: float) -> tuple[float, float, float, float, float]:
    return 3.0, -2.0, 0.0, 0.0, 0.4


class Flight:
    """One vehicle above one pad; `errors` are (2, COUNT) of position and velocity, None: the estimate is the truth."""

    def __init__(self, path: Path2, seed: int, errors: tuple[Array, Array] | None) -> None:
        self.path, self.start_s = path, 0.73 * seed
        self.rng = np.random.default_rng(seed + 20_000)
        zero = np.zeros((2, COUNT))
        self.position, self.velocity = errors or (zero, zero)
        self.tilt = (
            zero if errors is None else np.array([wander(TILT_SIGMA_RAD, TILT_TIME_S, self.rng) for _ in range(2)])
        )
        self.bias = self.rng.normal(0.0, 1.06, 2)

    def state(self, k: int) -> VehicleState:
        x, y, vx, vy, _ = self.path(self.start_s + k * STEP_S)
        (px, py), (ex, ey) = self.position[:, k].tolist(), self.velocity[:, k].tolist()
        q = quaternion_from_euler(*self.tilt[:, k].tolist(), 0.0)
        return VehicleState(_ns(k), (x + px, y + py, -HEIGHT_M), (vx + ex, vy + ey, 0.0), q, (0.0, 0.0, 0.0), 0)

    def sight(self, k: int) -> PadObservation:
        x, y, _, _, yaw = self.path(self.start_s + k * STEP_S)
        here = Transform((1.0, 0.0, 0.0, 0.0), (x, y, -HEIGHT_M)) @ MOUNT
        turn = quaternion_from_euler(0.0, 0.0, yaw + float(self.rng.normal(0.0, 0.02)))
        seen = here.inverse() @ Transform(turn, _vec3((x, y, 0.0) + self.rng.normal(0.0, NOISE_M, 3)))
        v, w = NOISE_M**2, 0.02**2
        return PadObservation(
            _ns(k), "down", "drawn", seen.p, ((v, 0.0, 0.0), (0.0, v, 0.0), (0.0, 0.0, v)), seen.q,
            ((w, 0.0, 0.0), (0.0, w, 0.0), (0.0, 0.0, w)),
        )  # fmt: skip

    def beacon(self, k: int) -> PadBeacon:
        x, y, vx, vy, _ = self.path(self.start_s + k * STEP_S)
        self.bias = self.bias + self.rng.normal(0.0, 0.087, 2)
        north, east = ((x, y) + self.bias + self.rng.normal(0.0, 0.05, 2)).tolist()
        slip = self.rng.normal(0.0, 0.1, 2).tolist()
        return PadBeacon(
            _ns(k), "gnss", (north, east, 0.0), (vx + slip[0], vy + slip[1], 0.0), None, 1.5, velocity_sigma_m_s=0.15
        )


def _ns(k: int) -> int:
    return round(k * STEP_S * 1e9)


def _vec3(values: Array) -> Vec3:
    x, y, z = values.tolist()
    return x, y, z


def blind(flight: Flight, *, beacon: bool) -> Array:
    """(len(AHEAD_S), 2 axes, 2): error and reported standard deviation, m, so long after the last sight."""
    tracker = make_tracker(Estimation(), Pad(), {"down": CAMERA})
    asked = {round((SEE_S + ahead_s) / STEP_S) for ahead_s in AHEAD_S}
    due, rows = 0.0, []
    for k in range(COUNT):
        state = flight.state(k)
        tracker.add_vehicle_state(state)
        if k * STEP_S <= SEE_S and k * STEP_S >= due - 1e-9:
            due += 1.0 / 30.0
            if flight.rng.random() >= LOST_FRAMES or k * STEP_S >= SEE_S - 0.5 * STEP_S:
                tracker.observe(flight.sight(k))
        if beacon and k % 10 == 1:
            tracker.observe(flight.beacon(k))
        if k in asked:
            estimate = tracker.estimate(state.t_ns)
            assert estimate is not None
            error = np.array(estimate.position_ned_m[:2]) - np.array(state.position_ned_m[:2])
            sigma = np.sqrt([estimate.covariance[0][0], estimate.covariance[1][1]])
            rows.append(np.stack([error, sigma], axis=1))
    return np.array(rows)


def frame_of(errors: tuple[Array, Array]) -> tuple[Array, Array]:
    """Correction (m/s) and place (m) in O of a vehicle that stands, whose estimate is off by `errors`: (2, COUNT) each."""
    history, poses = VehicleHistory(1.0), []
    for k in range(COUNT):
        (px, py), (vx, vy) = errors[0][:, k].tolist(), errors[1][:, k].tolist()
        history.add(VehicleState(_ns(k), (px, py, 0.0), (vx, vy, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0))
        assert history.latest is not None
        poses.append(history.latest)
    return np.array([pose.correction_m_s[:2] for pose in poses]).T, np.array(
        [pose.position_o_m[:2] for pose in poses]
    ).T


def told_of_the_frame(recorded: list[tuple[Array, Array]]) -> str:
    """From the second second on: how corrections and velocity error go together, and how far frames drift in 2 s."""
    first, ahead = round(1.0 / STEP_S), round(2.0 / STEP_S)
    frames = [frame_of(errors) for errors in recorded]
    velocity = np.concatenate([errors[1][:, first:].ravel() for errors in recorded])
    corrections = np.concatenate([correction[:, first:].ravel() for correction, _ in frames])
    moved = np.concatenate([(place[:, first + ahead :] - place[:, first:-ahead]).ravel() for _, place in frames])
    alone = [np.cumsum(errors[1], axis=1) * STEP_S for errors in recorded]
    drifted = np.concatenate([(place[:, first + ahead :] - place[:, first:-ahead]).ravel() for place in alone])
    together = float(np.corrcoef(velocity, corrections)[0, 1])
    rms = [float(np.sqrt(np.mean(values**2))) for values in (velocity, moved, drifted)]
    return (
        f"velocity error {rms[0]:.2f} m/s rms, its correlation with the corrections {together:.2f}; in 2 s O drifts by {rms[1]:.2f} m rms, "
        f"the integral of the velocity by {rms[2]:.2f} m"
    )


def straight(place: Array, seen: npt.NDArray[np.bool_], rng: np.random.Generator, *, tilted: bool) -> float:
    """Error on one axis 2 s after the last sight, m, of a filter that knows that the pad goes straight and how its errors wander:
    position, velocity and the error that sights share. `place` is where a vehicle that stands is in O; `tilted`: its attitude wanders."""
    tilt = HEIGHT_M * wander(TILT_SIGMA_RAD, TILT_TIME_S, rng) if tilted else np.zeros(COUNT)
    z = place + tilt + rng.normal(0.0, NOISE_M, COUNT)
    sigma, keep = HEIGHT_M * TILT_SIGMA_RAD, math.exp(-STEP_S / TILT_TIME_S)
    F = np.array([[1.0, STEP_S, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, keep]])
    Q = np.diag([0.0, STRAIGHT_PSD * STEP_S, sigma**2 * (1.0 - keep * keep)])
    x, P, H = np.zeros(3), np.diag([100.0, 25.0, sigma**2]), np.array([1.0, 0.0, 1.0])
    for k in np.arange(round(SEE_S / STEP_S) + 1):
        x, P = F @ x, F @ P @ F.T + Q
        if seen[k]:
            K = P @ H / (H @ P @ H + NOISE_M**2)
            x, P = x + K * (z[k] - H @ x), P - np.outer(K, H @ P)
    return float(x[0] + 2.0 * x[1] - place[round((SEE_S + 2.0) / STEP_S)])


def nearer(errors: tuple[Array, Array]) -> Array:
    """Place in a frame that nothing here flies yet, (2, COUNT): O and `NEARER_S` of the corrections. They answer the position error, so
    they tell it."""
    correction, place = frame_of(errors)
    return place + NEARER_S * correction


def told_of_the_limit(recorded: list[tuple[Array, Array]], runs: int) -> str:
    """What such a filter reaches on a line: the autopilot's drift alone, the attitude's wander alone, both; in O and in the nearer frame."""
    p95 = []
    for drifts, tilted, place_of in (
        (1.0, False, lambda errors: frame_of(errors)[1]),
        (0.0, True, lambda errors: frame_of(errors)[1]),
        (1.0, True, lambda errors: frame_of(errors)[1]),
        (1.0, False, nearer),
        (1.0, True, nearer),
    ):
        errors = []
        for k in range(runs):
            rng = np.random.default_rng(k + 40_000)
            place = place_of(turned(recorded[k % len(recorded)], k // len(recorded)))
            seen = rng.random(COUNT) < 0.6 * (1.0 - LOST_FRAMES)
            errors.append([straight(drifts * axis, seen, rng, tilted=tilted) for axis in place])
        p95.append(float(np.percentile(np.hypot(*np.array(errors).T), 95)))
    first, two_s = round(1.0 / STEP_S), round(2.0 / STEP_S)
    change = np.concatenate([(e[1][:, two_s:] - e[1][:, :-two_s]).ravel() for e in recorded])
    moved = np.concatenate([(n[:, first + two_s :] - n[:, first:-two_s]).ravel() for n in map(nearer, recorded)])
    return (
        f"in 2 s the velocity error changes by {_rms(change):.2f} m/s rms an axis; a filter that knows that the pad goes straight is off 2 s "
        f"blind at p95 by {p95[0]:.2f} m for the drift of O alone, {p95[1]:.2f} m for the attitude alone, {p95[2]:.2f} m for both; O and "
        f"{NEARER_S} s of the corrections would drift by {_rms(moved):.2f} m rms in 2 s: {p95[3]:.2f} m alone, {p95[4]:.2f} m with the attitude"
    )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--runs", type=int, default=78)
    runs, recorded = parser.parse_args().runs, recorded_errors()
    print(
        f"{len(recorded)} recorded flights, {runs} runs a row; {told_of_the_frame(recorded)}; {told_of_the_limit(recorded, runs)}\n"
    )
    print("| path | frame | besides | blind s | rms m an axis | sigma m | within 2 sigma | horizontal p95 m |")
    print("| --- | --- | --- | ---: | ---: | ---: | ---: | ---: |")
    for name in ("still", "line", "circle r = 20 m", "figure-8 60 x 24 m"):
        path = still if name == "still" else PATHS[name]
        for frame, beacon in (("steady", False), ("recorded", False), ("recorded", True)):
            chosen = [
                None if frame == "steady" else turned(recorded[k % len(recorded)], k // len(recorded))
                for k in range(runs)
            ]
            results = np.array([blind(Flight(path, k, chosen[k]), beacon=beacon) for k in range(runs)])
            for row, ahead_s in enumerate(AHEAD_S):
                error, sigma = results[:, row, :, 0], results[:, row, :, 1]
                within = 100.0 * float(np.mean(np.abs(error) <= 2.0 * sigma))
                rms, said = math.sqrt(float(np.mean(error**2))), math.sqrt(float(np.mean(sigma**2)))
                p95 = float(np.percentile(np.hypot(error[:, 0], error[:, 1]), 95))
                besides = "5 Hz beacon" if beacon else "nothing"
                print(
                    f"| {name} | {frame} | {besides} | {ahead_s:g} | {rms:.2f} | {said:.2f} | {within:.0f}% | {p95:.2f} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
