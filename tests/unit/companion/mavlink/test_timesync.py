"""The clock filter against clocks that run slow, jump, start anew, and answers that are late."""

from __future__ import annotations

import numpy as np
import pytest

from companion.mavlink.timesync import PeerClock

MS = 1_000_000
SECOND = 1_000_000_000
T0 = 5_000 * SECOND


class Peer:
    """A boot clock with a rate, seen through a channel with delays drawn from a seeded generator."""

    def __init__(self, *, rate: float, seed: int = 1) -> None:
        self.rate = rate
        self.boot_s = 60.0
        self.now_s = 0.0
        self.rng = np.random.default_rng(seed)
        self.clock = PeerClock()

    def elapse(self, seconds: float) -> None:
        self.now_s += seconds
        self.boot_s += seconds * self.rate

    def exchange(self, *, there_s: float, back_s: float) -> None:
        sent_ns = T0 + round(self.now_s * SECOND)
        self.elapse(there_s)
        boot_ns = round(self.boot_s * SECOND)
        self.elapse(back_s)
        self.clock.add(sent_ns=sent_ns, boot_ns=boot_ns, received_ns=T0 + round(self.now_s * SECOND))

    def run(self, seconds: float, *, period_s: float = 0.1, jitter_s: float = 0.0) -> list[float]:
        """Exchange for a while; errors of the mapping half a period after each exchange, in s."""
        errors = []
        for _ in range(round(seconds / period_s)):
            delays = 0.0005 + self.rng.exponential(jitter_s, 2) if jitter_s else (0.0005, 0.0005)
            self.exchange(there_s=float(delays[0]), back_s=float(delays[1]))
            self.elapse(period_s / 2)
            if (error := self.error_s()) is not None:
                errors.append(error)
            self.elapse(period_s / 2)
        return errors

    def error_s(self) -> float | None:
        mapped = self.clock.companion_ns(round(self.boot_s * SECOND))
        return None if mapped is None else (mapped - T0) * 1e-9 - self.now_s


def test_five_good_exchanges_make_a_clock() -> None:
    peer = Peer(rate=1.0)
    peer.run(0.4)
    assert not peer.clock.converged
    peer.run(0.1)
    assert peer.clock.converged


@pytest.mark.parametrize("rate", [0.95, 0.97, 0.995, 1.0, 1.00005])
def test_a_slow_clock_is_followed_within_a_tenth_of_a_millisecond(rate: float) -> None:
    errors = Peer(rate=rate).run(10.0)[20:]
    assert len(errors) > 50
    assert max(map(abs, errors)) < 1e-4


def test_late_answers_cost_less_than_their_lateness() -> None:
    """Exponential delays of 5 ms each way on a clock 2 % slow: the error stays under a third of the mean delay."""
    errors = Peer(rate=0.98, seed=7).run(60.0, jitter_s=0.005)[100:]
    assert np.sqrt(np.mean(np.square(errors))) < 0.002


def test_a_simulator_that_changes_pace_is_followed() -> None:
    peer = Peer(rate=0.99)
    peer.run(5.0)
    peer.rate = 0.96
    errors = peer.run(5.0)
    assert max(map(abs, errors)) < 0.008
    assert max(map(abs, errors[20:])) < 1e-3


def test_one_answer_that_took_half_a_second_changes_nothing() -> None:
    peer = Peer(rate=0.99)
    peer.run(5.0)
    peer.exchange(there_s=0.4995, back_s=0.0005)
    assert peer.error_s() == pytest.approx(0.0, abs=1e-3)


def test_duplicated_and_overtaken_answers_are_ignored() -> None:
    clock = PeerClock()
    samples = [
        {"sent_ns": i * 100 * MS, "boot_ns": SECOND + i * 100 * MS, "received_ns": i * 100 * MS + MS} for i in range(20)
    ]
    for sample in samples:
        assert clock.add(**sample)
        for _ in range(6):
            assert not clock.add(**sample)
    assert not clock.add(**samples[3])
    assert (clock.restarts, clock.rejected) == (0, 0)


def test_impossible_answers_are_refused() -> None:
    clock = PeerClock()
    assert not clock.add(sent_ns=2 * SECOND, boot_ns=SECOND, received_ns=SECOND)
    assert not clock.add(sent_ns=3 * SECOND, boot_ns=SECOND, received_ns=5 * SECOND)
    assert not clock.add(sent_ns=6 * SECOND, boot_ns=-1, received_ns=6 * SECOND)
    assert clock.quality.samples == 0


def test_a_reboot_starts_the_clock_anew_at_once() -> None:
    peer = Peer(rate=1.0)
    peer.run(5.0)
    peer.boot_s = 1.0
    peer.run(0.7)
    assert peer.clock.quality.restarts == 1
    assert peer.error_s() == pytest.approx(0.0, abs=1e-4)


def test_a_jump_forward_is_believed_when_it_stays() -> None:
    peer = Peer(rate=1.0)
    peer.run(5.0)
    peer.boot_s += 3.0
    peer.run(1.5)
    assert peer.clock.quality.restarts == 1
    assert peer.error_s() == pytest.approx(0.0, abs=1e-4)


def test_the_mapping_goes_both_ways() -> None:
    peer = Peer(rate=0.97)
    peer.run(5.0)
    boot_ns = peer.clock.boot_ns(T0 + 6 * SECOND)
    assert boot_ns is not None
    assert peer.clock.companion_ns(boot_ns) == pytest.approx(T0 + 6 * SECOND, abs=10)


def test_the_stated_error_is_that_of_the_offset() -> None:
    """Root mean square of (error / stated sigma) near one: neither boasting nor useless."""
    ratios = []
    for seed in range(30):
        peer = Peer(rate=0.99, seed=seed)
        peer.run(10.0, jitter_s=0.004)
        peer.exchange(there_s=0.0005 + peer.rng.exponential(0.004), back_s=0.0005 + peer.rng.exponential(0.004))
        error = peer.error_s()
        assert error is not None
        ratios.append(error / peer.clock.quality.offset_sigma_s)
    assert 0.3 < np.sqrt(np.mean(np.square(ratios))) < 1.5


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_slow_and_uneven_link_still_gives_one_clock_and_keeps_it(seed: int) -> None:
    """Each way 0 to 200 ms, as a bad radio: the mapping comes within seconds, stays, and beats the arrival by far."""
    peer = Peer(rate=1.0, seed=seed)
    errors = []
    for _ in range(300):
        there_s, back_s = peer.rng.uniform(0.0, 0.2, 2)
        peer.exchange(there_s=float(there_s), back_s=float(back_s))
        errors.append(peer.error_s())
    known = [error for error in errors[20:] if error is not None]
    assert len(known) == len(errors) - 20
    assert np.sqrt(np.mean(np.square(known))) < 0.02
