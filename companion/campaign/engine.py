"""Runs samples on a pool of processes, or on a dask cluster, and appends one line per finished flight to a file.

The file is the state: after Ctrl-C or a crash the same command goes on with what is missing. A worker that dies takes only its
own flight with it: the pool is made anew and that flight is flown again, twice at most, then recorded as lost.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from companion.campaign.campaign_file import Sample
from companion.campaign.fly_sample import fly_sample

MOST_TRIES = 3
Row = dict[str, Any]


class ResultsFile:
    """samples.jsonl: a header line, then one line per flight in the order in which they finished."""

    def __init__(self, path: Path, fingerprint: str) -> None:
        self._path = path
        self.rows: dict[int, Row] = {}
        if path.exists():
            self._read(fingerprint)
        else:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(json.dumps({"campaign": fingerprint}) + "\n", encoding="utf-8")

    def _read(self, fingerprint: str) -> None:
        lines = self._path.read_text(encoding="utf-8").splitlines()
        header = json.loads(lines[0]) if lines else {}
        if header.get("campaign") != fingerprint:
            raise ValueError(f"{self._path}: holds results of another campaign file; choose another --out or remove it")
        for line in lines[1:]:
            try:
                row = json.loads(line)
            except json.JSONDecodeError:
                continue  # the last line of a killed process
            self.rows[row["sample"]] = row

    def add(self, row: Row) -> None:
        self.rows[row["sample"]] = row
        with self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")


def fly_all(samples: Sequence[Sample], *, workers: int, scheduler: str | None = None) -> Iterator[Row]:
    """Rows as they finish, in any order."""
    if scheduler is not None:
        yield from _on_cluster(samples, scheduler)
    elif workers == 1:
        yield from map(fly_sample, samples)
    else:
        yield from _on_pool(samples, workers)


def _on_pool(samples: Sequence[Sample], workers: int) -> Iterator[Row]:
    tries = {sample.index: 0 for sample in samples}
    left = {sample.index: sample for sample in samples}
    while left:
        with ProcessPoolExecutor(workers, mp_context=get_context("spawn"), initializer=_one_thread) as pool:
            try:
                yield from _submit_all(pool, left, tries, in_flight=2 * workers)
            except BrokenProcessPool:
                for index in [index for index, count in tries.items() if count >= MOST_TRIES and index in left]:
                    yield lost_row(left.pop(index))


def _submit_all(
    pool: ProcessPoolExecutor, left: dict[int, Sample], tries: dict[int, int], *, in_flight: int
) -> Iterator[Row]:
    """Keep a few flights queued; count a try when a flight is handed out."""
    waiting = list(left.values())
    running: dict[Future[Row], int] = {}
    while waiting or running:
        while waiting and len(running) < in_flight:
            sample = waiting.pop(0)
            tries[sample.index] += 1
            running[pool.submit(fly_sample, sample)] = sample.index
        done, _ = wait(running, return_when=FIRST_COMPLETED)
        for future in done:
            row = future.result()
            left.pop(running.pop(future), None)
            yield row


def _on_cluster(samples: Sequence[Sample], address: str) -> Iterator[Row]:
    from distributed import Client, as_completed

    with Client(address) as client:
        futures = [client.submit(fly_sample, sample, pure=False, retries=MOST_TRIES - 1) for sample in samples]
        by_key = {future.key: sample for future, sample in zip(futures, samples, strict=True)}
        for future in as_completed(futures):
            yield future.result() if future.status == "finished" else lost_row(by_key[future.key])


def lost_row(sample: Sample) -> Row:
    """A flight whose process died every time: counted as a failure, never left out."""
    numbers = ("touchdown_error_m", "touchdown_relative_speed_horizontal_m_s", "touchdown_relative_speed_vertical_m_s")
    return {
        "sample": sample.index,
        "cell": sample.cell,
        "outcome": "lost",
        "scenario": sample.scenario,
        "seed": sample.seed,
        "forced_disarm_in_air": False,
        "time_to_touchdown_s": None,
        "real_time_factor": None,
        **dict.fromkeys(numbers),
    }


def default_workers() -> int:
    """One per core that this process may use."""
    return len(os.sched_getaffinity(0))


def _one_thread() -> None:
    """Each worker is one core: no threads of the numeric libraries on top."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ[name] = "1"
