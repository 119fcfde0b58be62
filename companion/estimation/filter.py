"""A PadEstimator over tracks: late and out-of-order measurements by history, prediction to any time. Frame O, NED, SI.

Every fused measurement is kept with the track as it was just after it. One that belongs before others is put in its place:
the track of before is taken up again and the later ones are fused once more. Called by tracker.py.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Protocol, TypeVar

from companion.estimation.gate import NS
from companion.estimation.measurement import PadMeasurement
from companion.estimation.outlook import DeckMotion, Foreseen, Outlook, PadMotion
from companion.messages import MeasurementVerdict, PadEstimate

COAST_STEP_NS = 100_000_000
LOOK_AHEAD_NS = 500_000_000
"""A track that coasts is advanced on a grid and kept, so that a long outage costs each query no more than this."""


class Track(Foreseen, Protocol):
    """A pad at `t_ns`: what a family of estimators has to provide."""

    def advance(self, t_ns: int) -> None:
        """Predict to `t_ns` in order to fuse a measurement there."""

    def outlook(self, *, deck_only: bool) -> Outlook:
        """A copy for looking ahead at the motion alone, or at the deck's alone."""

    def fuse(self, m: PadMeasurement) -> MeasurementVerdict:
        """Fuse a measurement of the track's own time."""


Coasting = TypeVar("Coasting", Track, Outlook)


@dataclass(slots=True)
class Fused:
    """A measurement in the history and the track just after it."""

    measurement: PadMeasurement
    after: Track

    @property
    def t_ns(self) -> int:
        return self.measurement.t_ns


class PadFilter:
    """Tracks behind the PadEstimator protocol. `start` makes one from a first measurement, or None from one that tells too
    little."""

    def __init__(
        self,
        name: str,
        start: Callable[[PadMeasurement], Track | None],
        *,
        lag_s: float = 1.0,
        lost_after_s: float = 15.0,
    ) -> None:
        self._name = name
        self._start = start
        self._lag_ns = int(lag_s * NS)
        self._lost_ns = int(lost_after_s * NS)
        self._history: list[Fused] = []
        self._coasting: Track | None = None
        self._coasting_outlooks: dict[bool, Outlook] = {}
        self._answers: dict[int, PadEstimate] = {}

    def reset(self) -> None:
        self._history.clear()
        self._forget_answers()

    def _forget_answers(self) -> None:
        """What was predicted holds until the next measurement."""
        self._coasting = None
        self._coasting_outlooks.clear()
        self._answers.clear()

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

    def estimate(self, t_ns: int) -> PadEstimate | None:
        """The pad at `t_ns`, past (within the history), now or ahead; None before the first sight and when long lost."""
        if t_ns in self._answers:
            return self._answers[t_ns]
        track = self._track_before(t_ns)
        if track is None or t_ns - self._history[-1].t_ns > self._lost_ns:
            return None
        track = track.copied()
        track.look_ahead(t_ns)
        estimate = track.estimate(self._name)
        self._answers[t_ns] = estimate
        return estimate

    def motion(self, t_ns: int) -> PadMotion | None:
        """The means of `estimate(t_ns)`, for a fraction of its cost."""
        outlook = self._outlook(t_ns, deck_only=False)
        return None if outlook is None else outlook.motion()

    def deck(self, t_ns: int) -> DeckMotion | None:
        """Vertical speed and tilt of `estimate(t_ns)`, for less still."""
        outlook = self._outlook(t_ns, deck_only=True)
        return None if outlook is None else outlook.deck()

    def _outlook(self, t_ns: int, *, deck_only: bool) -> Outlook | None:
        track = self._kept_before(t_ns)
        if track is None or t_ns - self._history[-1].t_ns > self._lost_ns:
            return None
        anew, until_ns = partial(track.outlook, deck_only=deck_only), self._coasts_until(t_ns)
        if until_ns is None:
            outlook = anew()
        else:
            kept = _coasted(self._coasting_outlooks.get(deck_only) or anew(), until_ns, anew)
            self._coasting_outlooks[deck_only] = kept
            outlook = kept.copied()
        outlook.look_ahead(t_ns)
        return outlook

    def _begin(self, m: PadMeasurement) -> MeasurementVerdict:
        track = self._start(m)
        if track is None:
            return MeasurementVerdict(m.t_ns, m.source, accepted=False, reason="no position to start from")
        self._history.append(Fused(m, track))
        return MeasurementVerdict(m.t_ns, m.source, accepted=True, reason="first sight")

    def _insert(self, m: PadMeasurement) -> MeasurementVerdict:
        """Put it in its place of the history and work all later ones in again."""
        index = bisect_right(self._history, m.t_ns, key=lambda fused: fused.t_ns)
        self._forget_answers()
        later = self._history[index:]
        del self._history[index:]
        verdict = self._append(m)
        for fused in later:
            self._append(fused.measurement)
        return verdict

    def _append(self, m: PadMeasurement) -> MeasurementVerdict:
        track = self._history[-1].after.copied()
        track.advance(m.t_ns)
        verdict = track.fuse(m)
        self._history.append(Fused(m, track))
        return verdict

    def _prune(self) -> None:
        """Keep one entry from before the lag: late measurements start from it."""
        oldest_ns = self._history[-1].t_ns - self._lag_ns
        keep = bisect_right(self._history, oldest_ns, key=lambda fused: fused.t_ns) - 1
        if keep > 0:
            del self._history[:keep]

    def _track_before(self, t_ns: int) -> Track | None:
        """The newest track not after `t_ns`; a coasting one where that is far back."""
        track, until_ns = self._kept_before(t_ns), self._coasts_until(t_ns)
        if track is None or until_ns is None:
            return track
        self._coasting = _coasted(self._coasting or track.copied(), until_ns, track.copied)
        return self._coasting

    def _kept_before(self, t_ns: int) -> Track | None:
        """The track after the newest measurement that is not after `t_ns`."""
        if not self._history or t_ns < self._history[0].t_ns:
            return None
        newest = self._history[-1].after
        if t_ns >= newest.t_ns:
            return newest
        index = bisect_right(self._history, t_ns, key=lambda fused: fused.t_ns) - 1
        return self._history[index].after

    def _coasts_until(self, t_ns: int) -> int | None:
        """On the same grid whatever was asked before, so that an answer depends on the measurements alone."""
        newest_ns = self._history[-1].after.t_ns if self._history else t_ns
        steps = (t_ns - newest_ns - LOOK_AHEAD_NS) // COAST_STEP_NS
        return None if steps <= 0 else newest_ns + steps * COAST_STEP_NS


def _coasted(kept: Coasting, until_ns: int, anew: Callable[[], Coasting]) -> Coasting:
    """`kept` advanced to `until_ns` on the grid; begun anew where it is past that already."""
    if kept.t_ns > until_ns:
        kept = anew()
    while kept.t_ns < until_ns:
        kept.look_ahead(kept.t_ns + COAST_STEP_NS)
    return kept
