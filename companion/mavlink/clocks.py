"""Whose clock is whose: questions and answers of TIMESYNC, and the companion's time of a peer's stamp.

Questions go to everybody on the link; the autopilot's answers and the beacon's feed a PeerClock each. A stamp is never in
the future and never absurdly old: where the mapping says so, or none is known yet, the arrival is taken.
"""

from __future__ import annotations

from collections import deque

from companion import config
from companion.mavlink.dialect import Timesync
from companion.mavlink.timesync import ClockQuality, PeerClock

SECOND_NS = 1_000_000_000
FAST_NS = SECOND_NS // 10
SLOW_NS = SECOND_NS // 5
FAST_SAMPLES = 30
OLDEST_STAMP_NS = SECOND_NS
"""A stamp further back than this is a wrong clock, not a slow link."""


class Clocks:
    """The autopilot's and the beacon's boot clocks."""

    def __init__(self, link: config.Link) -> None:
        self._autopilot = PeerClock()
        self._beacon = PeerClock()
        self._beacon_shares = link.beacon_clock == "autopilot"
        self._due_ns = 0
        self._asked_ns: deque[int] = deque(maxlen=16)

    def ask_now(self, now_ns: int) -> None:
        """A peer has appeared."""
        self._due_ns = now_ns

    def next_timer_ns(self) -> int:
        return self._due_ns

    def question(self, now_ns: int) -> Timesync | None:
        """What to send, if it is time: 10 Hz until the clock is settled, then 5 Hz, because simulators change pace."""
        if now_ns < self._due_ns:
            return None
        quality = self._autopilot.quality
        self._due_ns = now_ns + (SLOW_NS if quality.converged and quality.samples >= FAST_SAMPLES else FAST_NS)
        self._asked_ns.append(now_ns)
        return Timesync(0, now_ns)

    def from_autopilot(self, message: Timesync, now_ns: int) -> Timesync | None:
        """Take an answer to a question of ours; the answer to the autopilot's own question."""
        if message.tc1 == 0:
            return Timesync(now_ns, message.ts1)
        self._learn(self._autopilot, message, now_ns)
        return None

    def from_beacon(self, message: Timesync, now_ns: int) -> None:
        self._learn(self._beacon, message, now_ns)

    def _learn(self, clock: PeerClock, message: Timesync, now_ns: int) -> None:
        """Answers to others pass by here too: only those to our own questions count."""
        if message.tc1 > 0 and message.ts1 in self._asked_ns:
            clock.add(sent_ns=message.ts1, boot_ns=message.tc1, received_ns=now_ns)

    # -------------------------------------------------------------------------------------------------------- answers

    def stamp(self, boot_ns: int, now_ns: int) -> int:
        """When something stamped by the autopilot was true."""
        return _plausible(self._autopilot.companion_ns(boot_ns), now_ns)

    def beacon_stamp(self, boot_ns: int, now_ns: int) -> int:
        """The same for the beacon: by its own answers, or by the autopilot's clock where both count alike."""
        own = self._beacon.companion_ns(boot_ns)
        if own is None and self._beacon_shares:
            own = self._autopilot.companion_ns(boot_ns)
        return _plausible(own, now_ns)

    def companion_ns(self, boot_ns: int) -> int | None:
        return self._autopilot.companion_ns(boot_ns)

    def boot_ns(self, companion_ns: int) -> int | None:
        return self._autopilot.boot_ns(companion_ns)

    @property
    def quality(self) -> ClockQuality:
        return self._autopilot.quality


def _plausible(mapped_ns: int | None, now_ns: int) -> int:
    if mapped_ns is None or mapped_ns > now_ns or now_ns - mapped_ns > OLDEST_STAMP_NS:
        return now_ns
    return mapped_ns
