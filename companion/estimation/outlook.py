"""Where the pad will be and how it will move, without how sure that is: what control and mission ask for at every tick.

A whole estimate ahead costs a covariance for each motion model, which nobody reads there. An outlook moves means alone, to the
same bits as the estimate of that time would hold. Frame O, NED, SI. Called by filter.py.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol, Self

from companion.estimation import bank
from companion.estimation.bank import Member
from companion.estimation.gate import NS
from companion.estimation.oscillator import MEAN, SWING, Oscillator
from companion.estimation.vertical import State, Vertical
from companion.geometry import add
from companion.messages import PadEstimate, Vec3


@dataclass(frozen=True, slots=True)
class PadMotion:
    """Position (m), velocity (m/s) and acceleration (m/s^2) of the pad, NED; roll and pitch (rad)."""

    position_ned_m: Vec3
    velocity_ned_m_s: Vec3
    acceleration_ned_m_s2: Vec3
    roll_rad: float
    pitch_rad: float

    def moved(self, offset_m: Vec3, velocity_m_s: Vec3) -> PadMotion:
        """The same with the position moved by `offset_m` (O to W), seen from a frame in which O moves with `velocity_m_s`."""
        position, velocity = add(self.position_ned_m, offset_m), add(self.velocity_ned_m_s, velocity_m_s)
        return PadMotion(position, velocity, self.acceleration_ned_m_s2, self.roll_rad, self.pitch_rad)


class DeckMotion(NamedTuple):
    """What the deck does whatever way the pad goes: vertical speed (m/s, down positive), roll and pitch (rad)."""

    down_m_s: float
    roll_rad: float
    pitch_rad: float

    def moved(self, velocity_m_s: Vec3) -> DeckMotion:
        """The same seen from a frame in which O moves with `velocity_m_s`."""
        return DeckMotion(self.down_m_s + velocity_m_s[2], self.roll_rad, self.pitch_rad)


class Outlook(Protocol):
    """The pad's mean at `t_ns`; it never changes the track it was made from."""

    @property
    def t_ns(self) -> int: ...

    def copied(self) -> Self: ...

    def look_ahead(self, t_ns: int) -> None: ...

    def motion(self) -> PadMotion: ...

    def deck(self) -> DeckMotion: ...


@dataclass(slots=True)
class BankOutlook:
    """Of a bank of models. Means are its own, covariances the track's, left as they are; `level` holds roll and pitch (rad)
    where nothing says how they swing. Without `members` it knows the deck only."""

    t_ns: int
    members: list[Member]
    vertical: Vertical
    height: State
    swing: Oscillator | None
    tilt: tuple[State, State] | None
    level: tuple[float, float]

    def copied(self) -> BankOutlook:
        members = [member.with_own_mean() for member in self.members]
        tilt = None if self.tilt is None else (_with_own_mean(self.tilt[0]), _with_own_mean(self.tilt[1]))
        return BankOutlook(self.t_ns, members, self.vertical, _with_own_mean(self.height), self.swing, tilt, self.level)

    def look_ahead(self, t_ns: int) -> None:
        dt_s = (t_ns - self.t_ns) / NS
        if dt_s <= 0.0:
            return
        self.members = bank.likely(self.members)
        for member in self.members:
            member.model.move(member.x, dt_s)
        self.vertical.move(self.height[0], dt_s)
        if self.swing is not None and self.tilt is not None:
            for x, _ in self.tilt:
                self.swing.move(x, dt_s)
        self.t_ns = t_ns

    def motion(self) -> PadMotion:
        north, east, vn, ve = bank.mean_position_and_velocity(self.members)
        acceleration = bank.mean_motion(self.members).acceleration_m_s2
        height, (down_m_s, roll, pitch) = self.vertical.view(self.height), self.deck()
        return PadMotion(
            position_ned_m=(north, east, height.z_m),
            velocity_ned_m_s=(vn, ve, down_m_s),
            acceleration_ned_m_s2=(*acceleration, height.acceleration_m_s2),
            roll_rad=roll,
            pitch_rad=pitch,
        )

    def deck(self) -> DeckMotion:
        roll, pitch = self.level if self.tilt is None else (x[MEAN] + x[SWING] for x, _ in self.tilt)
        return DeckMotion(self.vertical.view(self.height).rate_m_s, roll, pitch)


def _with_own_mean(state: State) -> State:
    return state[0][:], state[1]


class Foreseen(Protocol):
    """Of a track, what looking ahead needs."""

    t_ns: int

    def copied(self) -> Self: ...

    def look_ahead(self, t_ns: int) -> None:
        """Predict to `t_ns` in order to look: a bank then does without exchange between its models."""

    def estimate(self, name: str) -> PadEstimate: ...


@dataclass(slots=True)
class WholeOutlook:
    """Of a track that has no cheaper way than to be predicted whole."""

    track: Foreseen

    @property
    def t_ns(self) -> int:
        return self.track.t_ns

    def copied(self) -> WholeOutlook:
        return WholeOutlook(self.track.copied())

    def look_ahead(self, t_ns: int) -> None:
        self.track.look_ahead(t_ns)

    def motion(self) -> PadMotion:
        then = self.track.estimate("outlook")
        return PadMotion(
            then.position_ned_m, then.velocity_ned_m_s, then.acceleration_ned_m_s2, then.roll_rad, then.pitch_rad
        )

    def deck(self) -> DeckMotion:
        then = self.track.estimate("outlook")
        return DeckMotion(then.velocity_ned_m_s[2], then.roll_rad, then.pitch_rad)
