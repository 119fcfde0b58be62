"""A bad link, one fault at a time and together."""

from __future__ import annotations

import numpy as np
import pytest

from sitl_stub.datagram_faults import Datagram, DatagramChannel
from sitl_stub.faults import (
    DatagramCorruption,
    DatagramDelay,
    DatagramDuplicate,
    DatagramLoss,
    DatagramReorder,
    Fault,
    FaultSchedule,
    GpsLoss,
)

SENT = [Datagram("onboard", bytes((i, i + 1, i + 2))) for i in range(200)]


def through(*faults: Fault, direction: str = "to_vehicle") -> list[tuple[int, Datagram]]:
    """(time of arrival, datagram) of one datagram a millisecond."""
    channel = DatagramChannel(direction, np.random.default_rng(3))
    channel.set_faults(faults)
    arrived = []
    for i in range(1000):
        if i < len(SENT):
            channel.send(SENT[i], i * 1000)
        arrived += [(i * 1000, datagram) for datagram in channel.due(i * 1000)]
    return arrived


def test_without_faults_everything_arrives_at_once_and_in_order() -> None:
    assert through() == [(i * 1000, datagram) for i, datagram in enumerate(SENT)]


def test_a_fraction_is_lost_and_all_of_them_when_the_link_is_cut() -> None:
    assert len(through(DatagramLoss(fraction=0.3))) == pytest.approx(140, abs=20)
    assert through(DatagramLoss(fraction=1.0)) == []


def test_a_fault_of_the_other_direction_does_nothing() -> None:
    assert through(DatagramLoss(fraction=1.0, direction="from_vehicle")) == through()


def test_delay_is_as_long_as_asked_and_jitter_reorders() -> None:
    late = through(DatagramDelay(delay_s=0.05))
    assert [t - i * 1000 for i, (t, _) in enumerate(late)] == [50_000] * 200
    jittered = [datagram for _, datagram in through(DatagramDelay(delay_s=0.05, jitter_s=0.02))]
    assert sorted(jittered, key=lambda d: d.data) == sorted(SENT, key=lambda d: d.data)
    assert jittered != SENT


def test_some_are_overtaken_some_come_twice() -> None:
    reordered = [datagram for _, datagram in through(DatagramReorder(fraction=0.2, hold_s=0.01))]
    assert reordered != SENT
    assert len(reordered) == 200
    assert len(through(DatagramDuplicate(fraction=0.25))) == pytest.approx(250, abs=20)


def test_a_corrupted_datagram_differs_in_one_byte() -> None:
    arrived = [datagram for _, datagram in through(DatagramCorruption(fraction=1.0))]
    for sent, got in zip(SENT, arrived, strict=True):
        assert sum(a != b for a, b in zip(sent.data, got.data, strict=True)) == 1


def test_an_empty_datagram_can_be_corrupted_without_harm() -> None:
    channel = DatagramChannel("to_vehicle", np.random.default_rng(3))
    channel.set_faults([DatagramCorruption(fraction=1.0)])
    channel.send(Datagram("onboard", b""), 0)
    assert channel.due(0) == [Datagram("onboard", b"")]


def test_a_schedule_opens_and_closes_its_windows_once() -> None:
    schedule = FaultSchedule((GpsLoss(start_s=1.0, duration_s=2.0),), np.random.default_rng(1))
    changes = [(0.02 * i, w.active) for i in range(500) for w in schedule.update(0.02 * i, 10.0)]
    assert [(round(t, 2), active) for t, active in changes] == [(1.0, True), (3.0, False)]


def test_a_random_fault_comes_again_and_again_at_its_mean_interval() -> None:
    schedule = FaultSchedule((GpsLoss(mean_interval_s=5.0, duration_s=0.5),), np.random.default_rng(1))
    begun = [0.02 * i for i in range(50_000) for w in schedule.update(0.02 * i, 10.0) if w.active]
    assert len(begun) == pytest.approx(1000.0 / 5.5, rel=0.2)
