"""Carriers and the deck between their knots."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from sitl_stub.carriers import CARRIERS, Carrier
from sitl_stub.carriers.boat import BoatSettings
from sitl_stub.carriers.deck import Deck
from sitl_stub.carriers.placement import PlacedPath
from sitl_stub.carriers.rover import RoverSettings
from sitl_stub.carriers.still import StillCarrierSettings
from sitl_stub.carriers.truck import TruckSettings
from sitl_stub.carriers.waves import Sea
from sitl_stub.paths.circle import CircleSettings
from sitl_stub.paths.figure8 import Figure8Settings
from sitl_stub.paths.line import LineSettings
from sitl_stub.paths.still import StillSettings

ALL = {
    "still": StillCarrierSettings(),
    "rover": RoverSettings(),
    "truck": TruckSettings(),
    "boat": BoatSettings(pad_ahead_m=0.5, yaw_swing_deg=5.0, current_m_s=0.3),
}


def carrier_of(settings, path=None, seed: int = 2) -> Carrier:
    rng = np.random.default_rng(seed)
    path = path if path is not None else Figure8Settings(speed_m_s=2.0)
    return settings.build(PlacedPath(path.build(rng), 20.0, 5.0, 0.4), 0.5, rng)


def test_every_carrier_of_the_registry_is_tested_here() -> None:
    assert set(ALL) == set(CARRIERS)


@pytest.mark.parametrize("kind", sorted(CARRIERS))
def test_the_pad_begins_where_the_scenario_wants_it(kind: str) -> None:
    motion = carrier_of(ALL[kind]).motion()
    lever_m = 0.5 + 0.3 if kind == "boat" else 0.0
    assert math.hypot(motion.pose[0] - 20.0, motion.pose[1] - 5.0) < 1e-9 + 0.1 * lever_m
    assert math.remainder(motion.pose[5] - 0.4, math.tau) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("kind", sorted(CARRIERS))
def test_the_decks_velocity_is_the_derivative_of_its_position(kind: str) -> None:
    deck = Deck(carrier_of(ALL[kind]))
    h = 0.001
    states = [deck.at(i * h) for i in range(4000)]
    for before, here, after in zip(states, states[1:], states[2:], strict=False):
        for axis in range(3):
            slope = (after.position_ned_m[axis] - before.position_ned_m[axis]) / (2 * h)
            assert slope == pytest.approx(here.velocity_ned_m_s[axis], abs=0.01)


@pytest.mark.parametrize("kind", sorted(CARRIERS))
def test_the_decks_angular_velocity_turns_its_rotation(kind: str) -> None:
    deck = Deck(carrier_of(ALL[kind]))
    h = 0.001
    states = [deck.at(i * h) for i in range(2000)]
    for before, here, after in zip(states[::37], states[1::37], states[2::37], strict=False):
        w = here.angular_velocity_ned_rad_s
        for column in range(3):
            axis = [here.rotation_ned_deck[3 * row + column] for row in range(3)]
            slope = [
                (after.rotation_ned_deck[3 * row + column] - before.rotation_ned_deck[3 * row + column]) / (2 * h)
                for row in range(3)
            ]
            turned = np.cross(w, axis)
            assert slope == pytest.approx(turned.tolist(), abs=0.01)


@pytest.mark.parametrize("kind", sorted(CARRIERS))
def test_a_seed_repeats_its_motion(kind: str) -> None:
    one, same = Deck(carrier_of(ALL[kind], seed=4)), Deck(carrier_of(ALL[kind], seed=4))
    assert [one.at(0.1 * i) for i in range(50)] == [same.at(0.1 * i) for i in range(50)]


@pytest.mark.parametrize("kind", ["rover", "truck"])
def test_a_carrier_stays_on_its_path(kind: str) -> None:
    rng = np.random.default_rng(1)
    path = PlacedPath(Figure8Settings(speed_m_s=4.2).build(rng), 0.0, 0.0, 0.0)
    settings = TruckSettings(pad_ahead_of_rear_axle_m=0.0) if kind == "truck" else ALL[kind]
    deck = Deck(settings.build(path, 0.5, rng))
    for i in range(600):
        reference, state = path.at(0.1 * i), deck.at(0.1 * i)
        off = math.hypot(reference.north_m - state.position_ned_m[0], reference.east_m - state.position_ned_m[1])
        assert off < 0.5


def test_a_truck_keeps_its_limits_of_acceleration_and_reaches_its_speed() -> None:
    settings = TruckSettings(max_acceleration_m_s2=1.5, pad_ahead_of_rear_axle_m=0.0)
    carrier = carrier_of(settings, LineSettings(speed_m_s=15.0, start_delay_s=1.0, acceleration_m_s2=3.0))
    speeds = []
    for _ in range(3000):
        speeds.append(math.hypot(*carrier.motion().rate[:2]))
        carrier.advance()
    assert max(b - a for a, b in itertools.pairwise(speeds)) <= 1.5 * 0.02 + 1e-9
    assert speeds[-1] == pytest.approx(15.0, abs=0.3)


def test_a_truck_does_not_turn_tighter_than_its_steering_allows() -> None:
    settings = TruckSettings(max_steering_deg=20.0)
    carrier = carrier_of(settings, CircleSettings(speed_m_s=3.0, radius_m=3.0, turn="clockwise"))
    for _ in range(500):
        carrier.advance()
    motion = carrier.motion()
    speed = math.hypot(*motion.rate[:2])
    assert motion.rate[5] <= speed * math.tan(math.radians(20.0)) / 2.8 + 1e-6


@pytest.mark.parametrize("height_m", [0.5, 1.0, 4.0])
def test_a_sea_has_the_significant_height_asked_for(height_m: float) -> None:
    heights = []
    for seed in range(6):
        sea = Sea(height_m, 6.0, 0.0, np.random.default_rng(seed))
        heights += [sea.hull(0.4 * i, 0.0, 0.0, (0.0, 0.0), 0.0, 0.1, 0.1)[0] for i in range(2000)]
    assert 4.0 * np.std(heights) == pytest.approx(height_m, rel=0.1)


def test_a_short_boat_rides_the_waves_and_a_long_one_cuts_through_them() -> None:
    def spread(length_m: float) -> float:
        sea = Sea(1.0, 4.0, 0.0, np.random.default_rng(1))
        return float(np.std([sea.hull(0.2 * i, 0.0, 0.0, (0.0, 0.0), 0.0, length_m, 2.0)[0] for i in range(2000)]))

    assert spread(2.0) > 0.9 * 0.25
    assert spread(40.0) < 0.25 * spread(2.0)


def test_a_boat_in_head_seas_pitches_and_in_beam_seas_rolls() -> None:
    def angles(wave_from_deg: float) -> tuple[float, float]:
        settings = BoatSettings(significant_wave_height_m=0.5, wave_from_deg=wave_from_deg)
        rng = np.random.default_rng(1)
        path = PlacedPath(LineSettings(speed_m_s=1.0).build(rng), 0.0, 0.0, 0.0)
        deck = Deck(settings.build(path, 0.5, rng))
        rpy = [deck.at(0.1 * i).rpy_rad for i in range(600)]
        return float(np.std([r for r, _, _ in rpy])), float(np.std([p for _, p, _ in rpy]))

    head, beam = angles(0.0), angles(90.0)
    assert head[1] > 5.0 * head[0]
    assert beam[0] > 5.0 * beam[1]


def test_a_deck_never_comes_higher_than_its_carrier_says() -> None:
    carrier = carrier_of(BoatSettings(significant_wave_height_m=2.0), StillSettings())
    highest = carrier.highest_deck_m()
    deck = Deck(carrier)
    assert max(-deck.at(0.05 * i).position_ned_m[2] for i in range(4000)) < highest
