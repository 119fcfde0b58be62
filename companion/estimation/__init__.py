"""Estimation: where the pad is and will be, with an honest uncertainty.

`PadTracker` is what the pipeline uses. An estimator is chosen by `estimation.estimator`; each motion model stands in its own
file and can be chosen alone, `imm` runs several. docs/estimation.md explains the frame O and the models.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from companion.config import Camera, Estimation, Pad
from companion.estimation.constant_acceleration import ConstantAcceleration
from companion.estimation.constant_velocity import ConstantVelocity
from companion.estimation.coordinated_turn import CoordinatedTurn
from companion.estimation.filter import PadFilter
from companion.estimation.measurement import PadMeasurement
from companion.estimation.motion import BeaconBias, MotionModel
from companion.estimation.protocol import PadEstimator
from companion.estimation.track import TrackSettings, gate_sigmas
from companion.estimation.tracker import PadTracker, camera_mount
from companion.estimation.vehicle_history import VehicleHistory, VehiclePose, VehicleReset
from companion.estimation.weaving_turn import WeavingTurn

__all__ = [
    "ESTIMATORS",
    "PadEstimator",
    "PadMeasurement",
    "PadTracker",
    "VehicleHistory",
    "VehiclePose",
    "VehicleReset",
    "camera_mount",
    "make_tracker",
]


def _bias(config: Estimation) -> BeaconBias:
    return BeaconBias(config.beacon_bias_sigma_m, config.beacon_bias_time_s)


def _settings(config: Estimation, models: tuple[MotionModel, ...], probabilities: tuple[float, ...]) -> TrackSettings:
    return TrackSettings(models, probabilities, gate_sigmas=gate_sigmas(config.gate_probability))


def _filter(name: str, settings: TrackSettings, config: Estimation) -> PadEstimator:
    return PadFilter(name, settings, lag_s=config.lag_s, lost_after_s=config.lost_after_s)


def constant_velocity(config: Estimation) -> PadEstimator:
    return _filter("constant_velocity", _settings(config, (ConstantVelocity(bias=_bias(config)),), (1.0,)), config)


def constant_acceleration(config: Estimation) -> PadEstimator:
    return _filter(
        "constant_acceleration", _settings(config, (ConstantAcceleration(bias=_bias(config)),), (1.0,)), config
    )


def coordinated_turn(config: Estimation) -> PadEstimator:
    return _filter("coordinated_turn", _settings(config, (CoordinatedTurn(bias=_bias(config)),), (1.0,)), config)


def imm(config: Estimation) -> PadEstimator:
    bias = _bias(config)
    models = (
        ConstantVelocity(bias=bias),
        CoordinatedTurn(bias=bias),
        WeavingTurn(bias=bias),
        ConstantAcceleration(bias=bias),
    )
    return _filter("imm", _settings(config, models, (0.4, 0.3, 0.2, 0.1)), config)


ESTIMATORS: dict[str, Callable[[Estimation], PadEstimator]] = {
    "imm": imm,
    "constant_velocity": constant_velocity,
    "constant_acceleration": constant_acceleration,
    "coordinated_turn": coordinated_turn,
}


def make_tracker(config: Estimation, pad: Pad, cameras: Mapping[str, Camera]) -> PadTracker:
    """The tracker with the estimator that `config.estimator` names; KeyError where there is none of that name."""
    return PadTracker(config, pad, cameras, ESTIMATORS[config.estimator](config))
