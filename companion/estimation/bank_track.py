"""One pad at one instant: the bank for the horizontal motion, height, yaw, gates and ages. Frame O, NED, SI.

A BankTrack is plain data that `advance` and `fuse` change; `copied` makes the snapshots from which late measurements are worked
in (filter.py).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from statistics import NormalDist

from companion.estimation import bank, heading
from companion.estimation.bank import Member, Mixture, Row
from companion.estimation.bank_report import TrackView, estimate_of
from companion.estimation.gate import AGREEING, NS, AxisGate, Decision, judge
from companion.estimation.heading import SteadyHeading
from companion.estimation.measurement import PadMeasurement
from companion.estimation.motion import BX, BY, SHARED, VX, VY, Motion, MotionModel, X, Y
from companion.estimation.oscillator import MEAN, SWING, Oscillator
from companion.estimation.outlook import BankOutlook
from companion.estimation.vertical import LevelGround, State, Vertical
from companion.geometry import wrap_pi
from companion.messages import Mat3, MeasurementVerdict, ObservationSource, PadEstimate, Vec3

VISION = (ObservationSource.VISION_POSE, ObservationSource.VISION_BEARING)
BIASED = (ObservationSource.BEACON, ObservationSource.ODOMETRY)
VARIANCE_FLOOR_M2 = 1e-4
LEVEL_GROUND = LevelGround()
STEADY_HEADING = SteadyHeading()
MIX_PERIOD_S = 0.09
SHALLOW = 0.1
"""Bearings flatter than this (sine of elevation) do not meet the pad's height at a usable point."""


@dataclass(frozen=True, slots=True)
class TrackSettings:
    """What a track is made of. `gate_sigmas` is the gate of one component in standard deviations."""

    models: tuple[MotionModel, ...]
    probabilities: tuple[float, ...]
    sojourn_s: float = 4.0
    gate_sigmas: float = 3.29
    initial_speed_m_s: float = 5.0
    vertical: Vertical = LEVEL_GROUND
    heading: SteadyHeading = STEADY_HEADING
    tilt: Oscillator | None = None
    """Roll and pitch swing on a boat; on the ground the last measured ones are kept."""
    carried_share: float = 0.5
    """How much of the error that neighbouring sights share (the vehicle's attitude times range) each sight carries as if it were
    its own. That error wanders over seconds: of sights taken for exact to their own noise the bank makes a motion of the pad."""


def gate_sigmas(probability: float) -> float:
    """Two-sided gate of a scalar that a true measurement passes with `probability`."""
    return NormalDist().inv_cdf(0.5 + 0.5 * probability)


@dataclass(slots=True)
class BankTrack:
    """State at `t_ns`."""

    settings: TrackSettings
    t_ns: int
    members: list[Member]
    height: State
    yaw: tuple[list[float], list[float]] | None
    gates: dict[tuple[ObservationSource, str], AxisGate] = field(default_factory=dict)
    vision_ns: int | None = None
    beacon_ns: int | None = None
    systematic_m2: float = 0.0
    unmixed_s: float = 0.0
    tilt: tuple[State, State] | None = None
    roll_rad: float = 0.0
    pitch_rad: float = 0.0

    def advance(self, t_ns: int) -> None:
        """Predict to `t_ns`, not before the track's time, and let the models exchange what they know when it is due."""
        dt_s = (t_ns - self.t_ns) / NS
        if dt_s > 0.0:
            _mix_when_due(self, dt_s)
            self._predict(t_ns, dt_s)

    def look_ahead(self, t_ns: int) -> None:
        """Predict without exchange; models that nearly nothing speaks for are left out."""
        dt_s = (t_ns - self.t_ns) / NS
        if dt_s > 0.0:
            self.members = bank.likely(self.members)
            self._predict(t_ns, dt_s)

    def _predict(self, t_ns: int, dt_s: float) -> None:
        bank.predict(self.members, dt_s)
        self.settings.vertical.predict(self.height, dt_s)
        if self.yaw is not None:
            self.settings.heading.predict(*self.yaw, dt_s)
        _predict_tilt(self, dt_s)
        self.t_ns = t_ns

    def fuse(self, m: PadMeasurement) -> MeasurementVerdict:
        """Fuse a measurement of the track's own time, component by component, and say what became of it."""
        return fuse(self, m)

    def estimate(self, name: str) -> PadEstimate:
        view = TrackView(
            t_ns=self.t_ns,
            members=self.members,
            deck=self.settings.vertical.view(self.height),
            yaw=None if self.yaw is None else (self.yaw[0][heading.YAW], self.yaw[0][heading.RATE]),
            tilt_rad=self.tilt_angles(),
            systematic_m2=self.systematic_m2,
            vision_ns=self.vision_ns,
            beacon_ns=self.beacon_ns,
        )
        return estimate_of(view, name)

    def outlook(self, *, deck_only: bool) -> BankOutlook:
        s, level, members = self.settings, (self.roll_rad, self.pitch_rad), [] if deck_only else self.members
        return BankOutlook(self.t_ns, members, s.vertical, self.height, s.tilt, self.tilt, level).copied()

    def tilt_angles(self) -> tuple[float, float]:
        """Roll and pitch of the pad, rad."""
        if self.tilt is None:
            return self.roll_rad, self.pitch_rad
        roll, pitch = (x[MEAN] + x[SWING] for x, _ in self.tilt)
        return roll, pitch

    def copied(self) -> BankTrack:
        return BankTrack(
            settings=self.settings,
            t_ns=self.t_ns,
            members=bank.copied(self.members),
            height=self.settings.vertical.copied(self.height),
            yaw=None if self.yaw is None else (self.yaw[0][:], self.yaw[1][:]),
            gates=self.gates.copy(),
            vision_ns=self.vision_ns,
            beacon_ns=self.beacon_ns,
            systematic_m2=self.systematic_m2,
            unmixed_s=self.unmixed_s,
            tilt=None if self.tilt is None else _copied_tilt(self.tilt),
            roll_rad=self.roll_rad,
            pitch_rad=self.pitch_rad,
        )


# ------------------------------------------------------------------------------------------------------------- start


def started(settings: TrackSettings, m: PadMeasurement) -> BankTrack | None:
    """A track from its first measurement, which must hold a position; None otherwise."""
    if m.position_o_m is None or m.covariance_m2 is None:
        return None
    shared = _first_state(settings, m, m.position_o_m, m.covariance_m2)
    bias2 = m.bias_sigma_m**2 if m.source in BIASED else 0.0
    variance = m.covariance_m2[2][2] + VARIANCE_FLOOR_M2
    track = BankTrack(
        settings=settings,
        t_ns=m.t_ns,
        members=bank.start(settings.models, settings.probabilities, shared),
        height=settings.vertical.start(m.position_o_m[2], variance, bias2),
        yaw=None,
    )
    m = _resolved(track, m)
    _take_yaw(track, m)
    _take_turn_rate(track, m)
    _note(track, m)
    return track


def _first_state(settings: TrackSettings, m: PadMeasurement, z: Vec3, R: Mat3) -> Mixture:
    """Shared state: the first position, and either its bias tied to it (beacon) or a bias not yet seen (vision)."""
    P = [0.0] * (SHARED * SHARED)
    bias2 = m.bias_sigma_m**2 if m.source in BIASED else 0.0
    for p, b, axis in ((X, BX, 0), (Y, BY, 1)):
        P[p * SHARED + p] = R[axis][axis] + VARIANCE_FLOOR_M2 + bias2
        P[p * SHARED + b] = P[b * SHARED + p] = -bias2
        P[b * SHARED + b] = bias2 if bias2 > 0.0 else settings.models[0].bias.sigma_m ** 2
    v = m.velocity_m_s if m.velocity_m_s is not None else (0.0, 0.0, 0.0)
    variance = (settings.initial_speed_m_s if m.velocity_m_s is None else m.velocity_sigma_m_s) ** 2
    P[VX * SHARED + VX] = P[VY * SHARED + VY] = variance
    return Mixture([z[0], z[1], 0.0, 0.0, v[0], v[1]], P, Motion((0.0, 0.0), 0.0))


# ------------------------------------------------------------------------------------------------------------ advance


def _mix_when_due(track: BankTrack, dt_s: float) -> None:
    """Mixing costs as much as a prediction, and hypotheses change over seconds: ten times a second is enough."""
    track.unmixed_s += dt_s
    if track.unmixed_s >= MIX_PERIOD_S:
        bank.mix(track.members, track.unmixed_s, track.settings.sojourn_s)
        track.unmixed_s = 0.0


# --------------------------------------------------------------------------------------------------------------- fuse


def fuse(track: BankTrack, m: PadMeasurement) -> MeasurementVerdict:
    """Fuse a measurement of the track's own time, component by component, and say what became of it."""
    if m.bearing_o is not None:
        pseudo = _position_from_bearing(track, m)
        if pseudo is None:
            return MeasurementVerdict(m.t_ns, m.source, accepted=False, reason="bearing too flat for the pad's height")
        m = pseudo
    m = _resolved(track, m)
    now = bank.combined(track.members)
    verdict = _fuse_position(track, m, now)
    _fuse_velocity(track, m)
    _take_yaw(track, m)
    _take_turn_rate(track, m)
    if verdict.accepted:
        _note(track, m)
    return verdict


def _fuse_position(track: BankTrack, m: PadMeasurement, now: Mixture) -> MeasurementVerdict:
    innovation: list[float] = []
    nis, kept, outcomes = 0.0, 0, []
    if m.position_o_m is not None and m.covariance_m2 is not None:
        rows = _rows(track.settings, m, m.position_o_m, m.covariance_m2)
        nis, decisions, innovation = _judge_horizontal(track, m, rows, now)
        outcomes += list(zip(("north", "east"), decisions, strict=True))
        _update_horizontal(track, m, rows, decisions, innovation, m.covariance_m2[0][1])
    height, R = _measured_height(m)
    if height is not None:
        y, s, decision = _fuse_height(track, m, height, R)
        innovation.append(y)
        nis += y * y / s
        outcomes.append(("down", decision))
    kept = sum(decision is not Decision.REJECT for _, decision in outcomes)
    return MeasurementVerdict(
        m.t_ns, m.source, kept > 0 or not outcomes, _reason(outcomes), nis=nis, innovation=tuple(innovation)
    )


def _reason(outcomes: Sequence[tuple[str, Decision]]) -> str:
    """In words: 'fused', or what was not plain about it."""
    rejected = [axis for axis, decision in outcomes if decision is Decision.REJECT]
    reacquired = [axis for axis, decision in outcomes if decision is Decision.REACQUIRE]
    parts = ["outside gate: " + ", ".join(rejected)] if rejected else []
    parts += ["reacquired: " + ", ".join(reacquired)] if reacquired else []
    return "; ".join(parts) or "fused"


def _rows(settings: TrackSettings, m: PadMeasurement, z: Vec3, R: Mat3) -> tuple[Row, Row]:
    if m.source in BIASED:
        return (
            Row((X, BX), (1.0, 1.0), z[0], R[0][0] + VARIANCE_FLOOR_M2),
            Row((Y, BY), (1.0, 1.0), z[1], R[1][1] + VARIANCE_FLOOR_M2),
        )
    more = VARIANCE_FLOOR_M2 + (settings.carried_share * m.systematic_sigma_m) ** 2
    return bank.position_rows((z[0], z[1]), (R[0][0] + more, R[1][1] + more))


def _gate(track: BankTrack, source: ObservationSource, axis: str) -> AxisGate:
    """The track's own: tracks share their gates until one judges anew."""
    gate = track.gates.get((source, axis))
    own = track.gates[source, axis] = AxisGate() if gate is None else gate.copied()
    return own


def _judge_horizontal(
    track: BankTrack, m: PadMeasurement, rows: tuple[Row, Row], now: Mixture
) -> tuple[float, list[Decision], list[float]]:
    """NIS of the pair, one decision an axis, the innovation."""
    y = [row.residual(now.x) for row in rows]
    S = [row.variance(now.P, SHARED) for row in rows]
    gates = [_gate(track, m.source, axis) for axis in ("north", "east")]
    both = all(gate.agreeing >= AGREEING for gate in gates)
    decisions = [
        judge(
            gates[k],
            t_ns=m.t_ns,
            y=y[k],
            S=S[k],
            R=rows[k].R,
            limit=track.settings.gate_sigmas,
            both_axes=both,
        )
        for k in range(2)
    ]
    R_xy = 0.0 if m.covariance_m2 is None else m.covariance_m2[0][1]
    cross = R_xy + rows[0].cross(rows[1], now.P, SHARED)
    det = S[0] * S[1] - cross * cross
    nis = (y[0] * y[0] * S[1] - 2.0 * y[0] * y[1] * cross + y[1] * y[1] * S[0]) / det
    return nis, decisions, y


def _update_horizontal(
    track: BankTrack,
    m: PadMeasurement,
    rows: tuple[Row, Row],
    decisions: Sequence[Decision],
    y: Sequence[float],
    covariance: float,
) -> None:
    """Reacquired axes are trusted less first; what is rejected is left out; what is left is fused."""
    doubted = (BX, BY) if m.source in BIASED else (X, Y)
    for axis in range(2):
        if decisions[axis] is Decision.REACQUIRE:
            for member in track.members:
                n, i = member.model.size, doubted[axis]
                member.P[i * n + i] += y[axis] * y[axis]
    kept = [row for row, decision in zip(rows, decisions, strict=True) if decision is not Decision.REJECT]
    if len(kept) == 2 and m.source not in BIASED:
        kept = list(bank.decorrelated(kept[0], kept[1], covariance))
    if kept:
        bank.update(track.members, kept)


def _measured_height(m: PadMeasurement) -> tuple[float | None, float]:
    if m.height_o_m is not None:
        return m.height_o_m, m.height_sigma_m**2
    if m.position_o_m is None or m.covariance_m2 is None or m.source is ObservationSource.VISION_BEARING:
        return None, 1.0
    return m.position_o_m[2], m.covariance_m2[2][2] + VARIANCE_FLOOR_M2


def _fuse_height(track: BankTrack, m: PadMeasurement, height: float, R: float) -> tuple[float, float, Decision]:
    vertical, biased = track.settings.vertical, m.source in BIASED
    y, S = vertical.innovation(track.height, height, R, biased=biased)
    gate = _gate(track, m.source, "down")
    decision = judge(gate, t_ns=m.t_ns, y=y, S=S, R=R, limit=track.settings.gate_sigmas)
    if decision is Decision.REACQUIRE:
        vertical.distrust(track.height, y * y, biased=biased)
    if decision is not Decision.REJECT:
        vertical.update(track.height, height, R, biased=biased)
    return y, S, decision


def _fuse_velocity(track: BankTrack, m: PadMeasurement) -> None:
    """The carrier's own speed over ground, gated axis by axis."""
    if m.velocity_m_s is None:
        return
    R = m.velocity_sigma_m_s**2
    now = bank.combined(track.members)
    rows = [Row((VX,), (1.0,), m.velocity_m_s[0], R), Row((VY,), (1.0,), m.velocity_m_s[1], R)]
    limit2 = track.settings.gate_sigmas**2
    kept = [row for row in rows if row.residual(now.x) ** 2 <= limit2 * row.variance(now.P, SHARED)]
    if kept:
        bank.update(track.members, kept)


def _take_yaw(track: BankTrack, m: PadMeasurement) -> None:
    """Yaw goes to the heading filter and to the models that turn with it. A flipped yaw is kept out by its gate."""
    _take_tilt(track, m)
    if m.yaw_rad is None:
        return
    R = m.yaw_sigma_rad**2
    if track.yaw is None:
        track.yaw = track.settings.heading.start(m.yaw_rad, R)
        _set_yaw(track, m.yaw_rad, R)
        return
    x, P = track.yaw
    y = wrap_pi(m.yaw_rad - x[heading.YAW])
    gate = _gate(track, m.source, "yaw")
    decision = judge(gate, t_ns=m.t_ns, y=y, S=P[0] + R, R=R, limit=track.settings.gate_sigmas)
    if decision is Decision.REACQUIRE:
        track.yaw = track.settings.heading.start(m.yaw_rad, R)
        _set_yaw(track, m.yaw_rad, R)
    elif decision is Decision.ACCEPT:
        heading.update_yaw(x, P, m.yaw_rad, R)
        for member in track.members:
            index = member.model.yaw_index
            if index is not None:
                bank.update_own(member, index, wrap_pi(m.yaw_rad - member.x[index]), R)


def _resolved(track: BankTrack, m: PadMeasurement) -> PadMeasurement:
    """Of the two poses that explain an ambiguous picture, the one whose tilt the track foresees; level before the first sight.

    The detector chose with what was foreseen when the frame came in; a frame that is worked in late is judged anew. Deck and
    picture are in O, so this holds whatever the vehicle's tilt was.
    """
    rival = m.rival_angles_rad
    if rival is None or m.roll_rad is None or m.pitch_rad is None:
        return m
    foreseen = track.tilt_angles()
    if math.dist(foreseen, rival[:2]) >= math.dist(foreseen, (m.roll_rad, m.pitch_rad)):
        return m
    return replace(m, roll_rad=rival[0], pitch_rad=rival[1], yaw_rad=rival[2])


def _take_tilt(track: BankTrack, m: PadMeasurement) -> None:
    """Roll and pitch of the deck: kept as last seen without doubt, or fed to the oscillators of a boat."""
    if m.roll_rad is None or m.pitch_rad is None:
        return
    swing, R = track.settings.tilt, m.tilt_sigma_rad**2
    if swing is None:
        if m.rival_angles_rad is None:
            track.roll_rad, track.pitch_rad = m.roll_rad, m.pitch_rad
    elif track.tilt is None:
        track.tilt = (swing.start(m.roll_rad, R), swing.start(m.pitch_rad, R))
    else:
        for state, angle in zip(track.tilt, (m.roll_rad, m.pitch_rad), strict=True):
            swing.update(*state, angle, R)


def _predict_tilt(track: BankTrack, dt_s: float) -> None:
    swing = track.settings.tilt
    if swing is not None and track.tilt is not None:
        for state in track.tilt:
            swing.predict(*state, dt_s)


def _copied_tilt(tilt: tuple[State, State]) -> tuple[State, State]:
    (roll, roll_P), (pitch, pitch_P) = tilt
    return (roll[:], roll_P[:]), (pitch[:], pitch_P[:])


def _set_yaw(track: BankTrack, yaw_rad: float, variance: float) -> None:
    """The yaw state of a turning model starts anew; what it says of the turn rate stays."""
    for member in track.members:
        index = member.model.yaw_index
        if index is not None:
            n = member.model.size
            member.x[index] = yaw_rad
            for i in range(n):
                member.P[index * n + i] = member.P[i * n + index] = 0.0
            member.P[index * n + index] = variance


def _take_turn_rate(track: BankTrack, m: PadMeasurement) -> None:
    if m.yaw_rate_rad_s is None:
        return
    R = m.yaw_rate_sigma_rad_s**2
    if track.yaw is not None:
        heading.update_rate(*track.yaw, m.yaw_rate_rad_s, R)
    for member in track.members:
        index = member.model.turn_index
        if index is not None:
            bank.update_own(member, index, m.yaw_rate_rad_s - member.x[index], R)


def _note(track: BankTrack, m: PadMeasurement) -> None:
    if m.source in VISION:
        track.vision_ns = m.t_ns
        track.systematic_m2 = m.systematic_sigma_m**2
    elif m.source in BIASED:
        track.beacon_ns = m.t_ns


def _position_from_bearing(track: BankTrack, m: PadMeasurement) -> PadMeasurement | None:
    """Where the line of sight meets the pad's height: a position whose covariance is long along the line of sight."""
    if m.bearing_o is None or m.camera is None:
        return None
    dx, dy, dz = m.bearing_o
    c = m.camera.position_o_m
    deck = track.settings.vertical.view(track.height)
    drop = deck.z_m - c[2]
    if dz < SHALLOW or drop <= 0.0:
        return None
    distance = drop / dz
    across = (distance * m.bearing_sigma_rad) ** 2
    along = across / (dz * dz) + deck.variance_m2 * (dx * dx + dy * dy) / (dz * dz)
    flat = math.hypot(dx, dy)
    ux, uy = (dx / flat, dy / flat) if flat > 1e-9 else (1.0, 0.0)
    xy = (along - across) * ux * uy
    covariance = (
        (across + (along - across) * ux * ux, xy, 0.0),
        (xy, across + (along - across) * uy * uy, 0.0),
        (0.0, 0.0, 1.0),
    )
    position = (c[0] + distance * dx, c[1] + distance * dy, deck.z_m)
    return PadMeasurement(t_ns=m.t_ns, source=m.source, position_o_m=position, covariance_m2=covariance)
