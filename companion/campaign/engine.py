"""Runs samples on a pool of processes, or on a dask cluster, and yields one row per flight as it ends.

A worker that dies breaks the whole pool without saying whose flight it was. So the flights that were in the air are flown
again one at a time, each alone in a new process: the guilty one is found, tried again, then recorded as lost, and no other
pays for it. A flight that raises is recorded as an error with its reason; a wrong configuration ends the campaign.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import active_children, get_context
from typing import Any

from companion.campaign.campaign_file import Sample
from companion.campaign.fly_sample import fly_sample

MOST_TRIES = 3
Row = dict[str, Any]
Flight = Callable[[Sample], Row]


def fly_all(
    samples: Sequence[Sample], *, workers: int, scheduler: str | None = None, flight: Flight = fly_sample
) -> Iterator[Row]:
    """Rows as they finish, in any order. `flight` must be importable by other processes."""
    if scheduler is not None:
        yield from _on_cluster(samples, scheduler, flight)
    elif workers == 1:
        for sample in samples:
            yield _guarded(sample, flight)
    else:
        yield from _on_pool(samples, workers, flight)


def _guarded(sample: Sample, flight: Flight) -> Row:
    """What raises in one flight is that flight's ending. ValueError is a wrong file: the same for all, so it goes up."""
    try:
        return flight(sample)
    except ValueError:
        raise
    except Exception as error:
        return failed_row(sample, "error", f"{type(error).__name__}: {error}")


def _on_pool(samples: Sequence[Sample], workers: int, flight: Flight) -> Iterator[Row]:
    waiting = list(samples)
    while waiting:
        in_the_air: dict[Future[Row], Sample] = {}
        try:
            with _pool(workers) as pool:
                yield from _keep_busy(pool, waiting, in_the_air, flight, in_flight=workers + 1)
        except BrokenProcessPool:
            for sample in sorted(in_the_air.values(), key=lambda sample: sample.index):
                yield _alone(sample, flight)


def _keep_busy(
    pool: ProcessPoolExecutor,
    waiting: list[Sample],
    in_the_air: dict[Future[Row], Sample],
    flight: Flight,
    *,
    in_flight: int,
) -> Iterator[Row]:
    """Hand out flights, few ahead; take each out of `in_the_air` when its row is there."""
    while waiting or in_the_air:
        while waiting and len(in_the_air) < in_flight:
            sample = waiting[0]
            in_the_air[pool.submit(_guarded, sample, flight)] = waiting.pop(0)
        done, _ = wait(in_the_air, return_when=FIRST_COMPLETED)
        for future in sorted(done, key=lambda future: future.exception() is not None):
            row = future.result()
            del in_the_air[future]
            yield row


def _alone(sample: Sample, flight: Flight) -> Row:
    """One flight in a process of its own, tried again when that process dies."""
    for _ in range(MOST_TRIES - 1):
        try:
            with _pool(1) as pool:
                return pool.submit(_guarded, sample, flight).result()
        except BrokenProcessPool:
            continue
    return failed_row(sample, "lost", f"its process died {MOST_TRIES} times")


@contextmanager
def _pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Ended early (Ctrl-C, a broken pool), it does not wait for flights that nobody will record."""
    before = set(active_children())
    pool = ProcessPoolExecutor(workers, mp_context=get_context("spawn"), initializer=_prepare_worker)
    try:
        yield pool
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        for process in set(active_children()) - before:
            process.terminate()
        raise
    pool.shutdown()


def _prepare_worker() -> None:
    """Each worker is one core: no threads of the numeric libraries on top. Ctrl-C is for the parent to act on."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ[name] = "1"


def _on_cluster(samples: Sequence[Sample], address: str, flight: Flight) -> Iterator[Row]:
    """On a dask scheduler: it re-runs what a dead worker held, and gives up on a flight that kills several."""
    with _client(address) as client:
        from distributed import as_completed

        futures = [client.submit(_guarded, sample, flight, pure=False) for sample in samples]
        by_key = {future.key: sample for future, sample in zip(futures, samples, strict=True)}
        for future in as_completed(futures):  # type: ignore[no-untyped-call]
            sample = by_key[future.key]
            error = None if future.status == "finished" else future.exception()
            if isinstance(error, ValueError):
                raise error
            yield future.result() if error is None else failed_row(sample, "lost", f"{type(error).__name__}: {error}")
            future.release()


def _client(address: str) -> Any:
    """ValueError where the extra is missing or nobody answers."""
    try:
        from distributed import Client
    except ImportError as error:
        raise ValueError("--scheduler needs the extra `cluster`: pip install 'companion[cluster]'") from error
    try:
        return Client(address)  # type: ignore[no-untyped-call]
    except OSError as error:
        raise ValueError(f"--scheduler {address}: no dask scheduler answers there ({error})") from error


def failed_row(sample: Sample, outcome: str, reason: str) -> Row:
    """A flight without a result (`lost`, `error`): counted as a failure, never left out."""
    unset = (
        "touchdown_error_m",
        "touchdown_error_along_m",
        "touchdown_error_across_m",
        "touchdown_relative_speed_horizontal_m_s",
        "touchdown_relative_speed_vertical_m_s",
        "time_to_touchdown_s",
        "real_time_factor",
    )
    return {
        "sample": sample.index,
        "cell": sample.cell,
        "outcome": outcome,
        "reason": reason,
        "scenario": sample.scenario,
        "seed": sample.seed,
        "forced_disarm_in_air": False,
        **dict.fromkeys(unset),
    }


def default_workers() -> int:
    """One per core that this process may use."""
    return len(os.sched_getaffinity(0))
