"""The live app and the simulator's autopilot over real UDP with MAVLink 2 signing: two implementations of it, one key."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import msgspec
import pytest
from px4_rig import Rig
from udp_vehicle import UdpVehicle, free_port

from companion.app import LiveApp
from companion.config import Config, load
from companion.mavlink.signing import EPOCH_UNIX_NS
from companion.messages import CommandKind, CommandResult, Health, Message, VehicleCommand
from companion.onboard import JournalEntry

pytestmark = [pytest.mark.sockets, pytest.mark.timeout(240)]
KEY = bytes(range(1, 33))
NO_CAMERA = "http://127.0.0.1:9/down"


PATIENCE_S = 60.0


class Ears:
    """A sink that keeps messages."""

    def __init__(self) -> None:
        self.heard: list[Message] = []

    def datagram(self, now_ns: int, data: bytes, *, outgoing: bool) -> None:
        pass

    def journal(self, entries: Sequence[JournalEntry]) -> None:
        self.heard += [entry.message for entry in entries]

    def close(self) -> None:
        pass

    def texts(self, subject: str) -> list[str]:
        return [m.text for m in self.heard if isinstance(m, Health) and m.subject == subject]


def signed_vehicle(port: int) -> UdpVehicle:
    """As after SETUP_SIGNING with this key, by whoever has set the vehicle up."""
    vehicle = UdpVehicle(port, speed=1.0)
    ticks = (time.time_ns() - EPOCH_UNIX_NS) // 10_000
    vehicle.rig.send(setup_signing(vehicle.rig, ticks))
    return vehicle


def setup_signing(rig: Rig, ticks: int) -> object:
    sender = rig.senders["onboard"]
    return sender.setup_signing_encode(1, 1, list(KEY), ticks)


def config_with(port: int, key_file: Path | None) -> Config:
    settings = {"link.url": f"udpin://127.0.0.1:{port}", "cameras.down.source": NO_CAMERA}
    return load([], settings | ({} if key_file is None else {"link.signing_key_file": str(key_file)}))


async def live(app: LiveApp, until: Callable[[], bool], timeout_s: float) -> bool:
    """Run the app until the condition holds; whether it did."""
    running = asyncio.create_task(app.run())
    end_s = time.monotonic() + timeout_s
    while not until() and time.monotonic() < end_s:  # noqa: ASYNC110 - a condition over the app's state, no event for it
        await asyncio.sleep(0.02)
    app.stop()
    await running
    return until()


def test_with_the_key_of_the_vehicle_the_app_hears_it_and_is_obeyed(tmp_path: Path) -> None:
    port, ears = free_port(), Ears()
    (tmp_path / "key").write_text(KEY.hex())
    app = LiveApp(config_with(port, tmp_path / "key"), sinks=[ears], autostart=False)
    asked: list[int] = []

    def accepted() -> bool:
        if app.onboard.session.connected and not asked:
            asked.append(time.monotonic_ns())
            app.onboard.session.send_command(VehicleCommand(asked[0], CommandKind.HOLD, "test"), asked[0])
        return any(isinstance(m, CommandResult) and m.accepted for m in ears.heard)

    with signed_vehicle(port):
        assert asyncio.run(live(app, accepted, PATIENCE_S))
    assert app.onboard.session.counters.frames_refused == 0
    assert app.onboard.session.counters.frames_received > 0


def test_with_another_key_nothing_is_believed_and_the_operator_is_told(tmp_path: Path) -> None:
    port, ears = free_port(), Ears()
    (tmp_path / "other").write_bytes(bytes(32))
    app = LiveApp(config_with(port, tmp_path / "other"), sinks=[ears], autostart=False)
    with signed_vehicle(port):
        assert asyncio.run(live(app, lambda: bool(ears.texts("link")), PATIENCE_S))
    assert "not signed with" in ears.texts("link")[0]
    assert "other" in ears.texts("link")[0]
    assert app.onboard.session.counters.frames_received == 0
    assert not app.onboard.session.connected


def test_a_vehicle_that_signs_does_not_obey_an_app_without_a_key() -> None:
    port, ears = free_port(), Ears()
    app = LiveApp(config_with(port, None), sinks=[ears], autostart=False)
    vehicle = signed_vehicle(port)
    asked: list[int] = []

    def a_second_after_asking() -> bool:
        if app.onboard.session.connected and not asked:
            asked.append(time.monotonic_ns())
            app.onboard.session.send_command(VehicleCommand(asked[0], CommandKind.ARM, "test"), asked[0])
        return bool(asked) and time.monotonic_ns() - asked[0] > 1_000_000_000

    with vehicle:
        assert asyncio.run(live(app, a_second_after_asking, PATIENCE_S))
    assert not any(isinstance(m, CommandResult) and m.accepted for m in ears.heard)
    assert not vehicle.rig.is_armed


def test_a_camera_that_is_not_there_is_mentioned_once(tmp_path: Path) -> None:
    ears = Ears()
    app = LiveApp(config_with(free_port(), None), sinks=[ears], autostart=False)
    said_s: list[float] = []

    def two_tries_later() -> bool:
        if not said_s and ears.texts("camera down"):
            said_s.append(time.monotonic())
        return bool(said_s) and time.monotonic() - said_s[0] > 2.2

    assert asyncio.run(live(app, two_tries_later, PATIENCE_S))
    assert len([text for text in ears.texts("camera down") if NO_CAMERA in text]) == 1


def test_the_key_file_is_looked_for_beside_the_configuration_that_names_it(tmp_path: Path) -> None:
    (tmp_path / "my.toml").write_text('[link]\nsigning_key_file = "link.key"\n')
    assert load([tmp_path / "my.toml"]).link.signing_key_file == str(tmp_path / "link.key")
    assert "0102" not in msgspec.json.encode(load([tmp_path / "my.toml"])).decode()
