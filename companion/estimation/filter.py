"""A PadEstimator over a Track: late and out-of-order measurements by history, prediction to any time. Frame O, NED, SI.

Every fused measurement is kept with the track as it was just after it. One that belongs before others is put in its place:
the track of before is taken up again and the later ones are fused once more. Called by tracker.py.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass, replace

from companion.estimation import bank, heading, vertical
from companion.estimation.gate import NS
from companion.estimation.measurement import PadMeasurement
from companion.estimation.motion import SHARED, VX, VY, X, Y
from companion.estimation.track import Track, TrackSettings, advance, fuse, shift_velocity, started
from companion.geometry import wrap_pi
from companion.messages import MeasurementVerdict, PadEstimate, Vec3

COAST_STEP_NS = 100_000_000
LOOK_AHEAD_NS = 500_000_000
"""A track that coasts is advanced on a grid and kept, so that a long outage costs each query no more than this."""
MOVING_M_S = 0.5
"""Above this speed a pad whose yaw was never seen is taken to point where it goes."""


@dataclass(slots=True)
class Fused:
    """A measurement in the history and the track just after it. `velocity_step` replaces the measurement for a reset."""

    t_ns: int
    measurement: PadMeasurement | None
    velocity_step_m_s: Vec3
    after: Track


class PadFilter:
    """The bank of motion models in `settings` behind the PadEstimator protocol."""

    def __init__(self, name: str, settings: TrackSettings, *, lag_s: float = 1.0, lost_after_s: float = 15.0) -> None:
        self._name = name
        self._settings = settings
        self._lag_ns = int(lag_s * NS)
        self._lost_ns = int(lost_after_s * NS)
        self._history: list[Fused] = []
        self._coasting: Track | None = None

    def reset(self) -> None:
        self._history.clear()
        self._coasting = None

    def observe(self, measurement: PadMeasurement) -> MeasurementVerdict:
        """Fuse at the time of capture, whatever the order of arrival."""
        m = measurement
        if self._history and m.t_ns - self._history[-1].t_ns > self._lost_ns:
            self.reset()
        if not self._history:
            return self._begin(m)
        if m.t_ns < self._history[0].t_ns or m.t_ns < self._history[-1].t_ns - self._lag_ns:
            return MeasurementVerdict(m.t_ns, m.source, accepted=False, reason="older than the history")
        verdict = self._insert(m)
        self._prune()
        return verdict

    def shift_velocity(self, t_ns: int, step_m_s: Vec3) -> None:
        """The autopilot's velocity estimate stepped at `t_ns`."""
        if not self._history:
            return
        index = bisect_right(self._history, t_ns, key=lambda fused: fused.t_ns)
        self._put(max(index, 1), max(t_ns, self._history[0].t_ns), None, step_m_s)

    def estimate(self, t_ns: int) -> PadEstimate | None:
        """The pad at `t_ns`, past (within the history), now or ahead; None before the first sight and when long lost."""
        track = self._track_before(t_ns)
        if track is None or t_ns - self._history[-1].t_ns > self._lost_ns:
            return None
        track = track.copied()
        advance(self._settings, track, t_ns, mixing=False)
        return estimate_of(track, self._name)

    def _begin(self, m: PadMeasurement) -> MeasurementVerdict:
        track = started(self._settings, m)
        if track is None:
            return MeasurementVerdict(m.t_ns, m.source, accepted=False, reason="no position to start from")
        self._history.append(Fused(m.t_ns, m, (0.0, 0.0, 0.0), track))
        return MeasurementVerdict(m.t_ns, m.source, accepted=True, reason="first sight")

    def _insert(self, m: PadMeasurement) -> MeasurementVerdict:
        index = bisect_right(self._history, m.t_ns, key=lambda fused: fused.t_ns)
        verdict = self._put(index, m.t_ns, m, (0.0, 0.0, 0.0))
        assert verdict is not None
        return verdict

    def _put(self, index: int, t_ns: int, m: PadMeasurement | None, velocity_step: Vec3) -> MeasurementVerdict | None:
        """Put a new entry at `index` of the history and work all later ones in again."""
        self._coasting = None
        later = self._history[index:]
        del self._history[index:]
        verdict = self._append(t_ns, m, velocity_step)
        for fused in later:
            self._append(fused.t_ns, fused.measurement, fused.velocity_step_m_s)
        return verdict

    def _append(self, t_ns: int, m: PadMeasurement | None, velocity_step: Vec3) -> MeasurementVerdict | None:
        track = self._history[-1].after.copied()
        advance(self._settings, track, t_ns)
        shift_velocity(track, velocity_step)
        verdict = None if m is None else fuse(self._settings, track, m)
        self._history.append(Fused(t_ns, m, velocity_step, track))
        return verdict

    def _prune(self) -> None:
        """Keep one entry from before the lag: late measurements start from it."""
        oldest_ns = self._history[-1].t_ns - self._lag_ns
        keep = bisect_right(self._history, oldest_ns, key=lambda fused: fused.t_ns) - 1
        if keep > 0:
            del self._history[:keep]

    def _track_before(self, t_ns: int) -> Track | None:
        """The newest track not after `t_ns`; a coasting one where that is far back."""
        if not self._history or t_ns < self._history[0].t_ns:
            return None
        newest = self._history[-1].after
        if t_ns < newest.t_ns:
            index = bisect_right(self._history, t_ns, key=lambda fused: fused.t_ns) - 1
            return self._history[index].after
        steps = (t_ns - newest.t_ns - LOOK_AHEAD_NS) // COAST_STEP_NS
        return newest if steps <= 0 else self._coasted(newest, newest.t_ns + steps * COAST_STEP_NS)

    def _coasted(self, newest: Track, until_ns: int) -> Track:
        """On the same grid whatever was asked before, so that the answer depends on the measurements alone."""
        track = self._coasting
        if track is None or track.t_ns > until_ns:
            track = newest.copied()
        while track.t_ns < until_ns:
            advance(self._settings, track, track.t_ns + COAST_STEP_NS, mixing=False)
        self._coasting = track
        return track


def estimate_of(track: Track, name: str) -> PadEstimate:
    """The track as the message. Positions are in O: tracker.py moves them to W."""
    now = bank.combined(track.members)
    x, (z, Pz) = now.x, track.height
    turn = now.motion.turn_rate_rad_s
    yaw, yaw_rate = _yaw(track, x[VX], x[VY], turn)
    acceleration = now.motion.acceleration_m_s2
    best = max(track.members, key=lambda member: member.probability)
    return PadEstimate(
        t_ns=track.t_ns,
        position_ned_m=(x[X], x[Y], z[vertical.Z]),
        velocity_ned_m_s=(x[VX], x[VY], z[vertical.VZ]),
        acceleration_ned_m_s2=(acceleration[0], acceleration[1], 0.0),
        yaw_rad=yaw,
        yaw_rate_rad_s=yaw_rate,
        covariance=_covariance(now.P, Pz, track.systematic_m2),
        vision_age_s=_age_s(track.t_ns, track.vision_ns),
        beacon_age_s=_age_s(track.t_ns, track.beacon_ns),
        model=best.model.name if len(track.members) > 1 else name,
        model_probabilities=tuple((member.model.name, member.probability) for member in track.members),
        roll_rad=track.roll_rad,
        pitch_rad=track.pitch_rad,
    )


def _yaw(track: Track, vx: float, vy: float, turn: float) -> tuple[float, float]:
    """Measured yaw where there is one, else the direction of travel."""
    if track.yaw is not None:
        x = track.yaw[0]
        return wrap_pi(x[heading.YAW]), x[heading.RATE]
    return (math.atan2(vy, vx) if math.hypot(vx, vy) > MOVING_M_S else 0.0), turn


def _covariance(P: list[float], Pz: list[float], systematic_m2: float) -> tuple[tuple[float, ...], ...]:
    """6 x 6 over (position, velocity). Averaging does not remove the systematic part, so it is added at the end."""
    order = (X, Y, None, VX, VY, None)
    rows = [[0.0 if a is None or b is None else P[a * SHARED + b] for b in order] for a in order]
    rows[0][0] += systematic_m2
    rows[1][1] += systematic_m2
    rows[2][2], rows[2][5], rows[5][2], rows[5][5] = Pz[0], Pz[1], Pz[3], Pz[4]
    return tuple(tuple(row) for row in rows)


def _age_s(t_ns: int, then_ns: int | None) -> float | None:
    return None if then_ns is None else (t_ns - then_ns) / NS


def moved(estimate: PadEstimate, offset_m: Vec3) -> PadEstimate:
    """The same estimate with positions moved by `offset_m` (O to W)."""
    p = estimate.position_ned_m
    return replace(estimate, position_ned_m=(p[0] + offset_m[0], p[1] + offset_m[1], p[2] + offset_m[2]))
