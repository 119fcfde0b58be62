"""How far ahead heave, its rate and the tilt of a boat's deck are foreseen in a JONSWAP sea, by the boat model and the ground's.

    OMP_NUM_THREADS=1 python benchmarks/sea_prediction.py [--runs 20]

The seas and hulls are those of the scenarios boat_1m, boat_2m and boat_4m (sitl_stub/carriers/waves.py). Each run sees the deck for 25 s
at 30 Hz with 3 cm and 1 degree of noise and is then asked for 0.5, 1 and 2 s ahead. `spread` is how much the quantity itself varies:
an error above it is no prediction. `z within` is the share of heave errors inside the predicted two sigmas (95 % is honest).
"""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass

import numpy as np

from companion.config import Estimation
from companion.estimation import ESTIMATORS, PadEstimator
from companion.estimation.measurement import PadMeasurement
from companion.messages import ObservationSource
from sitl_stub.carriers.boat import BoatSettings
from sitl_stub.carriers.waves import Sea
from sitl_stub.scenario import load

SCENARIOS = ("boat_1m", "boat_2m", "boat_4m")
AHEAD_S = (0.5, 1.0, 2.0)
SEEN_S, RATE_HZ, NOISE_M, TILT_NOISE_RAD = 25.0, 30.0, 0.03, math.radians(1.0)
SPEED_M_S = 1.0


@dataclass(frozen=True)
class Deck:
    """A hull that goes north at SPEED_M_S through one sea."""

    sea: Sea
    boat: BoatSettings

    def at(self, t_s: float) -> tuple[float, float, float, float, float]:
        """North and down (m), velocity down (m/s), roll and pitch (rad)."""
        up, pitch, roll, up_rate, *_ = self.sea.hull(
            t_s, SPEED_M_S * t_s, 0.0, (SPEED_M_S, 0.0), 0.0, self.boat.length_m, self.boat.beam_m
        )
        return SPEED_M_S * t_s, -up, -up_rate, roll, pitch


def deck(scenario: str, seed: int) -> Deck:
    boat = load(scenario).carrier
    assert isinstance(boat, BoatSettings)
    rng = np.random.default_rng(seed)
    toward_rad = float(rng.uniform(0.0, math.tau))
    return Deck(Sea(boat.significant_wave_height_m, boat.peak_wave_period_s, toward_rad, rng), boat)


def watched(name: str, seen: Deck, seed: int) -> PadEstimator:
    rng, estimator = np.random.default_rng(seed + 1000), ESTIMATORS[name](Estimation())
    v = NOISE_M**2
    for k in range(round(SEEN_S * RATE_HZ)):
        north, down, _, roll, pitch = seen.at(k / RATE_HZ)
        n = rng.normal(0.0, NOISE_M, 3).tolist()
        tilt = rng.normal(0.0, TILT_NOISE_RAD, 2).tolist()
        estimator.observe(
            PadMeasurement(
                t_ns=round(k / RATE_HZ * 1e9),
                source=ObservationSource.VISION_POSE,
                position_o_m=(north + n[0], n[1], down + n[2]),
                covariance_m2=((v, 0.0, 0.0), (0.0, v, 0.0), (0.0, 0.0, v)),
                roll_rad=roll + tilt[0],
                pitch_rad=pitch + tilt[1],
                yaw_rad=0.0,
                tilt_sigma_rad=TILT_NOISE_RAD,
            )
        )
    return estimator


def errors(name: str, scenario: str, seed: int) -> list[tuple[float, float, float, float]]:
    """For each time ahead: heave m, heave rate m/s, larger tilt deg, and the heave error in predicted sigmas."""
    seen = deck(scenario, seed)
    estimator = watched(name, seen, seed)
    rows = []
    for ahead_s in AHEAD_S:
        t_s = SEEN_S - 1.0 / RATE_HZ + ahead_s
        estimate = estimator.estimate(round(t_s * 1e9))
        assert estimate is not None
        _, down, down_rate, roll, pitch = seen.at(t_s)
        heave = estimate.position_ned_m[2] - down
        tilt = math.degrees(max(abs(estimate.roll_rad - roll), abs(estimate.pitch_rad - pitch)))
        rows.append(
            (heave, estimate.velocity_ned_m_s[2] - down_rate, tilt, abs(heave) / math.sqrt(estimate.covariance[2][2]))
        )
    return rows


def spread(scenario: str, runs: int) -> tuple[float, float, float]:
    """Root mean square of heave, heave rate and larger tilt over the same moments."""
    moments = [deck(scenario, seed).at(SEEN_S + ahead) for seed in range(runs) for ahead in AHEAD_S]
    return (
        _rms([m[1] for m in moments]),
        _rms([m[2] for m in moments]),
        math.degrees(_rms([max(abs(m[3]), abs(m[4])) for m in moments])),
    )


def _rms(values: list[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--runs", type=int, default=20)
    runs = parser.parse_args().runs
    print(f"{runs} seas a row, seeds 0 to {runs - 1}; errors are root mean squares\n")
    print("| sea | model | ahead s | heave m | heave rate m/s | tilt deg | z within |")
    print("| --- | --- | ---: | ---: | ---: | ---: | ---: |")
    for scenario in SCENARIOS:
        heave, rate, tilt = spread(scenario, runs)
        print(f"| {scenario} | spread | | {heave:.2f} | {rate:.2f} | {tilt:.1f} | |")
        for name in ("boat", "imm"):
            flown = [errors(name, scenario, seed) for seed in range(runs)]
            for k, ahead_s in enumerate(AHEAD_S):
                at = [rows[k] for rows in flown]
                inside = sum(z <= 2.0 for *_, z in at) / runs
                figures = [_rms([row[i] for row in at]) for i in range(3)]
                print(
                    f"| {scenario} | {name} | {ahead_s} | {figures[0]:.2f} | {figures[1]:.2f} | {figures[2]:.1f} | {inside:.0%} |"
                )


if __name__ == "__main__":
    main()
