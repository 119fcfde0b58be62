"""A link that loses, delays, reorders, duplicates and corrupts datagrams while the scenario says so.

One `DatagramChannel` a direction. Sans-IO: datagrams go in with the time, and come out when they are due.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from sitl_stub.faults import (
    DatagramCorruption,
    DatagramDelay,
    DatagramDuplicate,
    DatagramLoss,
    DatagramReorder,
    Fault,
)

LINK_FAULTS = (DatagramLoss, DatagramDelay, DatagramReorder, DatagramDuplicate, DatagramCorruption)


class Datagram(NamedTuple):
    """Bytes on one of the vehicle's links, "onboard" (14540) or "ground" (14550)."""

    link: str
    data: bytes


class DatagramChannel:
    """One direction: "to_vehicle" or "from_vehicle"."""

    def __init__(self, direction: str, rng: np.random.Generator) -> None:
        self._direction = direction
        self._rng = rng
        self._faults: list[Fault] = []
        self._waiting: list[tuple[int, int, Datagram]] = []
        self._count = 0

    def set_faults(self, active: Iterable[Fault]) -> None:
        """The faults that act from now on; those of the other direction are left out."""
        self._faults = [f for f in active if isinstance(f, LINK_FAULTS) and f.direction in (self._direction, "both")]

    def is_clear(self) -> bool:
        """Nothing acts and nothing waits: the caller may pass datagrams by."""
        return not self._faults and not self._waiting

    def send(self, datagram: Datagram, t_us: int) -> None:
        copies = [(datagram, 0.0)]
        for fault in self._faults:
            copies = [after for copy in copies for after in self._suffer(fault, *copy)]
        for copy, late_s in copies:
            self._waiting.append((t_us + round(late_s * 1e6), self._count, copy))
            self._count += 1

    def due(self, t_us: int) -> list[Datagram]:
        """What arrives by `t_us`, in order of arrival."""
        if not self._waiting:
            return []
        ready = sorted((e for e in self._waiting if e[0] <= t_us), key=lambda e: e[:2])
        self._waiting = [entry for entry in self._waiting if entry[0] > t_us]
        return [entry[2] for entry in ready]

    def _suffer(self, fault: Fault, datagram: Datagram, late_s: float) -> list[tuple[Datagram, float]]:
        """What one fault makes of one datagram: nothing, it, it later, two of it, or a wrong one."""
        if isinstance(fault, DatagramDelay):
            return [(datagram, late_s + fault.delay_s + fault.jitter_s * float(self._rng.random()))]
        if isinstance(fault, DatagramLoss | DatagramReorder | DatagramDuplicate | DatagramCorruption):
            if self._rng.random() >= fault.fraction:
                return [(datagram, late_s)]
            return self._struck(fault, datagram, late_s)
        return [(datagram, late_s)]

    def _struck(self, fault: Fault, datagram: Datagram, late_s: float) -> list[tuple[Datagram, float]]:
        if isinstance(fault, DatagramReorder):
            return [(datagram, late_s + fault.hold_s)]
        if isinstance(fault, DatagramDuplicate):
            return [(datagram, late_s), (datagram, late_s)]
        if isinstance(fault, DatagramCorruption):
            return [(corrupted(datagram, self._rng), late_s)]
        return []


def corrupted(datagram: Datagram, rng: np.random.Generator) -> Datagram:
    """The same bytes but for one, which is certainly different."""
    if not datagram.data:
        return datagram
    data = bytearray(datagram.data)
    place = int(rng.integers(len(data)))
    data[place] ^= int(rng.integers(1, 256))
    return Datagram(datagram.link, bytes(data))
