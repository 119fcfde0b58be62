"""Many steps in one call, compiled or not, give the same bytes as one step at a time."""

from __future__ import annotations

import hashlib
import math
import os
import subprocess
import sys

import msgspec
import pytest

from sitl_stub import scenario as scenarios
from sitl_stub.datagram_faults import Datagram
from sitl_stub.mavlink.definitions import COMMAND_LONG, SET_POSITION_TARGET_LOCAL_NED, MessageType
from sitl_stub.mavlink.frame import encode
from sitl_stub.steady_flight import SteadyFlight
from sitl_stub.world import World

TURN_S = 0.1
FAULTS = [
    {"kind": "estimator_reset", "north_m": 1.0, "start_s": 1.5, "duration_s": 0.5},
    {"kind": "gps_loss", "start_s": 2.0, "duration_s": 0.5},
    {"kind": "motor_weak", "motor": 2, "efficiency": 0.9, "start_s": 2.6, "duration_s": 0.5},
]


def datagram(message: MessageType, *values: float) -> Datagram:
    return Datagram("onboard", encode(message, message.struct.pack(*values), 0, 1, 191))


def command(number: int, *parameters: float) -> Datagram:
    padded = (*parameters, *(0.0,) * (7 - len(parameters)))
    return datagram(COMMAND_LONG, *padded, number, 1, 1, 0)


def sent_to_vehicle(turn: int, descent_m_s: float) -> list[Datagram]:
    """OFFBOARD with a descent, an interval and a position request on the way."""
    velocity = (1.0, -0.5, descent_m_s)
    target = datagram(
        SET_POSITION_TARGET_LOCAL_NED, 0, *(0.0,) * 3, *velocity, *(0.0,) * 3, 0.3, 0.0, 0b100111000111, 1, 1, 1
    )
    extra = {3: command(176, 1.0, 6.0), 8: command(511, 31.0, 20_000.0), 12: command(512, 83.0)}
    return [target, extra[turn]] if turn in extra else [target]


def digest(
    name: str,
    descent_m_s: float | None,
    seconds: float,
    overrides: dict[str, object] | None = None,
    chunk_s: float = TURN_S,
) -> str:
    """All datagrams, the truth and the verdict of a flight; hovering in AUTO.LOITER without a descent."""
    loaded = scenarios.with_overrides(scenarios.load(name), {"place.pad_distance_m": 3.0, **(overrides or {})})
    world = World(msgspec.structs.replace(loaded, cameras={}), 3)
    result = hashlib.sha256()
    for turn in range(round(seconds / TURN_S)):
        given = [] if descent_m_s is None else sent_to_vehicle(turn, descent_m_s)
        for _ in range(round(TURN_S / chunk_s)):
            for sent in world.step(chunk_s, given).datagrams:
                result.update(sent.link.encode() + sent.data)
            given = []
    result.update(repr((world.truth().vehicle, world.verdict())).encode())
    return result.hexdigest()


FLIGHTS: dict[str, tuple[str, float | None, float, dict[str, object]]] = {
    "offboard": ("line", 0.2, 6.0, {}),
    "landing": ("line", 0.8, 6.0, {"vehicle.start_height_m": 3.0}),
    "hovering": ("figure8", None, 4.0, {}),
    "steady wind": ("line", 0.2, 3.0, {"wind.gust_sigma_m_s": 0.0}),
    "faults": ("line", 0.2, 4.0, {"faults": FAULTS}),
    "late faults": ("line", 0.2, 4.0, {"faults": [{**fault, "start_s": 2.26} for fault in FAULTS]}),
}


@pytest.mark.parametrize("name", FLIGHTS)
def test_steady_flight_gives_the_bytes_of_single_steps(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scenario, descent_m_s, seconds, overrides = FLIGHTS[name]
    together = digest(scenario, descent_m_s, seconds, overrides)
    monkeypatch.setattr(SteadyFlight, "enter", lambda self: False)
    assert digest(scenario, descent_m_s, seconds, overrides) == together


def winding_digest(seconds: float, chunk_s: float = 0.02, silent_from_s: float = math.inf) -> str:
    """Datagrams of a flight whose setpoint changes 25 times a second: descents that begin and end, positions now and then.

    From `silent_from_s` on no setpoint comes for three seconds."""
    world = World(msgspec.structs.replace(scenarios.load("line"), cameras={}), 3)
    result = hashlib.sha256()
    for turn in range(round(seconds / 0.02)):
        t_s = turn * 0.02
        given = []
        if turn % 2 == 0 and not silent_from_s <= t_s < silent_from_s + 3.0:
            velocity = (math.sin(1.3 * t_s), math.cos(t_s), 0.9 * math.sin(2.0 * t_s))
            mask = 0b100111000111 if int(t_s) % 3 else 0b100111111000
            rest = (0.0, 0.0, 0.0, 0.3 * math.sin(t_s), 0.0, mask, 1, 1, 1)
            given.append(datagram(SET_POSITION_TARGET_LOCAL_NED, 0, 2.0, 1.0 + t_s, -9.0, *velocity, *rest))
        if turn in (4, 60, 61):
            given.append(command(176, 1.0, 6.0) if turn == 4 else command(512, 83.0))
        for _ in range(round(0.02 / chunk_s)):
            for sent in world.step(chunk_s, given).datagrams:
                result.update(sent.link.encode() + sent.data)
            given = []
    return result.hexdigest()


def test_a_setpoint_that_changes_all_the_time_gives_the_bytes_of_single_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    together = winding_digest(5.0)
    assert winding_digest(5.0, chunk_s=0.004) == together
    monkeypatch.setattr(SteadyFlight, "enter", lambda self: False)
    assert winding_digest(5.0) == together


@pytest.mark.parametrize("silent_from_s", [1.04, 1.8])
def test_events_of_a_failsafe_leave_on_both_links_with_their_own_step(
    silent_from_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    together = winding_digest(6.0, silent_from_s=silent_from_s)
    assert winding_digest(6.0, 0.004, silent_from_s) == together
    monkeypatch.setattr(SteadyFlight, "enter", lambda self: False)
    assert winding_digest(6.0, silent_from_s=silent_from_s) == together


def test_steady_flight_gives_the_same_bytes_for_every_length_of_step() -> None:
    assert digest("line", 0.2, 3.0, chunk_s=0.004) == digest("line", 0.2, 3.0, chunk_s=0.1)


def test_a_hovering_vehicle_flies_steadily() -> None:
    world = World(msgspec.structs.replace(scenarios.load("line"), cameras={}), 3)
    made: list[int] = []
    flight = world._steady
    fly = flight.fly

    def counted(*arguments: object, **named: object) -> tuple[int, bool]:
        done, waits = fly(*arguments, **named)  # type: ignore[arg-type]
        made.append(done)
        return done, waits

    flight.fly = counted  # type: ignore[method-assign, assignment]
    world.step(1.0)
    assert sum(made) > 240


def test_compiled_and_plain_give_the_same_bytes() -> None:
    pytest.importorskip("numba")
    code = "from tests.unit.sitl_stub.test_steady_flight import digest; print(digest('line', 0.2, 5.0))"
    plain = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        check=True,
        text=True,
        timeout=120,
    )
    assert plain.stdout.strip() == digest("line", 0.2, 5.0)
