"""Workers die, raise, are killed from outside: every flight ends in exactly one row, and nobody pays for another."""

from __future__ import annotations

import os
import signal
import threading
import time
from pathlib import Path

import pytest
from flights import flight, sample

from companion.campaign.engine import Row, fly_all


def outcomes(rows: list[Row]) -> dict[int, str]:
    assert len({row["sample"] for row in rows}) == len(rows)
    return {row["sample"]: row["outcome"] for row in rows}


@pytest.mark.parametrize("workers", [1, 2])
def test_a_flight_that_raises_is_a_row_with_its_reason(workers: int) -> None:
    rows = list(fly_all([sample(0), sample(1, "raises"), sample(2)], workers=workers, flight=flight))
    assert outcomes(rows) == {0: "landed", 1: "error", 2: "landed"}
    assert next(row["reason"] for row in rows if row["sample"] == 1) == "RuntimeError: a lens fell out"


def test_a_wrong_file_ends_the_campaign() -> None:
    with pytest.raises(ValueError, match="no such scenario"):
        list(fly_all([sample(0, "wrong_file"), sample(1)], workers=2, flight=flight))


def test_a_flight_that_kills_its_process_is_lost_alone(tmp_path: Path) -> None:
    todo = [sample(0), sample(1, "dies"), sample(2), sample(3), sample(4, "dies_once", tmp_path), sample(5)]
    rows = list(fly_all(todo, workers=2, flight=flight))
    assert outcomes(rows) == {0: "landed", 1: "lost", 2: "landed", 3: "landed", 4: "landed", 5: "landed"}


def test_a_worker_killed_from_outside_costs_no_flight(tmp_path: Path) -> None:
    """The killer strikes the process of sample 1 in the middle of its flight, once."""
    killer = threading.Thread(target=_kill_first_worker, args=(tmp_path,))
    killer.start()
    rows = []
    for row in fly_all([sample(0), sample(1, "waits", tmp_path), sample(2)], workers=2, flight=_waits_once):
        rows.append(row)
    killer.join()
    assert outcomes(rows) == {0: "landed", 1: "landed", 2: "landed"}


def _waits_once(given: object) -> Row:
    from companion.campaign.campaign_file import Sample

    assert isinstance(given, Sample)
    if given.scenario == "waits" and any(Path(given.app["folder"]).iterdir()):
        return flight(sample(given.index))
    return flight(given)


def _kill_first_worker(folder: Path) -> None:
    give_up = time.monotonic() + 30.0
    while time.monotonic() < give_up:
        for name in folder.iterdir():
            os.kill(int(name.name), signal.SIGKILL)
            return
        threading.Event().wait(0.02)


def test_leaving_early_does_not_wait_for_flights_in_the_air(tmp_path: Path) -> None:
    """What Ctrl-C does: the generator is closed while a flight of a minute is under way."""
    rows = fly_all([sample(0), sample(1, "waits", tmp_path), sample(2)], workers=2, flight=flight)
    assert next(rows)["sample"] in (0, 2)
    started = time.monotonic()
    rows.close()  # type: ignore[attr-defined]
    assert time.monotonic() - started < 20.0


def test_on_a_dask_cluster_the_rows_are_the_same() -> None:
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None, protocol="inproc://"
    ) as cluster:
        todo = [sample(0), sample(1, "raises"), sample(2)]
        rows = list(fly_all(todo, workers=1, scheduler=cluster.scheduler_address, flight=flight))
    assert outcomes(rows) == {0: "landed", 1: "error", 2: "landed"}


@pytest.mark.timeout(120)
def test_a_worker_of_a_cluster_that_is_killed_costs_no_flight(tmp_path: Path) -> None:
    """Real worker processes; one is killed (SIGKILL) in the middle of a flight, which another then flies."""
    distributed = pytest.importorskip("distributed")
    killer = threading.Thread(target=_kill_first_worker, args=(tmp_path,))
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        killer.start()
        todo = [sample(0), sample(1, "waits", tmp_path), sample(2), sample(3, "raises")]
        rows = list(fly_all(todo, workers=1, scheduler=cluster.scheduler_address, flight=_waits_once))
        killer.join()
    assert outcomes(rows) == {0: "landed", 1: "landed", 2: "landed", 3: "error"}


def test_a_scheduler_that_does_not_answer_is_named() -> None:
    pytest.importorskip("distributed")
    with pytest.raises(ValueError, match="no dask scheduler answers"):
        list(fly_all([sample(0)], workers=1, scheduler="tcp://127.0.0.1:1", flight=flight))
