"""Makes line.mcap: a simulated landing, its inputs only (what a golden replay needs, at a fifth of the size).

Run it by hand when the vocabulary changes or the simulator has become better; then `companion replay --check --update`.
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Sequence
from pathlib import Path

from companion.campaign.flight_sinks import LOCKSTEP_EPOCH_US
from companion.campaign.runner import CLOCK_OFFSET_NS, fly
from companion.config import load
from companion.io.mcap_log import LogOrigin, write_entries
from companion.io.run_folder import versions
from companion.messages import AccelerationReport, Message, PadObservation
from companion.onboard import JournalEntry
from sitl_stub.scenario import load as load_scenario
from sitl_stub.world import Truth


class Inputs:
    """A sink that keeps what went into the pipeline. Accelerations and corners are left out: nothing that decides reads them."""

    def __init__(self) -> None:
        self.entries: list[JournalEntry] = []

    def datagram(self, now_ns: int, data: bytes, *, outgoing: bool) -> None:
        pass

    def journal(self, entries: Sequence[JournalEntry]) -> None:
        wanted = [e for e in entries if e.direction == "in" and not isinstance(e.message, AccelerationReport)]
        self.entries += [dataclasses.replace(entry, message=_lean(entry.message)) for entry in wanted]

    def truth(self, now_ns: int, truth: Truth) -> None:
        pass

    def close(self) -> None:
        pass


def _lean(message: Message) -> Message:
    return dataclasses.replace(message, corners_px=()) if isinstance(message, PadObservation) else message


def main(target: Path, scenario: str = "line", seed: int = 1) -> None:
    inputs, config = Inputs(), load()
    fly(load_scenario(scenario), config, seed=seed, sinks=[inputs])
    shift_ns = LOCKSTEP_EPOCH_US * 1000 - CLOCK_OFFSET_NS
    origin = LogOrigin(config, versions(), shift_ns, {"scenario": scenario, "seed": str(seed)})
    write_entries(target, origin, inputs.entries, small=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
