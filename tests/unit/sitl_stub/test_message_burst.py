"""Messages made together by a kernel are, byte for byte, those made one by one."""

from __future__ import annotations

from collections import Counter

import msgspec
import pytest

from sitl_stub import scenario as scenarios
from sitl_stub.burst_kernel import MOVING_FIELDS
from sitl_stub.compiled import COMPILED
from sitl_stub.datagram_faults import Datagram
from sitl_stub.mavlink.definitions import COMMAND_LONG, SET_POSITION_TARGET_LOCAL_NED
from sitl_stub.mavlink.frame import encode
from sitl_stub.mavlink_endpoint import MavlinkEndpoint
from sitl_stub.steady_flight import SteadyFlight
from sitl_stub.steady_kernel import STEP_US
from sitl_stub.world import World

pytestmark = pytest.mark.skipif(not COMPILED, reason="messages are made together where numba compiles")

SET_MESSAGE_INTERVAL, DO_SET_MODE, REQUEST_MESSAGE = 511, 176, 512
OFFBOARD_MODE = (1.0, 6.0)


def command(link: str, number: int, *parameters: float) -> Datagram:
    padded = (*parameters, *(0.0,) * (7 - len(parameters)))
    return Datagram(link, encode(COMMAND_LONG, COMMAND_LONG.struct.pack(*padded, number, 1, 1, 0), 0, 1, 191))


def setpoint(position_m: float, mask: int) -> Datagram:
    values = (0, position_m, position_m, -9.0, 1.0, -0.5, 0.1, 0.0, 0.0, 0.0, 0.4, 0.0, mask, 1, 1, 1)
    payload = SET_POSITION_TARGET_LOCAL_NED.struct.pack(*values)
    return Datagram("onboard", encode(SET_POSITION_TARGET_LOCAL_NED, payload, 0, 1, 191))


def sent_by_vehicle(seconds: float, *, offboard: bool, scenario: dict[str, object] | None = None) -> list[Datagram]:
    """All datagrams of a flight in which every message of the kernel is asked for at its own odd rate on both links."""
    loaded = scenarios.with_overrides(scenarios.load("line"), {"place.pad_distance_m": 3.0, **(scenario or {})})
    world = World(msgspec.structs.replace(loaded, cameras={}), 5)
    asked = [
        command(link, SET_MESSAGE_INTERVAL, float(message_type.id), 9_000.0 + 1_700.0 * kind)
        for link in ("onboard", "ground")
        for message_type, (kind, _) in MOVING_FIELDS.items()
    ]
    sent: list[Datagram] = []
    for turn in range(round(seconds / 0.02)):
        given = asked if turn == 2 else []
        if offboard and turn % 2 == 0:
            given = [*given, setpoint(2.0, 0b100111000111 if turn < 40 else 0b100111111000)]
        if offboard and turn == 6:
            given = [*given, command("onboard", DO_SET_MODE, *OFFBOARD_MODE)]
        if turn % 17 == 9:
            given = [*given, command("onboard", REQUEST_MESSAGE, 83.0), command("ground", REQUEST_MESSAGE, 105.0)]
        sent += world.step(0.02, given).datagrams
    return sent


FLIGHTS: dict[str, tuple[bool, dict[str, object]]] = {
    "offboard": (True, {}),
    "hovering": (False, {}),
    "without range sensor": (True, {"range_sensor.fitted": False}),
    "without errors": (False, {"estimate.error_scale": 0.0}),
}


@pytest.mark.parametrize("name", FLIGHTS)
def test_messages_made_together_are_those_made_one_by_one(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    offboard, scenario = FLIGHTS[name]
    together = sent_by_vehicle(3.0, offboard=offboard, scenario=scenario)
    monkeypatch.setattr(MavlinkEndpoint, "sends_streams_only", False)
    assert sent_by_vehicle(3.0, offboard=offboard, scenario=scenario) == together


def test_nearly_all_messages_of_a_steady_flight_are_made_together(monkeypatch: pytest.MonkeyPatch) -> None:
    made: Counter[str] = Counter()
    together, single = SteadyFlight.send_many, SteadyFlight.send

    def counted(
        self: SteadyFlight, t_us: int, last_us: int, range_m: float | None
    ) -> tuple[int, list[Datagram], list[Datagram]]:
        result = together(self, t_us, last_us, range_m)
        made["together"] += len(result[1]) + len(result[2])
        return result

    def counted_single(self: SteadyFlight, t_us: int, range_m: float | None) -> None:
        made["single steps"] += 1
        single(self, t_us, range_m)

    monkeypatch.setattr(SteadyFlight, "send_many", counted)
    monkeypatch.setattr(SteadyFlight, "send", counted_single)
    sent = sent_by_vehicle(3.0, offboard=True)
    assert made["together"] > 0.9 * len(sent)
    assert made["single steps"] < 3.0 / (STEP_US * 1e-6) / 20.0


def test_every_message_of_the_kernel_is_sent_in_these_flights() -> None:
    ids = {int.from_bytes(data[7:10], "little") for _, data in sent_by_vehicle(1.0, offboard=False)}
    assert ids >= {message_type.id for message_type in MOVING_FIELDS}


def test_moving_fields_are_fields_of_their_messages() -> None:
    for message_type, (_, places) in MOVING_FIELDS.items():
        values = message_type.struct.unpack(bytes(message_type.struct.size))
        assert max(places, default=0) < len(values), message_type.name
        assert not any(isinstance(values[place], bytes) for place in places)
