"""The same scenario, seed and datagrams give the same bytes and the same pictures, however time is cut into calls.

A minute of it: climbs and descents over a pad on a figure-8 with faults at random times, and a landing at its end. The camera renders
188 x 120 pixels at 10 Hz, which keeps the four flights affordable; every picture is in the hash.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator

import pytest

from sitl_stub import scenario as scenarios
from sitl_stub.datagram_faults import Datagram
from sitl_stub.mavlink.definitions import COMMAND_LONG, SET_POSITION_TARGET_LOCAL_NED
from sitl_stub.mavlink.frame import encode
from sitl_stub.scenario import Scenario
from sitl_stub.world import World

LENGTH_S = 60.0
LANDING_FROM_S = 50.0
INPUT_PERIOD_S = 0.1


def everything() -> Scenario:
    """A figure-8 with gusts, estimate errors, all sensors, link faults and a camera with every kind of delay."""
    faults = [
        {"kind": "datagram_delay", "delay_s": 0.02, "jitter_s": 0.03, "start_s": 1.0, "duration_s": 1.5},
        {"kind": "datagram_corruption", "fraction": 0.1, "start_s": 2.0, "duration_s": 1.0},
        {"kind": "datagram_duplicate", "fraction": 0.2, "mean_interval_s": 1.0, "duration_s": 0.5},
        {"kind": "marker_covered", "start_s": 3.0, "duration_s": 1.0},
        {"kind": "datagram_loss", "fraction": 0.5, "mean_interval_s": 20.0, "duration_s": 0.4},
        {"kind": "camera_freeze", "mean_interval_s": 15.0, "duration_s": 0.5},
        {"kind": "range_lost", "mean_interval_s": 15.0, "duration_s": 0.5},
        {"kind": "estimator_reset", "north_m": 0.5, "down_m": 0.3, "start_s": 30.0},
    ]
    overrides = {
        "place.pad_distance_m": 1.0,
        "vehicle.start_height_m": 3.0,
        "wind.gust_sigma_m_s": 1.0,
        "cameras.down.width_px": 188,
        "cameras.down.height_px": 120,
        "cameras.down.fx_px": 105.0,
        "cameras.down.fy_px": 105.0,
        "cameras.down.rate_hz": 10.0,
        "cameras.down.drop_probability": 0.1,
        "cameras.down.delay_spread_s": 0.02,
        "cameras.down.delay_kind": "exponential",
        "beacon.odometry_rate_hz": 5.0,
        "faults": faults,
    }
    return scenarios.with_overrides(scenarios.load("figure8"), overrides)


def inputs(turn: int) -> Iterator[Datagram]:
    """Offboard, round and up and down, then to the ground; the same bytes in the same tenth of a second of every run."""
    t_s = turn * INPUT_PERIOD_S
    north, east, down = 1.5 * math.cos(0.4 * t_s), 1.5 * math.sin(0.4 * t_s), 0.5 * math.sin(0.5 * t_s)
    if t_s > LANDING_FROM_S:
        north, east, down = 0.3, 0.0, 1.0
    values = (0, 0.0, 0.0, 0.0, north, east, down, 0.0, 0.0, 0.0, 0.0, 0.1, 0b010111000111, 1, 1, 1)
    packed = SET_POSITION_TARGET_LOCAL_NED.struct.pack(*values)
    yield Datagram("onboard", encode(SET_POSITION_TARGET_LOCAL_NED, packed, turn & 0xFF, 1, 191))
    if turn == 3:
        command = COMMAND_LONG.struct.pack(1.0, 6.0, 0.0, 0.0, 0.0, 0.0, 0.0, 176, 1, 1, 0)
        yield Datagram("onboard", encode(COMMAND_LONG, command, 0, 1, 191))


def fingerprint(seed: int, chunk_s: float) -> str:
    world = World(everything(), seed)
    bytes_digest, images_digest = hashlib.sha256(), hashlib.sha256()
    frames = datagrams = 0
    for turn in range(round(LENGTH_S / INPUT_PERIOD_S)):
        fresh = list(inputs(turn))
        for _ in range(round(INPUT_PERIOD_S / chunk_s)):
            output = world.step(chunk_s, fresh)
            fresh = []
            for datagram in output.datagrams:
                bytes_digest.update(datagram.link.encode() + datagram.data)
            for frame in output.frames:
                label = f"{frame.camera} {frame.t_capture_us} {frame.sequence}"
                images_digest.update(label.encode() + frame.image.tobytes())
            frames, datagrams = frames + len(output.frames), datagrams + len(output.datagrams)
    bytes_digest.update(repr(world.verdict()).encode() + repr(world.truth().vehicle).encode())
    assert frames > 400
    assert datagrams > 20_000
    assert world.truth().contact.is_touching
    return bytes_digest.hexdigest() + images_digest.hexdigest()


@pytest.fixture(scope="module")
def reference() -> str:
    return fingerprint(seed=5, chunk_s=0.02)


@pytest.mark.parametrize("chunk_s", [0.004, 0.02, 0.1])
def test_all_bytes_and_images_are_equal_for_every_length_of_step(reference: str, chunk_s: float) -> None:
    assert fingerprint(seed=5, chunk_s=chunk_s) == reference


def test_another_seed_gives_other_bytes(reference: str) -> None:
    assert fingerprint(seed=6, chunk_s=0.1) != reference
