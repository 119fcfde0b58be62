"""What a pad estimator is. Frame O (NED axes, see vehicle_history.py), SI."""

from __future__ import annotations

from typing import Protocol

from companion.estimation.measurement import PadMeasurement
from companion.estimation.outlook import DeckMotion, PadMotion
from companion.messages import MeasurementVerdict, PadEstimate


class PadEstimator(Protocol):
    """Where the pad is, from measurements that may be late and in any order. Deterministic: same calls, same answers."""

    def observe(self, measurement: PadMeasurement) -> MeasurementVerdict:
        """Fuse a measurement at its time; say whether and why not."""

    def estimate(self, t_ns: int) -> PadEstimate | None:
        """State and covariance at any time from the oldest kept measurement on; None when there is no pad."""

    def motion(self, t_ns: int) -> PadMotion | None:
        """The means of `estimate(t_ns)` alone, to the same bits: asked ahead at every tick."""

    def deck(self, t_ns: int) -> DeckMotion | None:
        """Vertical speed and tilt of `estimate(t_ns)` alone, to the same bits: asked seconds ahead where the vehicle is low."""

    def reset(self) -> None:
        """Forget everything."""
