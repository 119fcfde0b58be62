"""How the pad will move a moment from now, without how sure that is: what the control law asks for at every tick.

A whole estimate ahead costs a covariance for each motion model, which nobody reads there. An outlook moves means alone, to the
same bits as the estimate of that time would hold. Frame O, NED, SI. Called by filter.py.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, Self

from companion.estimation import bank
from companion.estimation.gate import NS
from companion.messages import Vec3

if TYPE_CHECKING:
    from companion.estimation.bank import Member
    from companion.estimation.filter import Track
    from companion.estimation.vertical import State, Vertical


@dataclass(frozen=True, slots=True)
class PadMotion:
    """Velocity (m/s) and acceleration (m/s^2) of the pad, NED."""

    velocity_ned_m_s: Vec3
    acceleration_ned_m_s2: Vec3


class Outlook(Protocol):
    """The pad's mean at `t_ns`; it never changes the track it was made from."""

    @property
    def t_ns(self) -> int: ...

    def copied(self) -> Self: ...

    def look_ahead(self, t_ns: int) -> None: ...

    def motion(self) -> PadMotion: ...


@dataclass(slots=True)
class BankOutlook:
    """Of a bank of models: `members` share the covariances of the track's and leave them as they are."""

    t_ns: int
    members: list[Member]
    vertical: Vertical
    height: State

    def copied(self) -> BankOutlook:
        members = [member.with_own_mean() for member in self.members]
        return BankOutlook(self.t_ns, members, self.vertical, self.vertical.copied(self.height))

    def look_ahead(self, t_ns: int) -> None:
        dt_s = (t_ns - self.t_ns) / NS
        if dt_s > 0.0:
            self.members = bank.likely(self.members)
            for member in self.members:
                member.model.move(member.x, dt_s)
            self.vertical.predict(self.height, dt_s)
            self.t_ns = t_ns

    def motion(self) -> PadMotion:
        velocity, motion = bank.mean_velocity(self.members), bank.mean_motion(self.members)
        deck = self.vertical.view(self.height)
        return PadMotion((*velocity, deck.rate_m_s), (*motion.acceleration_m_s2, deck.acceleration_m_s2))


@dataclass(slots=True)
class WholeOutlook:
    """Of a track that has no cheaper way than to be predicted whole."""

    track: Track

    @property
    def t_ns(self) -> int:
        return self.track.t_ns

    def copied(self) -> WholeOutlook:
        return WholeOutlook(self.track.copied())

    def look_ahead(self, t_ns: int) -> None:
        self.track.look_ahead(t_ns)

    def motion(self) -> PadMotion:
        then = self.track.estimate("outlook")
        return PadMotion(then.velocity_ned_m_s, then.acceleration_ned_m_s2)
