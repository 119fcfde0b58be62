"""Contact against a still and a moving deck, with a free rigid body in place of the multirotor."""

from __future__ import annotations

import math

import numpy as np
import pytest
from rigid_body import G, RigidBody, run

from sitl_stub.carriers import CarrierSettings
from sitl_stub.carriers.boat import BoatSettings
from sitl_stub.carriers.deck import Deck, DeckState
from sitl_stub.carriers.placement import PlacedPath
from sitl_stub.carriers.rover import RoverSettings
from sitl_stub.carriers.still import StillCarrierSettings
from sitl_stub.carriers.truck import TruckSettings
from sitl_stub.contact import Contact, DeckShape, Surface
from sitl_stub.paths.circle import CircleSettings
from sitl_stub.paths.figure8 import Figure8Settings
from sitl_stub.paths.line import LineSettings
from sitl_stub.paths.still import StillSettings
from sitl_stub.verdict import pad_distance, relative_velocity, upright_angle

FEET = ((0.16, 0.16, 0.15), (0.16, -0.16, 0.15), (-0.16, 0.16, 0.15), (-0.16, -0.16, 0.15))
HUBS = ((0.17, 0.17, -0.03), (0.17, -0.17, -0.03), (-0.17, 0.17, -0.03), (-0.17, -0.17, -0.03), (0.0, 0.0, 0.06))
LEG_M = 0.15
DECK_M = 0.5


def make_contact(restitution: float = 0.15, friction: float = 0.7, mass: float = 2.0) -> Contact:
    return Contact(
        mass_kg=mass,
        feet_frd_m=FEET,
        frame_frd_m=HUBS,
        deck=DeckShape(length_m=1.5, width_m=1.5, depth_m=DECK_M + 1.0),
        surface=Surface(friction, friction, restitution),
    )


def make_deck(carrier: CarrierSettings, path, seed: int = 1) -> Deck:
    rng = np.random.default_rng(seed)
    placed = PlacedPath(path.build(rng), 3.0, -2.0, 0.7)
    return Deck(carrier.build(placed, DECK_M, rng))


def still_deck() -> Deck:
    return make_deck(StillCarrierSettings(), StillSettings())


def standing_on(deck: DeckState, forward: float = 0.0, right: float = 0.0, gap: float = -0.001) -> RigidBody:
    """A body whose feet are `gap` above the deck, moving and turning with it."""
    r, o = deck.rotation_ned_deck, deck.position_ned_m
    up = -(LEG_M + gap)
    place = tuple(o[i] + r[3 * i] * forward + r[3 * i + 1] * right + r[3 * i + 2] * up for i in range(3))
    half = 0.5 * deck.rpy_rad[2]
    body = RigidBody(place, q=(math.cos(half), 0.0, 0.0, math.sin(half)))
    body.velocity = tuple(-v for v in relative_velocity(place, (0.0, 0.0, 0.0), deck))
    body.rates = (0.0, 0.0, deck.angular_velocity_ned_rad_s[2])
    return body


def in_pad(body: RigidBody, deck: DeckState) -> tuple[float, float, float]:
    r, o = deck.rotation_ned_deck, deck.position_ned_m
    d = [body.position[i] - o[i] for i in range(3)]
    return tuple(sum(r[3 * i + j] * d[i] for i in range(3)) for j in range(3))


def test_a_body_at_rest_on_the_ground_stays_where_it_is_and_is_held_by_its_weight() -> None:
    contact, deck = make_contact(), still_deck()
    body = RigidBody((0.0, 0.0, -LEG_M))
    run(body, contact, deck, 0.0, 3.0)
    before = body.position
    run(body, contact, deck, 3.0, 5.0)
    assert math.dist(before, body.position) < 1e-6
    assert contact.state.feet_on_ground == 4
    assert contact.state.force_ned_n[2] == pytest.approx(-2.0 * G, rel=1e-3)


@pytest.mark.parametrize(
    ("carrier", "path"),
    [
        (RoverSettings(), LineSettings(speed_m_s=1.5)),
        (RoverSettings(), Figure8Settings(speed_m_s=4.2)),
        (TruckSettings(), LineSettings(speed_m_s=15.0)),
        (TruckSettings(), CircleSettings(speed_m_s=8.0, radius_m=20.0)),
        (BoatSettings(significant_wave_height_m=1.5, peak_wave_period_s=6.0), LineSettings(speed_m_s=1.0)),
    ],
    ids=["rover line", "rover figure-8", "truck 15 m/s", "truck circle 8 m/s", "boat in waves"],
)
def test_a_vehicle_on_a_moving_deck_is_carried_without_creeping(carrier: CarrierSettings, path) -> None:
    contact, deck = make_contact(), make_deck(carrier, path)
    body = standing_on(deck.at(0.0), forward=0.2, right=-0.1)
    start = in_pad(body, run(body, contact, deck, 0.0, 5.0))
    end = in_pad(body, run(body, contact, deck, 5.0, 25.0))
    assert math.dist(start, end) < 0.003
    assert contact.state.feet_on_deck == 4


def test_a_vehicle_with_the_decks_speed_does_not_slide_when_it_touches() -> None:
    contact, deck = make_contact(), make_deck(TruckSettings(speed_wobble_m_s=0.0), LineSettings(speed_m_s=15.0))
    body = standing_on(deck.at(0.0), gap=0.05)
    end = run(body, contact, deck, 0.0, 2.0)
    assert pad_distance(body.position, end) < 0.01


def test_a_vehicle_slower_than_the_deck_slides_by_speed_squared_over_friction() -> None:
    contact, deck = (
        make_contact(friction=0.5),
        make_deck(RoverSettings(speed_wobble_m_s=0.0), LineSettings(speed_m_s=2.0)),
    )
    body = standing_on(deck.at(0.0), forward=0.5)
    body.velocity = tuple(0.5 * v for v in body.velocity)
    slid = 0.5 - in_pad(body, run(body, contact, deck, 0.0, 2.0))[0]
    assert slid == pytest.approx(1.0 / (2.0 * 0.5 * G), rel=0.05)


def test_a_deck_without_friction_drives_away_under_the_vehicle() -> None:
    contact, deck = make_contact(friction=0.0), make_deck(RoverSettings(), LineSettings(speed_m_s=2.0))
    body = standing_on(deck.at(0.0))
    body.velocity = (0.0, 0.0, 0.0)
    run(body, contact, deck, 0.0, 3.0)
    assert contact.state.feet_on_deck == 0
    assert contact.state.feet_on_ground + contact.state.frame_on_ground > 0


@pytest.mark.parametrize("restitution", [0.1, 0.3, 0.6])
def test_a_flat_drop_rebounds_with_the_restitution_asked_for(restitution: float) -> None:
    contact, deck = make_contact(restitution), still_deck()
    # High enough that the weight hardly matters during the impact.
    body = standing_on(deck.at(0.0), gap=0.4)
    fastest_down = fastest_up = 0.0
    for i in range(600):
        run(body, contact, deck, i * 0.001, 0.001)
        fastest_down = max(fastest_down, body.velocity[2])
        fastest_up = min(fastest_up, body.velocity[2])
    assert -fastest_up / fastest_down == pytest.approx(restitution, abs=0.03)


@pytest.mark.parametrize("mass", [0.3, 1.0, 2.0, 10.0])
def test_contact_is_stable_for_light_and_heavy_vehicles(mass: float) -> None:
    contact, deck = make_contact(mass=mass), still_deck()
    body = standing_on(deck.at(0.0), gap=0.1)
    body.mass, body.inertia = mass, (0.006 * mass, 0.006 * mass, 0.012 * mass)
    body.q = (math.cos(0.1), math.sin(0.1), 0.0, 0.0)
    run(body, contact, deck, 0.0, 4.0)
    assert math.hypot(*body.velocity) < 1e-4
    assert math.hypot(*body.rates) < 1e-3
    assert upright_angle(body.q) < 0.01


def test_a_vehicle_with_its_centre_beyond_the_edge_falls_off_the_deck() -> None:
    contact, deck = make_contact(), still_deck()
    body = standing_on(deck.at(0.0), forward=0.75 + 0.05)
    run(body, contact, deck, 0.0, 2.0)
    assert body.position[2] > -0.4
    assert contact.state.feet_on_ground + contact.state.frame_on_ground > 0


def test_a_vehicle_with_its_feet_just_inside_the_edge_stays_on_the_deck() -> None:
    contact, deck = make_contact(), still_deck()
    body = standing_on(deck.at(0.0), forward=0.75 - 0.18)
    run(body, contact, deck, 0.0, 2.0)
    assert contact.state.feet_on_deck == 4
    assert upright_angle(body.q) < 0.05


def test_a_vehicle_beside_a_moving_deck_is_struck_by_its_side_and_pushed() -> None:
    contact, deck = make_contact(), make_deck(RoverSettings(), LineSettings(speed_m_s=1.5))
    front = standing_on(deck.at(0.0), forward=2.0)
    body = RigidBody((front.position[0], front.position[1], -LEG_M), q=front.q)
    hits = 0
    for i in range(2000):
        run(body, contact, deck, i * 0.001, 0.001)
        hits = max(hits, contact.state.side_hits)
    assert hits > 0
    assert in_pad(body, deck.at(2.0))[0] > 0.75


def test_clearance_is_never_more_than_the_true_distance_and_is_large_high_above() -> None:
    contact, deck = make_contact(), still_deck()
    x, y, _ = deck.at(0.0).position_ned_m
    assert contact.clearance_m((0.0, 0.0, -10.0), deck.at(0.0)) > 9.0
    assert contact.clearance_m((x + 5.0, y, -0.6), deck.at(0.0)) > 0.2
    assert contact.clearance_m((x, y, -DECK_M - LEG_M - 0.01), deck.at(0.0)) <= 0.01
    assert contact.clearance_m((x + 5.0, y, -LEG_M), deck.at(0.0)) <= 0.0


def test_the_gap_under_the_lowest_foot_is_measured_to_the_deck_or_the_ground() -> None:
    contact, deck = make_contact(), still_deck()
    for forward, gap in ((0.0, 0.2), (3.0, 0.2 + DECK_M)):
        body = standing_on(deck.at(0.0), forward=forward, gap=0.2)
        contact.step(body.position, body.velocity, body.q, body.rates, deck.at(0.0))
        assert contact.state.gap_m == pytest.approx(gap)


def test_a_tilting_deck_lets_a_vehicle_slide_when_it_is_steeper_than_friction_holds() -> None:
    def slid(friction: float) -> float:
        contact = make_contact(friction=friction)
        slope = math.radians(20.0)
        tilted = DeckState(
            (0.0, 0.0, -2.0),
            (0.0, 0.0, 0.0),
            (math.cos(slope), 0.0, math.sin(slope), 0.0, 1.0, 0.0, -math.sin(slope), 0.0, math.cos(slope)),
            (0.0, 0.0, 0.0),
            (0.0, slope, 0.0),
        )
        body = RigidBody((-LEG_M * math.sin(slope), 0.0, -2.0 - LEG_M * math.cos(slope)))
        body.q = (math.cos(0.5 * slope), 0.0, math.sin(0.5 * slope), 0.0)
        for _ in range(600):
            touch = contact.step(body.position, body.velocity, body.q, body.rates, tilted)
            body.step(0.001, touch.force_ned_n, touch.torque_frd_nm)
        return math.hypot(in_pad(body, tilted)[0], in_pad(body, tilted)[1])

    assert slid(0.5) < 0.01
    along_m = 0.5 * G * (math.sin(math.radians(20.0)) - 0.2 * math.cos(math.radians(20.0))) * 0.6**2
    assert slid(0.2) == pytest.approx(along_m, rel=0.1)
