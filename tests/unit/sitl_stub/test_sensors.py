"""Range sensor, beacon and geodesy, against geometry and pymavlink."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pymavlink.dialects.v20 import common

from sitl_stub import scenario
from sitl_stub.beacon import Beacon
from sitl_stub.carriers.deck import DeckState, deck_state
from sitl_stub.contact import DeckShape
from sitl_stub.geodesy import Origin
from sitl_stub.rotation import from_euler
from sitl_stub.sensors import RangeSensor, distance_down

SHAPE = DeckShape(length_m=1.5, width_m=1.0, depth_m=0.5)
HOME = Origin(47.397742, 8.545594, 488.0)


def deck(yaw_rad: float = 0.0) -> DeckState:
    return deck_state((10.0, 5.0, -0.5, 0.0, 0.0, yaw_rad), (1.0, 0.5, 0.0, 0.0, 0.0, 0.2))


def test_a_level_vehicle_sees_the_deck_under_it_and_the_ground_beside_it() -> None:
    level = from_euler(0.0, 0.0, 0.3)
    assert distance_down((10.0, 5.0, -4.0), level, deck(), SHAPE) == pytest.approx(3.5)
    assert distance_down((10.74, 5.0, -4.0), level, deck(), SHAPE) == pytest.approx(3.5)
    assert distance_down((10.76, 5.0, -4.0), level, deck(), SHAPE) == pytest.approx(4.0)
    assert distance_down((10.0, 5.6, -4.0), level, deck(), SHAPE) == pytest.approx(4.0)
    assert distance_down((10.0, 5.6, -4.0), level, deck(math.pi / 2.0), SHAPE) == pytest.approx(3.5)


def test_a_tilted_vehicle_looks_aside_and_farther() -> None:
    nose_up = from_euler(0.0, math.radians(30.0), 0.0)
    # Nose up: B +z points forward, so the ray meets the deck ahead of the vehicle.
    ahead_m = 3.5 * math.tan(math.radians(30.0))
    assert distance_down((10.0 - ahead_m, 5.0, -4.0), nose_up, deck(), SHAPE) == pytest.approx(
        3.5 / math.cos(math.radians(30.0))
    )
    assert distance_down((10.0, 5.0, -4.0), nose_up, deck(), SHAPE) == pytest.approx(4.0 / math.cos(math.radians(30.0)))


def test_a_vehicle_on_its_back_sees_nothing() -> None:
    assert distance_down((0.0, 0.0, -4.0), from_euler(math.pi, 0.0, 0.0), deck(), SHAPE) == math.inf


def test_a_range_outside_the_limits_is_none() -> None:
    sensor = RangeSensor(rate_hz=20.0, min_m=0.2, max_m=10.0, noise_sigma_m=0.0, rng=np.random.default_rng(1))
    for true_m, value_m in ((5.0, 5.0), (0.1, None), (10.1, None), (math.inf, None)):
        sensor.sample(true_m)
        assert sensor.value_m == value_m


def frames(settings: scenario.Beacon, count: int, seed: int = 3) -> list:
    beacon = Beacon(settings, HOME, np.random.default_rng(seed))
    reader = common.MAVLink(None)
    sent = b"".join(data for i in range(count) for data in beacon.frames(deck(0.4), 200_000 * i))
    return reader.parse_buffer(bytearray(sent)) or []


def test_the_beacons_error_is_slow_and_as_large_as_asked() -> None:
    errors = []
    for seed in range(40):
        for message in frames(scenario.Beacon(noise_sigma_m=0.0), 40, seed):
            if message.get_type() == "GLOBAL_POSITION_INT":
                north, east = HOME.to_local(message.lat * 1e-7, message.lon * 1e-7)
                errors.append((north - 10.0, east - 5.0))
    assert math.sqrt(float(np.mean(np.sum(np.square(errors), axis=1)))) == pytest.approx(1.5, rel=0.3)
    steps = np.diff(np.array(errors).reshape(40, 40, 2), axis=1)
    assert float(np.abs(steps).max()) < 0.5


def test_an_ideal_beacon_tells_the_truth() -> None:
    ideal = scenario.Beacon(
        position_sigma_m=0.0, noise_sigma_m=0.0, velocity_sigma_m_s=0.0, heading_sigma_deg=0.0, odometry_rate_hz=5.0
    )
    heartbeat, position, odometry = frames(ideal, 1)
    assert (heartbeat.get_type(), heartbeat.get_srcSystem(), heartbeat.type) == ("HEARTBEAT", 2, 10)
    assert HOME.to_local(position.lat * 1e-7, position.lon * 1e-7) == pytest.approx((10.0, 5.0), abs=0.02)
    assert (position.vx, position.vy, position.vz) == (100, 50, 0)
    assert position.hdg == round(math.degrees(0.4) * 100.0)
    assert position.alt == 488_500
    assert (odometry.x, odometry.y, odometry.z) == pytest.approx((10.0, 5.0, -0.5))
    c, s = math.cos(0.4), math.sin(0.4)
    assert (odometry.vx, odometry.vy) == pytest.approx((c + 0.5 * s, 0.5 * c - s), abs=1e-6)
    assert odometry.yawspeed == pytest.approx(0.2)


def test_a_lost_beacon_is_silent_and_a_jumped_one_is_off() -> None:
    settings = scenario.Beacon(position_sigma_m=0.0, noise_sigma_m=0.0)
    beacon = Beacon(settings, HOME, np.random.default_rng(1))
    beacon.is_lost = True
    assert beacon.frames(deck(), 0) == []
    beacon.is_lost, beacon.jump_ned_m = False, (20.0, 0.0)
    (message,) = common.MAVLink(None).parse_buffer(bytearray(beacon.frames(deck(), 0)[-1])) or []
    assert HOME.to_local(message.lat * 1e-7, message.lon * 1e-7)[0] == pytest.approx(30.0, abs=0.02)


@pytest.mark.parametrize("place", [(0.0, 0.0), (100.0, -50.0), (-3000.0, 2000.0)])
def test_local_and_global_positions_convert_back_and_forth(place: tuple[float, float]) -> None:
    assert HOME.to_local(*HOME.to_global(*place)) == pytest.approx(place, abs=1e-3)


def test_a_degree_of_latitude_is_a_degree_of_the_sphere_and_longitude_shrinks_with_it() -> None:
    north, _ = HOME.to_local(HOME.latitude_deg + 0.01, HOME.longitude_deg)
    _, east = HOME.to_local(HOME.latitude_deg, HOME.longitude_deg + 0.01)
    assert north == pytest.approx(math.radians(0.01) * 6371000.0, rel=1e-6)
    assert east == pytest.approx(north * math.cos(math.radians(HOME.latitude_deg)), rel=1e-4)
