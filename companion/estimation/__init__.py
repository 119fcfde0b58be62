"""Estimation: where the pad is and will be, with an honest uncertainty.

`PadTracker` is what the pipeline uses. An estimator is chosen by `estimation.estimator`; each motion model stands in its own
file and can be chosen alone, `imm` runs several. docs/estimation.md explains the frame O and the models.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from companion.config import Camera, Estimation, Pad
from companion.estimation.bank_track import TrackSettings, gate_sigmas, started
from companion.estimation.bearing_ukf import BearingSettings, start_bearing
from companion.estimation.constant_acceleration import ConstantAcceleration
from companion.estimation.constant_velocity import ConstantVelocity
from companion.estimation.coordinated_turn import CoordinatedTurn
from companion.estimation.filter import PadFilter
from companion.estimation.kalman import warm_up
from companion.estimation.measurement import PadMeasurement
from companion.estimation.motion import BeaconBias, MotionModel
from companion.estimation.oscillator import Oscillator
from companion.estimation.outlook import DeckMotion, PadMotion
from companion.estimation.protocol import PadEstimator
from companion.estimation.sea import Sea
from companion.estimation.static import Static
from companion.estimation.tracker import PadTracker
from companion.estimation.unicycle import UnicycleSettings, start_unicycle
from companion.estimation.vehicle_history import VehicleHistory, VehiclePose, VehicleReset
from companion.estimation.weaving_turn import WeavingTurn

__all__ = [
    "ESTIMATORS",
    "DeckMotion",
    "PadEstimator",
    "PadMeasurement",
    "PadMotion",
    "PadTracker",
    "VehicleHistory",
    "VehiclePose",
    "VehicleReset",
    "make_tracker",
]


Factory = Callable[[Estimation], PadEstimator]


def _bank(name: str, models: Callable[[BeaconBias], Mapping[MotionModel, float]], **settings: Any) -> Factory:
    """An estimator that is a bank of motion models with their first probabilities."""

    def make(config: Estimation) -> PadEstimator:
        weighed = models(BeaconBias(config.beacon_bias_sigma_m, config.beacon_bias_time_s))
        gate = gate_sigmas(config.gate_probability)
        track = TrackSettings(tuple(weighed), tuple(weighed.values()), gate_sigmas=gate, **settings)
        return PadFilter(name, partial(started, track), lag_s=config.lag_s, lost_after_s=config.lost_after_s)

    return make


def _imm_models(bias: BeaconBias) -> Mapping[MotionModel, float]:
    return {
        ConstantVelocity(bias=bias): 0.4,
        CoordinatedTurn(bias=bias): 0.3,
        WeavingTurn(bias=bias): 0.2,
        ConstantAcceleration(bias=bias): 0.1,
    }


def _boat_models(bias: BeaconBias) -> Mapping[MotionModel, float]:
    return {ConstantVelocity(0.01, bias): 0.6, ConstantAcceleration(0.8, 3.0, 0.01, bias): 0.4}


def _unicycle(name: str, **chosen: float) -> Factory:
    def make(config: Estimation) -> PadEstimator:
        settings = UnicycleSettings(gate_sigmas=gate_sigmas(config.gate_probability), **chosen)
        return PadFilter(name, partial(start_unicycle, settings), lag_s=config.lag_s, lost_after_s=config.lost_after_s)

    return make


def _bearing_ukf(config: Estimation) -> PadEstimator:
    settings = BearingSettings(
        tilt_sigma_rad=math.radians(config.vehicle_tilt_sigma_deg),
        yaw_sigma_rad=math.radians(config.vehicle_yaw_sigma_deg),
        ground_down_m=config.ground_down_m,
    )
    start = partial(start_bearing, settings)
    return PadFilter("bearing_ukf", start, lag_s=config.lag_s, lost_after_s=config.lost_after_s)


ESTIMATORS: dict[str, Factory] = {
    "imm": _bank("imm", _imm_models),
    "boat": _bank("boat", _boat_models, vertical=Sea(), tilt=Oscillator(sigma=0.06, mean_psd=1e-5)),
    "static": _bank("static", lambda bias: {Static(bias=bias): 1.0}),
    # The last measurement, as PX4 takes it.
    "raw": _bank("raw", lambda bias: {Static(drift_psd=2.0, bias=bias): 1.0}, carried_share=0.0),
    "constant_velocity": _bank("constant_velocity", lambda bias: {ConstantVelocity(bias=bias): 1.0}),
    "constant_acceleration": _bank("constant_acceleration", lambda bias: {ConstantAcceleration(bias=bias): 1.0}),
    "coordinated_turn": _bank("coordinated_turn", lambda bias: {CoordinatedTurn(bias=bias): 1.0}),
    "weaving_turn": _bank("weaving_turn", lambda bias: {WeavingTurn(bias=bias): 1.0}),
    "unicycle": _unicycle("unicycle"),
    "unicycle_turn": _unicycle("unicycle_turn", theta_psd=0.005, turn_gain_hz=1.5, unseen_turn_rad_s=0.6),
    "bearing_ukf": _bearing_ukf,
}


def make_tracker(config: Estimation, pad: Pad, cameras: Mapping[str, Camera]) -> PadTracker:
    """The tracker with the estimator that `config.estimator` names; KeyError where there is none of that name."""
    warm_up()
    return PadTracker(config, pad, cameras, ESTIMATORS[config.estimator](config))
