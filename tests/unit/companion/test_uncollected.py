"""What runs without a search for reference cycles makes none."""

from __future__ import annotations

import gc
from pathlib import Path

import pytest

from companion.campaign.runner import Flight
from companion.config import load
from companion.replay import ReplayOptions, replay
from companion.uncollected import uncollected
from sitl_stub.scenario import load as load_scenario
from sitl_stub.scenario import with_overrides

GOLDEN = Path(__file__).parents[2] / "replay" / "line.mcap"
FEW = 200
"""What a replay leaves once, however long the log is: its pipeline, its configuration. One cycle a tick would be a thousand."""


def test_the_search_for_cycles_goes_on_afterwards_also_after_an_error() -> None:
    with pytest.raises(ZeroDivisionError), uncollected():
        1 / int(gc.isenabled())
    assert gc.isenabled()
    with uncollected(), uncollected():
        pass
    assert gc.isenabled()


def cycles_of_a_flight(seconds: float) -> int:
    flight = Flight(with_overrides(load_scenario("line"), {"duration_limit_s": seconds}), load(), seed=3)
    gc.collect()
    with uncollected():
        flight.run(lambda: False)
        return gc.collect()


def test_a_flight_makes_no_cycles() -> None:
    assert cycles_of_a_flight(6.0) <= FEW


def test_a_replay_makes_no_cycles() -> None:
    replay(GOLDEN, ReplayOptions())
    gc.collect()
    with uncollected():
        result = replay(GOLDEN, ReplayOptions())
        found = gc.collect()
    assert result.log_s > 20.0
    assert found <= FEW
