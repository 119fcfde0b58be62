"""The autopilot's boot clock seen from the companion's: offset, rate and how well both are known.

Each answered TIMESYNC is a sample: the peer read `boot_ns` somewhere between our `sent_ns` and `received_ns`. The middle
is the best guess and half of the round trip beyond the shortest one seen is its error. A two-state Kalman filter over
(offset, rate) fuses the samples: offset is companion minus boot, rate is d(offset)/d(boot). The rate matters: a simulator
below real time runs 0.5 to 5 % slow, 5 ms between two samples, while real oscillators differ by 1e-5.

Instants are integers in nanoseconds; the filter works in seconds relative to its last sample so that floats keep their
digits. An answer cannot be further off than half of its round trip, so one that disagrees shows that the pace has changed:
the rate is opened for it, and is let walk for a while, because what changed its pace once does so again. As long as none
disagrees the rate stands almost still, so that many answers over a slow and uneven link together say what none says alone.
A peer that rebooted or jumped makes a run of impossible samples: then the filter starts anew.
"""

from __future__ import annotations

import math
import statistics
from dataclasses import dataclass

SAMPLES_TO_CONVERGE = 5
CONVERGED_SIGMA_S = 0.005
CONVERGED_PER_ROUND_TRIP = 0.1
"""Over a slow link: what is known to a fifth of the usual way is far better than the arrival."""
LOST_PER_CONVERGED = 4.0
"""Once known it stays known until it is this much worse: a mapping that comes and goes moves every stamp each time."""
SHORTEST_ROUND_TRIP_WINDOW = 50
FLOOR_SIGMA_S = 50e-6
"""Reading and scheduling jitter that no round trip shows."""
INITIAL_RATE_SIGMA = 0.03
RATE_WALK_PER_SQRT_S = 0.005
"""How fast the speed of a simulator on a loaded machine changes."""
STEADY_WALK_PER_SQRT_S = 1e-4
"""The same of a peer whose pace has not been seen to change; a real oscillator is far steadier still."""
WALK_FADES_IN_S = 10.0
GATE_SIGMA = 4.0
JUMP_S = 0.25
"""More than a change of pace explains within the time between two samples."""
REJECTIONS_TO_RESTART = 4
LONGEST_ROUND_TRIP_S = 1.0
REBOOT_S = 2.0
"""Answers are at most a round trip out of order; a clock further back has started anew."""


@dataclass(frozen=True, slots=True)
class ClockQuality:
    """How far the mapping can be trusted, for people and for doctor."""

    converged: bool
    offset_sigma_s: float
    rate: float
    shortest_round_trip_s: float | None
    samples: int
    rejected: int
    restarts: int


class PeerClock:
    """Maps one peer's boot time to the companion's monotonic time."""

    def __init__(self) -> None:
        self.restarts = 0
        self.rejected = 0
        self._last_sent_ns = -1
        self._round_trips_s: list[float] = []
        self._start_over()

    def _start_over(self) -> None:
        self._samples = 0
        self._rejected_in_a_row = 0
        self._boot_ns = 0
        self._companion_ns = 0
        self._rate = 0.0
        self._p_offset = 0.0
        self._p_cross = 0.0
        self._p_rate = INITIAL_RATE_SIGMA**2
        self._walk = STEADY_WALK_PER_SQRT_S
        self._known = False

    # ------------------------------------------------------------------------------------------------------ samples

    def add(self, *, sent_ns: int, boot_ns: int, received_ns: int) -> bool:
        """Fuse one exchange; False where it is impossible, too slow, or too far from what is known."""
        if sent_ns <= self._last_sent_ns:
            return False  # a duplicate, or overtaken by the answer to a later question
        self._last_sent_ns = sent_ns
        round_trip_s = (received_ns - sent_ns) * 1e-9
        if not 0.0 <= round_trip_s <= LONGEST_ROUND_TRIP_S or boot_ns <= 0:
            self.rejected += 1
            return False
        sigma_s = self._sample_sigma_s(round_trip_s)
        middle_ns = (sent_ns + received_ns) // 2
        if self._samples == 0:
            self._begin(boot_ns, middle_ns, sigma_s)
            return True
        return self._fuse(boot_ns, middle_ns, sigma_s, round_trip_s)

    def _sample_sigma_s(self, round_trip_s: float) -> float:
        self._round_trips_s = [*self._round_trips_s[1 - SHORTEST_ROUND_TRIP_WINDOW :], round_trip_s]
        shortest_s = min(self._round_trips_s) * (1.0 - 1.0 / len(self._round_trips_s))
        return FLOOR_SIGMA_S + 0.1 * shortest_s + 0.5 * (round_trip_s - shortest_s)

    def _begin(self, boot_ns: int, companion_ns: int, sigma_s: float) -> None:
        self._boot_ns, self._companion_ns = boot_ns, companion_ns
        self._p_offset = sigma_s**2
        self._samples = 1

    def _fuse(self, boot_ns: int, companion_ns: int, sigma_s: float, round_trip_s: float) -> bool:
        dt_s = (boot_ns - self._boot_ns) * 1e-9
        if dt_s < -REBOOT_S:
            self._restart()
            return False
        predicted_ns = self._predicted_ns(boot_ns)
        p_offset, p_cross, p_rate = self._predicted_covariance(abs(dt_s))
        innovation_s = (companion_ns - predicted_ns) * 1e-9
        if dt_s <= 0.0 or abs(innovation_s) > JUMP_S + sigma_s:
            self._reject()
            return False
        self._walk = max(STEADY_WALK_PER_SQRT_S, self._walk * math.exp(-dt_s / WALK_FADES_IN_S))
        if abs(innovation_s) > GATE_SIGMA * math.sqrt(p_offset) + 0.5 * round_trip_s:
            self._walk = RATE_WALK_PER_SQRT_S
            p_offset, p_cross, p_rate = _pace_changed(p_offset, p_cross, p_rate, innovation_s, dt_s)
        variance = p_offset + sigma_s**2
        k_offset, k_rate = p_offset / variance, p_cross / variance
        self._boot_ns = boot_ns
        self._companion_ns = predicted_ns + round(k_offset * innovation_s * 1e9)
        self._rate += k_rate * innovation_s
        self._p_offset = (1.0 - k_offset) * p_offset
        self._p_cross = (1.0 - k_offset) * p_cross
        self._p_rate = p_rate - k_rate * p_cross
        self._samples += 1
        self._rejected_in_a_row = 0
        self._known = self._is_known()
        return True

    def _is_known(self) -> bool:
        limit_s = max(CONVERGED_SIGMA_S, CONVERGED_PER_ROUND_TRIP * statistics.median(self._round_trips_s))
        limit_s *= LOST_PER_CONVERGED if self._known else 1.0
        return self._samples >= SAMPLES_TO_CONVERGE and self._p_offset < limit_s**2

    def _predicted_covariance(self, dt_s: float) -> tuple[float, float, float]:
        walk = self._walk**2
        return (
            self._p_offset + 2.0 * dt_s * self._p_cross + dt_s**2 * self._p_rate + walk * dt_s**3 / 3.0,
            self._p_cross + dt_s * self._p_rate + walk * dt_s**2 / 2.0,
            self._p_rate + walk * dt_s,
        )

    def _reject(self) -> None:
        self.rejected += 1
        self._rejected_in_a_row += 1
        if self._rejected_in_a_row >= REJECTIONS_TO_RESTART:
            self._restart()

    def _restart(self) -> None:
        self.restarts += 1
        self._round_trips_s = []
        self._start_over()

    # ------------------------------------------------------------------------------------------------------- answers

    @property
    def converged(self) -> bool:
        return self._known

    def companion_ns(self, boot_ns: int) -> int | None:
        """The companion's time at the peer's `boot_ns`, None before convergence."""
        return self._predicted_ns(boot_ns) if self.converged else None

    def boot_ns(self, companion_ns: int) -> int | None:
        """The peer's time at the companion's `companion_ns`, None before convergence."""
        if not self.converged:
            return None
        return self._boot_ns + round((companion_ns - self._companion_ns) / (1.0 + self._rate))

    def _predicted_ns(self, boot_ns: int) -> int:
        since_ns = boot_ns - self._boot_ns
        return self._companion_ns + since_ns + round(since_ns * self._rate)

    @property
    def quality(self) -> ClockQuality:
        return ClockQuality(
            converged=self.converged,
            offset_sigma_s=math.sqrt(self._p_offset) if self._samples else math.inf,
            rate=self._rate,
            shortest_round_trip_s=min(self._round_trips_s) if self._round_trips_s else None,
            samples=self._samples,
            rejected=self.rejected,
            restarts=self.restarts,
        )


def _pace_changed(
    p_offset: float, p_cross: float, p_rate: float, innovation_s: float, dt_s: float
) -> tuple[float, float, float]:
    """The covariance with the innovation added as an error of the rate over the last `dt_s`."""
    rate_error = innovation_s / dt_s
    return (p_offset + innovation_s**2, p_cross + innovation_s * rate_error, p_rate + rate_error**2)
