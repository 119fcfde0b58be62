"""What a bank's track tells as the PadEstimate message, in O; `moved` brings it to W. Called by bank_track.py and tracker.py."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from companion.estimation import bank
from companion.estimation.bank import Member
from companion.estimation.gate import NS
from companion.estimation.motion import SHARED, VX, VY, X, Y
from companion.estimation.vertical import VerticalView
from companion.geometry import add, wrap_pi
from companion.messages import PadEstimate, Vec3

MOVING_M_S = 0.5
"""Above this speed a pad whose yaw was never seen is taken to point where it goes."""


@dataclass(frozen=True, slots=True)
class TrackView:
    """A track as far as it is told: `yaw` is the heading filter's yaw and rate, `tilt_rad` roll and pitch, `systematic_m2` the
    variance that sights share."""

    t_ns: int
    members: Sequence[Member]
    deck: VerticalView
    yaw: tuple[float, float] | None
    tilt_rad: tuple[float, float]
    systematic_m2: float
    vision_ns: int | None
    beacon_ns: int | None


def estimate_of(track: TrackView, name: str) -> PadEstimate:
    """The track as the message. Positions are in O: tracker.py moves them to W."""
    now = bank.combined(track.members)
    x, deck = now.x, track.deck
    turn = now.motion.turn_rate_rad_s
    yaw, yaw_rate = _yaw(track, x[VX], x[VY], turn)
    acceleration = now.motion.acceleration_m_s2
    roll, pitch = track.tilt_rad
    best = max(track.members, key=lambda member: member.probability)
    return PadEstimate(
        t_ns=track.t_ns,
        position_ned_m=(x[X], x[Y], deck.z_m),
        velocity_ned_m_s=(x[VX], x[VY], deck.rate_m_s),
        acceleration_ned_m_s2=(acceleration[0], acceleration[1], deck.acceleration_m_s2),
        yaw_rad=yaw,
        yaw_rate_rad_s=yaw_rate,
        covariance=_covariance(now.P, deck, track.systematic_m2),
        vision_age_s=_age_s(track.t_ns, track.vision_ns),
        beacon_age_s=_age_s(track.t_ns, track.beacon_ns),
        model=best.model.name if len(track.members) > 1 else name,
        model_probabilities=tuple((member.model.name, member.probability) for member in track.members),
        roll_rad=roll,
        pitch_rad=pitch,
    )


def _yaw(track: TrackView, vx: float, vy: float, turn: float) -> tuple[float, float]:
    """Measured yaw where there is one, else the direction of travel. Models that turn know the yaw better than the heading
    filter, in proportion to their probability."""
    if track.yaw is None:
        return (math.atan2(vy, vx) if math.hypot(vx, vy) > MOVING_M_S else 0.0), turn
    yaw, rate = track.yaw
    correction = rate_correction = 0.0
    for member in track.members:
        yaw_index, turn_index = member.model.yaw_index, member.model.turn_index
        if yaw_index is not None and turn_index is not None:
            correction += member.probability * wrap_pi(member.x[yaw_index] - yaw)
            rate_correction += member.probability * (member.x[turn_index] - rate)
    return wrap_pi(yaw + correction), rate + rate_correction


def _covariance(P: list[float], deck: VerticalView, systematic_m2: float) -> tuple[tuple[float, ...], ...]:
    """6 x 6 over (position, velocity). Averaging does not remove the systematic part, so it is added at the end."""
    north, east, vn, ve = (
        [P[at + X], P[at + Y], 0.0, P[at + VX], P[at + VY], 0.0] for at in (SHARED * i for i in (X, Y, VX, VY))
    )
    north[0] += systematic_m2
    east[1] += systematic_m2
    down = (0.0, 0.0, deck.variance_m2, 0.0, 0.0, deck.covariance)
    rate = (0.0, 0.0, deck.covariance, 0.0, 0.0, deck.rate_variance)
    return tuple(north), tuple(east), down, tuple(vn), tuple(ve), rate


def _age_s(t_ns: int, then_ns: int | None) -> float | None:
    return None if then_ns is None else (t_ns - then_ns) / NS


def moved(estimate: PadEstimate, offset_m: Vec3, velocity_m_s: Vec3) -> PadEstimate:
    """The same estimate with positions moved by `offset_m` (O to W) and seen from a frame in which O moves with `velocity_m_s`."""
    e = estimate  # written out: dataclasses.replace takes twice as long, and every tick and frame asks
    return PadEstimate(
        t_ns=e.t_ns,
        position_ned_m=add(e.position_ned_m, offset_m),
        velocity_ned_m_s=add(e.velocity_ned_m_s, velocity_m_s),
        acceleration_ned_m_s2=e.acceleration_ned_m_s2,
        yaw_rad=e.yaw_rad,
        yaw_rate_rad_s=e.yaw_rate_rad_s,
        covariance=e.covariance,
        vision_age_s=e.vision_age_s,
        beacon_age_s=e.beacon_age_s,
        model=e.model,
        model_probabilities=e.model_probabilities,
        roll_rad=e.roll_rad,
        pitch_rad=e.pitch_rad,
    )
