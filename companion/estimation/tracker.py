"""From the messages of the pipeline to the pad in W: vehicle history, conversion to frame O, the chosen filter, and back.

The whole of estimation for a caller: give it every VehicleState, PadObservation, PadBearing, PadBeacon and
RangeMeasurement, and ask where the pad is. Results are in W (NED) with the offset of the *latest* vehicle state, so
`pad - vehicle` in W is the same difference as in O: the autopilot's position corrections and resets cancel in it. So does its velocity
error: the pad's velocity is told, and the pad foretold, as the autopilot would measure it.
Called by pipeline.py.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from companion.config import Camera, Estimation, Pad
from companion.estimation.bank_report import moved
from companion.estimation.gate import NS
from companion.estimation.measurement import (
    PadMeasurement,
    VehicleErrors,
    foot_of_range,
    measurement_from_beacon,
    measurement_from_bearing,
    measurement_from_observation,
    measurement_from_range,
)
from companion.estimation.outlook import DeckMotion, PadMotion
from companion.estimation.protocol import PadEstimator
from companion.estimation.vehicle_history import VehicleHistory, VehiclePose, VehicleReset
from companion.geometry import add, scale
from companion.messages import (
    MeasurementVerdict,
    ObservationSource,
    PadBeacon,
    PadBearing,
    PadEstimate,
    PadObservation,
    RangeMeasurement,
    Vec3,
    VehicleState,
)
from companion.mount import mounted

RECENT_NS = 100_000_000
SEEN_S = 0.2
"""While vision is younger than this the range sensor adds nothing to the height that vision gives; a bearing gives none."""

CONTINUED_NS = 30_000_000
"""How far ahead of the vehicle's last state a sight is fused: a period and a half of 50 Hz. Where the link is slower than
the camera, a sight waits for the state of its time: an attitude continued over 0.15 s is off by degrees in a manoeuvre."""

PadSight = PadObservation | PadBearing | PadBeacon | RangeMeasurement
SOURCES: dict[type, ObservationSource] = {
    PadObservation: ObservationSource.VISION_POSE,
    PadBearing: ObservationSource.VISION_BEARING,
    PadBeacon: ObservationSource.BEACON,
    RangeMeasurement: ObservationSource.RANGE,
}


class PadTracker:
    """One pad, one vehicle."""

    def __init__(self, config: Estimation, pad: Pad, cameras: Mapping[str, Camera], estimator: PadEstimator) -> None:
        self._config = config
        self._pad = pad
        self._mounts = {name: mounted(camera) for name, camera in cameras.items()}
        self._errors = VehicleErrors(
            tilt_rad=math.radians(config.vehicle_tilt_sigma_deg),
            yaw_rad=math.radians(config.vehicle_yaw_sigma_deg),
            velocity_m_s=config.vehicle_velocity_sigma_m_s,
        )
        self._estimator = estimator
        self._recent: PadEstimate | None = None
        self._sees_bearings = False
        self._waiting: list[PadSight] = []
        self.history = VehicleHistory(config.history_s)

    def add_vehicle_state(self, state: VehicleState) -> VehicleReset | None:
        """Take the vehicle's state; returns the reset of the autopilot's estimator that it shows, if any."""
        return self.history.add(state)

    def observe(self, message: PadSight) -> MeasurementVerdict | None:
        """Fuse one message at the time it was true.

        None where there is nothing to judge (no reading, not over the pad), or not yet: the vehicle's state of that time
        is still on its way, and `observe_waiting` says more.
        """
        vehicle = self.history.at(message.t_ns)
        if vehicle is not None and self._is_early(message):
            self._waiting.append(message)
            return None
        return self._fuse(message, vehicle)

    def observe_waiting(self) -> list[MeasurementVerdict]:
        """Fuse what waited for the vehicle's state and need not wait any more."""
        if not self._waiting:
            return []
        due = [message for message in self._waiting if not self._is_early(message)]
        self._waiting = [message for message in self._waiting if self._is_early(message)]
        verdicts = (self._fuse(message, self.history.at(message.t_ns)) for message in due)
        return [verdict for verdict in verdicts if verdict is not None]

    def _is_early(self, message: PadSight) -> bool:
        vehicle = self.history.latest
        return vehicle is not None and message.t_ns > vehicle.t_ns + CONTINUED_NS

    def _fuse(self, message: PadSight, vehicle: VehiclePose | None) -> MeasurementVerdict | None:
        if vehicle is None:
            return _refused(message, "no vehicle state at that time")
        if isinstance(message, RangeMeasurement):
            return self._observe_range(message, vehicle)
        measurement = self._measurement(message, vehicle)
        if measurement is None:
            return _refused(message, "unknown camera")
        return self._estimator.observe(measurement)

    def estimate(self, t_ns: int) -> PadEstimate | None:
        """The pad in W at `t_ns`, now or ahead. A pure question: whoever asks, and how often, changes nothing."""
        return self._in_w(self._estimator.estimate(t_ns), t_ns)

    def estimate_now(self, t_ns: int) -> PadEstimate | None:
        """The same for the tick at `t_ns`; kept for judging the range readings until the next."""
        estimate, vehicle = self._estimator.estimate(t_ns), self.history.latest
        if estimate is not None and vehicle is not None and t_ns <= vehicle.t_ns + RECENT_NS:
            self._recent = estimate
        return self._in_w(estimate, t_ns)

    def _in_w(self, estimate: PadEstimate | None, t_ns: int) -> PadEstimate | None:
        vehicle = self.history.latest
        return None if estimate is None or vehicle is None else moved(estimate, *_seen_from_w(vehicle, t_ns))

    def motion(self, t_ns: int) -> PadMotion | None:
        """Where the pad is in W and how it moves at `t_ns`, most often ahead: the means of `estimate(t_ns)`."""
        vehicle, motion = self.history.latest, self._estimator.motion(t_ns)
        return None if vehicle is None or motion is None else motion.moved(*_seen_from_w(vehicle, t_ns))

    def deck(self, t_ns: int) -> DeckMotion | None:
        """Vertical speed in W and tilt of `estimate(t_ns)`."""
        vehicle, deck = self.history.latest, self._estimator.deck(t_ns)
        return None if vehicle is None or deck is None else deck.moved(_seen_from_w(vehicle, t_ns)[1])

    def reset(self) -> None:
        """Forget the pad, not the vehicle."""
        self._estimator.reset()
        self._recent = None

    def _measurement(
        self, message: PadObservation | PadBearing | PadBeacon, vehicle: VehiclePose
    ) -> PadMeasurement | None:
        if isinstance(message, PadBeacon):
            noise = self._config.beacon_noise_sigma_m
            return measurement_from_beacon(message, vehicle, noise_sigma_m=noise, errors=self._errors)
        mount = self._mounts.get(message.camera)
        if mount is None:
            return None
        self._sees_bearings = isinstance(message, PadBearing)
        if isinstance(message, PadBearing):
            return measurement_from_bearing(message, vehicle, mount, self._errors)
        return measurement_from_observation(message, vehicle, mount, self._errors)

    def _observe_range(self, message: RangeMeasurement, vehicle: VehiclePose) -> MeasurementVerdict | None:
        """The range sensor tells of the deck only where its beam surely meets it, and is needed where vision is not."""
        distance = message.distance_m
        if distance is None or not message.min_distance_m <= distance <= message.max_distance_m:
            return None
        estimate = self._recent_estimate(message.t_ns)
        height_is_seen = estimate is not None and _is_seen(estimate) and not self._sees_bearings
        if estimate is None or height_is_seen or not self._is_deck(estimate, foot_of_range(distance, vehicle)):
            return None
        return self._estimator.observe(measurement_from_range(message.t_ns, distance, vehicle))

    def _recent_estimate(self, t_ns: int) -> PadEstimate | None:
        """The last tick's, where that is not long ago: enough to know whether the vehicle is above the deck."""
        recent = self._recent
        if recent is not None and abs(t_ns - recent.t_ns) <= RECENT_NS:
            return recent
        return self._estimator.estimate(t_ns)

    def _is_deck(self, estimate: PadEstimate, foot_o_m: Vec3) -> bool:
        """A vehicle that leans looks beside what it is above."""
        offset = math.hypot(estimate.position_ned_m[0] - foot_o_m[0], estimate.position_ned_m[1] - foot_o_m[1])
        half = 0.5 * min(self._pad.length_m, self._pad.width_m)
        return offset + 2.0 * estimate.position_sigma_m < half


def _seen_from_w(vehicle: VehiclePose, t_ns: int) -> tuple[Vec3, Vec3]:
    """Where O is at `t_ns` (m) and how fast it moves (m/s), for one who takes the autopilot's velocity for true."""
    ahead_s = max(0.0, (t_ns - vehicle.t_ns) / NS)
    velocity = scale(vehicle.correction_m_s, -1.0)
    return add(vehicle.offset_m, scale(velocity, ahead_s)), velocity


def _is_seen(estimate: PadEstimate) -> bool:
    return estimate.vision_age_s is not None and estimate.vision_age_s < SEEN_S


def _refused(message: PadSight, reason: str) -> MeasurementVerdict:
    return MeasurementVerdict(message.t_ns, SOURCES[type(message)], accepted=False, reason=reason)
